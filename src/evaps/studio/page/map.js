// The map of the scene: drawing it, and moving what is on it with mouse, finger and keys.

import { $, facts, state } from "./state.js";

const FEW = 12; // things that have their names beside them
const WIDE = 640; // in the units of the picture
const TURN = 15; // degrees a key press, if the robot can stand like that

let moved = () => {};
/** What is to be done when the scene has become another. */
export const whenMoved = (action) => { moved = action; };

let moving = () => {};
/** And while something is being dragged. */
export const whileMoving = (action) => { moving = action; };
let dragged = false;

const SVG = "http://www.w3.org/2000/svg";
export function shape(name, attributes, parent) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent?.append(made);
  return made;
}

const span = ([low, high]) => high - low;
const scale = () => WIDE / span(facts.arena.x);
const across = (x) => (x - facts.arena.x[0]) * scale();
const down = (y) => (facts.arena.y[1] - y) * scale();
const shift = (place) => `translate(${across(place.x)} ${down(place.y)})`;
const radius = (kind) => (facts.radii[kind] ?? facts.radii.robot) * scale(); // in the picture
const reach = (kind) => Math.max(radius(kind), Math.min(24, facts.grid ? (facts.grid / 2) * scale() : 24)); // of a finger
const step = () => Math.max(1, Math.round(span(facts.arena.x) / 80)); // a key press, in units of the world

export function drawMap(keep) {
  if (dragged) return; // what is in the hand must not be drawn anew
  const map = $("map");
  const focused = [...map.querySelectorAll(".thing")].indexOf(document.activeElement);
  keep ??= focused < 0 ? undefined : focused;
  map.setAttribute("viewBox", `0 0 ${WIDE} ${span(facts.arena.y) * scale()}`);
  map.replaceChildren();
  const moments = state.run?.moments.slice(0, state.time + 1) ?? [];
  const now = moments.at(-1)?.state;
  const alike = (things, thing) => things.filter((t) => t.alive !== false && t.kind === thing.kind && near(t, thing)).length;
  drawGrid(map);
  if (moments.length > 1) {
    const way = moments.map((m) => `${across(m.state.x)},${down(m.state.y)}`).join(" ");
    shape("polyline", { class: "way", points: way }, map);
    marker(map, now.x, now.y, now.heading, "ghost");
  }
  state.scene.things.forEach((thing, index) => {
    const changes = now && alike(moments[0].state.things, thing) > 0; // what stays as it is is in no state
    const gone = changes && alike(state.scene.things.slice(0, index), thing) >= alike(now.things, thing);
    const group = item(map, thing, `${thing.kind} ${index + 1}`, gone);
    body(thing.kind, group);
    shape("circle", { class: "hit", r: reach(thing.kind) }, group);
    shape("title", {}, group).textContent = thing.kind;
    const number = changes ? alike(now.things, thing) : alike(state.scene.things, thing);
    const name = state.scene.things.length > FEW ? "" : thing.kind; // names must not cover their neighbours
    label(number > 1 ? number : name, group, number > 1 ? 0 : radius(thing.kind));
  });
  for (const thing of now?.things ?? []) { // what was not there at the beginning
    if (!thing.alive || alike(moments[0].state.things, thing)) continue;
    const group = shape("g", { class: "put", transform: shift(thing) }, map);
    body(thing.kind, group);
    const number = alike(now.things, thing);
    label(number > 1 ? number : "", group);
  }
  const robot = item(map, state.scene.robot, `The robot, heading ${state.scene.robot.heading} degrees`, false);
  shape("circle", { class: "body robot", r: radius("robot") }, robot);
  shape("circle", { class: "hit", r: reach("robot") }, robot);
  const angle = (state.scene.robot.heading * Math.PI) / 180;
  shape("line", { x2: (radius("robot") + 24) * Math.cos(angle), y2: -(radius("robot") + 24) * Math.sin(angle), stroke: "var(--accent)", "stroke-width": 6 }, robot);
  oneTabStop([...map.querySelectorAll(".thing")]);
  if (keep !== undefined) map.querySelectorAll(".thing")[keep]?.focus();
}

/** Tab leads to one thing of the map, which may hold a hundred: the one that was last worked on, else the robot. */
function oneTabStop(things) {
  const pick = (index) => {
    state.picked = index;
    things.forEach((thing, other) => thing.setAttribute("tabindex", other === index ? 0 : -1));
    things.forEach((thing, other) => thing.classList.toggle("picked", other === index));
    const place = pickedPlace();
    $("picked").textContent = isRobot(place) ? "the robot" : `${place.kind} ${index + 1}`;
    $("turn-it-left").hidden = $("turn-it-right").hidden = !isRobot(place);
    $("take-it").hidden = stays(place);
  };
  things.forEach((thing, index) => thing.addEventListener("focus", () => pick(index)));
  pick(Math.min(state.picked, things.length - 1));
}

/** Cells, if there are any, and what lies beyond the thing that ends the scene. */
function drawGrid(map) {
  const end = state.scene.things.find((thing) => thing.kind === facts.border);
  if (end) {
    const [x, y] = [across(end.x - facts.grid / 2), down(end.y - facts.grid / 2)];
    shape("rect", { class: "beyond", x, y: 0, width: "100%", height: "100%" }, map);
    shape("rect", { class: "beyond", x: 0, y: 0, width: Math.max(0, x), height: Math.max(0, y) }, map);
  }
  for (let at = facts.grid; at && at < span(facts.arena.x); at += facts.grid)
    shape("line", { class: "grid", x1: at * scale(), x2: at * scale(), y2: "100%" }, map);
  for (let at = facts.grid; at && at < span(facts.arena.y); at += facts.grid)
    shape("line", { class: "grid", y1: at * scale(), y2: at * scale(), x2: "100%" }, map);
}

const NEITHER = "#8a8a96"; // what cannot be put there
const OTHERS = ["#d0655a", "#5a9a4a", "#a9793a", "#8a6fc0", "#3f9a9a", "#d99a1c"];
/** How a kind of things is painted: the style sheet knows some, the others have colours in turn. */
export const look = (kind) => ({ class: `body ${kind}`, fill: OTHERS[facts.kinds.indexOf(kind) % OTHERS.length] ?? NEITHER });

function body(kind, group) {
  const r = radius(kind);
  const square = { x: -r, y: -r, width: 2 * r, height: 2 * r };
  const [name, size] = facts.blocks.includes(kind) ? ["rect", square] : ["circle", { r }];
  shape(name, { ...look(kind), ...size }, group);
}

/** A number stands in the middle, and so does a name if there is room for it in the thing; else it stands beside. */
function label(text, group, room = 0) {
  const beside = room > 0 && room <= 20;
  const place = beside ? { x: room + 4, "text-anchor": "start" } : { "text-anchor": "middle" };
  shape("text", { y: 5, ...place }, group).textContent = text;
}

const near = (a, b) => Math.hypot(a.x - b.x, a.y - b.y) <= facts.tolerance;

function marker(map, x, y, heading, name) {
  const angle = (heading * Math.PI) / 180;
  shape("circle", { class: name, cx: across(x), cy: down(y), r: radius("robot") }, map);
  shape("line", { class: name, x1: across(x), y1: down(y), x2: across(x) + 34 * Math.cos(angle), y2: down(y) - 34 * Math.sin(angle) }, map);
}

export const pickedPlace = () => state.scene.things[state.picked] ?? state.scene.robot;

/** Something on the map that can be dragged, and moved with keys. */
function item(map, place, label, gone) {
  const group = shape("g", { class: `thing${gone ? " dead" : ""}`, role: "button", "aria-label": `${label}, x ${place.x}, y ${place.y}`,
    transform: shift(place) }, map);
  group.addEventListener("pointerdown", (event) => drag(event, place));
  group.addEventListener("touchstart", (event) => event.preventDefault()); // a finger on it does not scroll the page
  group.addEventListener("keydown", (event) => onKey(event, place));
  return group;
}

const isThere = (place) => isRobot(place) || state.scene.things.includes(place);
const isRobot = (place) => place === state.scene.robot;
const stays = (place) => isRobot(place) || place.kind === facts.border;
const clamp = (value, [low, high]) => Math.min(high, Math.max(low, Math.round(value)));

function move(place, x, y) {
  const [wide, high] = isRobot(place) ? facts.places.robot : facts.places.things;
  place.x = clamp(x, wide);
  place.y = clamp(y, high);
}

function drag(event, place) {
  if (event.button !== 0) return;
  event.preventDefault();
  const [map, group] = [$("map"), event.currentTarget];
  group.focus();
  let changed = false;
  const other = (e) => e.pointerId !== event.pointerId; // a second finger
  const to = (e) => {
    if (other(e)) return;
    if (!isThere(place)) { // another scene has come meanwhile
      letGo();
      return;
    }
    const point = new DOMPoint(e.clientX, e.clientY).matrixTransform(map.getScreenCTM().inverse());
    const before = [place.x, place.y];
    move(place, point.x / scale() + facts.arena.x[0], facts.arena.y[1] - point.y / scale());
    group.setAttribute("transform", shift(place)); // a finger hears no more of what is drawn anew under it
    if (place.x === before[0] && place.y === before[1]) return;
    if (!changed) for (const trace of map.querySelectorAll(".way, .ghost, .put")) trace.remove(); // of a run elsewhere
    changed = true;
    moving();
  };
  dragged = true;
  const over = new AbortController();
  const letGo = () => {
    over.abort();
    dragged = false;
    if (changed && isThere(place)) moved();
    else drawMap();
  };
  const end = (e) => {
    if (!other(e)) letGo();
  };
  addEventListener("pointermove", to, { signal: over.signal });
  for (const name of ["pointerup", "pointercancel"]) addEventListener(name, end, { signal: over.signal });
}

export function turn(robot, left) {
  const angle = Math.max(TURN, facts.headings);
  robot.heading = (robot.heading + (left ? angle : 360 - angle)) % 360;
}

export function takeAway(thing) {
  state.scene.things.splice(state.scene.things.indexOf(thing), 1);
}

function onKey(event, place) {
  const far = step() * (event.shiftKey ? 4 : 1);
  const moves = { ArrowLeft: [-far, 0], ArrowRight: [far, 0], ArrowUp: [0, far], ArrowDown: [0, -far] };
  const index = isRobot(place) ? state.scene.things.length : state.scene.things.indexOf(place);
  if (event.key in moves) move(place, place.x + moves[event.key][0], place.y + moves[event.key][1]);
  else if (event.key === "n" || event.key === "p") {
    const things = [...$("map").querySelectorAll(".thing")];
    event.preventDefault();
    things.at((index + (event.key === "n" ? 1 : -1)) % things.length).focus();
    return;
  } else if (isRobot(place) && (event.key === "[" || event.key === "]")) turn(place, event.key === "[");
  else if (!stays(place) && (event.key === "Delete" || event.key === "Backspace")) takeAway(place);
  else return;
  event.preventDefault();
  moved();
  drawMap(index);
}

/** Put a new thing into a free place, looked for on a grid. */
export function add(kind) {
  const others = [{ kind: "robot", ...state.scene.robot }, ...state.scene.things];
  const free = (x, y) => others.every((o) => Math.max(Math.abs(o.x - x), Math.abs(o.y - y)) > (radius(o.kind) + radius(kind) + 4) / scale());
  const [wide, high] = facts.places.things;
  const apart = Math.max(1, Math.round(span(facts.arena.x) / 10));
  const middle = (axis) => (Math.min(...others.map((o) => o[axis])) + Math.max(...others.map((o) => o[axis]))) / 2;
  const far = (place) => Math.hypot(place.x - middle("x"), place.y - middle("y"));
  const places = [];
  for (let y = high[0]; y <= high[1]; y += apart)
    for (let x = wide[0]; x <= wide[1]; x += apart) if (free(x, y)) places.push({ kind, x, y });
  if (!places.length) throw new Error("There is no room for another one.");
  state.scene.things.push(places.sort((a, b) => far(a) - far(b))[0]);
  moved();
}
