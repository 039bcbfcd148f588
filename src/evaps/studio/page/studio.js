// The studio's page: one state, and functions that draw a part of it each.
"use strict";

const $ = (id) => document.getElementById(id);
const GONE = "the studio does not answer; is `evaps studio` still running?";
const FEW = 12; // things on the map that have their names beside them
const WIDE = 640; // the map, in the units of its picture
const TURN = 15; // degrees a key press, if the robot can stand like that

let facts;
let keys = {};  // of the keyboard, and the actions that they are for
let words = {}; // of the actions, for people
const state = {
  scene: null,
  picked: Infinity, // which thing of the map Tab leads to; the robot is the last of them
  driven: [],      // actions, if the robot is driven by hand
  byHand: true,
  run: null,       // what /api/run said of the current scene
  time: 0,
  examples: [],    // at most five: { scene, goal_rgb, goal_depth, first }
  job: null,       // the search that is under way
  budget: 0,       // how many actions it may simulate
};

// --- asking the server -------------------------------------------------------------------------------------

async function ask(path, body) {
  const options = body === undefined ? {} : {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  let reply;
  try {
    reply = await fetch(path, options);
  } catch {
    throw new Error(GONE);
  }
  if (!reply.ok) throw new Error((await reply.json().catch(() => ({}))).error ?? `error ${reply.status}`);
  return reply;
}

const askJson = async (path, body) => (await ask(path, body)).json();

function say(text) {
  $("message").hidden = !text;
  $("message").textContent = text ?? "";
}

/** A listener that says what went wrong, and lets a button be pressed once at a time. */
function safely(action) {
  return async (event) => {
    const button = event?.currentTarget instanceof HTMLButtonElement ? event.currentTarget : null;
    if (button?.getAttribute("aria-busy")) return;
    button?.setAttribute("aria-busy", "true");
    try {
      say(null);
      await action(event);
    } catch (error) {
      say(error.message);
    } finally {
      button?.removeAttribute("aria-busy");
    }
  };
}

// --- running ------------------------------------------------------------------------------------------------

const asPython = (actions) => "def run():\n" + actions.map((a) => `    ${facts.calls.actions[a]}\n`).join("");
const program = () => (state.byHand ? (state.driven.length ? asPython(state.driven) : null) : $("code").value);

let asked = 0;
let waiting; // for a scene that is still being changed
/** Run a program on the scene, or only look at it; only the answer to the newest question counts. */
async function refresh(atEnd = true, what = program()) {
  clearTimeout(waiting);
  const question = ++asked;
  const found = await askJson("api/run", { scene: state.scene, program: what });
  if (question !== asked) return;
  state.run = { ...found, program: what };
  state.time = atEnd ? found.moments.length - 1 : 0;
  drawMoment();
  await tellReplaced();
}

async function tellReplaced() {
  const health = await askJson("api/health");
  if (health.engines_replaced > (tellReplaced.before ?? Infinity)) { // what was before this page is no news
    say("An engine had died; a new one has taken its place, and nothing is lost.");
  }
  tellReplaced.before = health.engines_replaced;
}

function refreshSoon() {
  clearTimeout(waiting);
  waiting = setTimeout(safely(() => refresh(true, null)), 120);
}

/** What was run was run on another scene: until there is an answer for this one, there is nothing to keep. */
function sceneChanged() {
  asked++;
  state.driven = [];
  forgetRun();
  drawMap();
  refreshSoon();
}

function forgetRun() {
  state.run = null;
  state.time = 0;
  $("world").classList.add("stale");
  enable();
}

// --- the map ------------------------------------------------------------------------------------------------

const SVG = "http://www.w3.org/2000/svg";
function shape(name, attributes, parent) {
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
const step = () => Math.max(1, Math.round(span(facts.arena.x) / 80)); // a key press, in units of the world

function drawMap(keep) {
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
    shape("circle", { class: "hit", r: Math.max(24, radius(thing.kind)) }, group);
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
  shape("circle", { class: "hit", r: Math.max(24, radius("robot")) }, robot);
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

function body(kind, group) {
  const r = radius(kind);
  const square = { x: -r, y: -r, width: 2 * r, height: 2 * r };
  const [name, size] = facts.blocks.includes(kind) ? ["rect", square] : ["circle", { r }];
  shape(name, { class: `body ${kind}`, ...size }, group);
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

const pickedPlace = () => state.scene.things[state.picked] ?? state.scene.robot;

/** Something on the map that can be dragged, and moved with keys. */
function item(map, place, label, gone) {
  const group = shape("g", { class: `thing${gone ? " dead" : ""}`, role: "button", "aria-label": `${label}, x ${place.x}, y ${place.y}`,
    transform: shift(place) }, map);
  group.addEventListener("pointerdown", (event) => drag(event, place));
  group.addEventListener("touchstart", (event) => event.preventDefault()); // a finger on it does not scroll the page
  group.addEventListener("keydown", (event) => onKey(event, place));
  return group;
}

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
  const before = [place.x, place.y];
  const to = (e) => {
    const point = new DOMPoint(e.clientX, e.clientY).matrixTransform(map.getScreenCTM().inverse());
    move(place, point.x / scale() + facts.arena.x[0], facts.arena.y[1] - point.y / scale());
    group.setAttribute("transform", shift(place)); // a finger hears no more of what is drawn anew under it
  };
  const over = new AbortController();
  const end = () => {
    over.abort();
    if (place.x !== before[0] || place.y !== before[1]) sceneChanged();
  };
  addEventListener("pointermove", to, { signal: over.signal });
  for (const name of ["pointerup", "pointercancel"]) addEventListener(name, end, { signal: over.signal });
}

function turn(robot, left) {
  const angle = Math.max(TURN, facts.headings);
  robot.heading = (robot.heading + (left ? angle : 360 - angle)) % 360;
}

function takeAway(thing) {
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
  sceneChanged();
  drawMap(index);
}

/** A free place for a new thing, looked for on a grid. */
function add(kind) {
  const others = [{ kind: "robot", ...state.scene.robot }, ...state.scene.things];
  const free = (x, y) => others.every((o) => Math.max(Math.abs(o.x - x), Math.abs(o.y - y)) > (radius(o.kind) + radius(kind) + 4) / scale());
  const [wide, high] = facts.places.things;
  const apart = Math.max(1, Math.round(span(facts.arena.x) / 10));
  const middle = (axis) => (Math.min(...others.map((o) => o[axis])) + Math.max(...others.map((o) => o[axis]))) / 2;
  const far = (place) => Math.hypot(place.x - middle("x"), place.y - middle("y"));
  const places = [];
  for (let y = high[0]; y <= high[1]; y += apart)
    for (let x = wide[0]; x <= wide[1]; x += apart) if (free(x, y)) places.push({ kind, x, y });
  if (places.length) {
    state.scene.things.push(places.sort((a, b) => far(a) - far(b))[0]);
    sceneChanged();
    return;
  }
  say("There is no room for another one.");
}

// --- what is seen -------------------------------------------------------------------------------------------

function drawMoment() {
  const { moments } = state.run;
  $("world").classList.remove("stale");
  const moment = moments[state.time];
  $("rgb").src = moment.rgb;
  $("depth").src = moment.depth;
  $("time").max = moments.length - 1;
  $("time").value = state.time;
  $("time-text").textContent = `${state.time} of ${moments.length - 1}`;
  $("perceptions").replaceChildren(...facts.perceptions.map((key) => {
    const chip = document.createElement("li");
    const is = moment.perceived.includes(key);
    chip.className = is ? "true" : "";
    chip.textContent = `${facts.words[key]}: ${is ? "yes" : "no"}`;
    return chip;
  }));
  const action = state.run.actions?.[state.time];
  const ending = state.run.halted === false ? "stopped: too many steps" : "the end";
  $("now").textContent = action ? `next: ${words[action]}` : moments.length > 1 ? ending : "";
  $("driven").textContent = state.driven.map((a) => words[a]).join(", ") || "nothing yet";
  enable();
  drawLines(moment.lines);
  drawMap();
}

/** Marks behind the editor's text: the lines that are at work, and the one that is wrong. */
function drawLines(at = [], wrong) {
  $("lines").replaceChildren(...$("code").value.split("\n").map((text, index) => {
    const line = document.createElement("span");
    line.textContent = `${text || " "}\n`;
    if (!state.byHand && at.includes(index)) line.className = "at";
    if (index + 1 === wrong) line.className = "wrong";
    return line;
  }));
  $("lines").scrollTop = $("code").scrollTop;
  $("lines").scrollLeft = $("code").scrollLeft;
}

// --- driving, and programs ----------------------------------------------------------------------------------

let driving = Promise.resolve();
/** One action after the other, however quickly the keys are pressed, so that each that fails is taken back. */
function drive(action) {
  driving = driving.catch(() => {}).then(async () => {
    state.driven.push(action);
    enable();
    try {
      await refresh();
    } catch (error) {
      state.driven.pop();
      enable();
      throw error;
    }
  });
  return driving;
}

function choose(name) {
  for (const tab of ["drive", "program"]) {
    const chosen = tab === name;
    $(`tab-${tab}`).setAttribute("aria-selected", chosen);
    $(`tab-${tab}`).tabIndex = chosen ? 0 : -1;
    $(tab).hidden = !chosen;
  }
  state.byHand = name === "drive";
}

let checking;
function check() {
  clearTimeout(checking);
  checking = setTimeout(safely(async () => {
    const found = await askJson("api/check", { program: $("code").value });
    $("code-error").textContent = found.error?.message ?? "";
    drawLines([], found.error?.line);
    enable();
  }), 250);
}

async function runProgram() {
  state.byHand = false;
  state.driven = [];
  await refresh(false);
  $("code-error").textContent = "";
}

async function makeFive() {
  const text = $("code").value;
  const made = [];
  for (let tries = 0; made.length < facts.examples && tries < 40; tries++) {
    const scene = await askJson("api/random-scene", {});
    const run = await askJson("api/run", { scene, program: text });
    if (run.halted) made.push(exampleOf(scene, run));
  }
  if (made.length < facts.examples) throw new Error("the program does not come to an end in enough random scenes");
  state.examples = made;
  forgetAnswer();
  drawExamples();
}

// --- examples -----------------------------------------------------------------------------------------------

function exampleOf(scene, run) {
  const last = run.moments.at(-1);
  return { scene: structuredClone(scene), goal_rgb: last.rgb, goal_depth: last.depth, first: run.moments[0].rgb };
}

function drawExamples(passed = []) {
  const slots = Array.from({ length: facts.examples }, (_, index) => {
    const slot = document.createElement("li");
    const example = state.examples[index];
    const head = document.createElement("strong");
    head.textContent = `Example ${index + 1}`;
    slot.append(head);
    if (!example) return slot;
    slot.className = "filled";
    if (passed.length) {
      const mark = document.createElement("span");
      mark.className = passed[index] ? "yes" : "no";
      mark.textContent = passed[index] ? " reached" : " not yet";
      slot.append(mark);
    }
    slot.append(picture(example.first, "starts with", index), picture(example.goal_rgb, "should see", index));
    const remove = button("Remove", () => {
      state.examples.splice(index, 1);
      drawExamples();
      forgetAnswer();
      $("examples").querySelectorAll("button.remove")[Math.min(index, state.examples.length - 1)]?.focus();
    });
    remove.className = "remove";
    slot.append(button("Go there", () => go(index)), remove);
    return slot;
  });
  $("examples").replaceChildren(...slots);
  remember();
  enable();
}

/** Examples outlive a reload, in this tab and for this robot. */
const shelf = () => `examples of ${Object.keys(facts.calls.actions).join(" ")}`;

function remember() {
  try {
    sessionStorage.setItem(shelf(), JSON.stringify(state.examples));
  } catch {
    // there is no room, or the browser keeps nothing: then they do not
  }
}

function remembered() {
  try {
    return JSON.parse(sessionStorage.getItem(shelf())) ?? [];
  } catch {
    return [];
  }
}

/** Which buttons can be pressed now. */
function enable() {
  const full = state.examples.length >= facts.examples;
  const current = state.run !== null && state.run.program === program();
  const searching = state.job !== null; // what it searches for has to stay as it is
  $("keep").disabled = full || !current || state.run.halted === false || searching;
  $("save").disabled = !full;
  for (const id of ["five", "clear", "tasks", "random-task"]) $(id).disabled = searching;
  for (const remove of document.querySelectorAll("button.remove")) remove.disabled = searching;
  $("synthesize").disabled = !full || searching;
}

function picture(source, caption, index) {
  const figure = document.createElement("figure");
  const image = document.createElement("img");
  if (source) image.src = source;
  image.alt = `Example ${index + 1} ${caption}`;
  const text = document.createElement("figcaption");
  text.textContent = caption;
  figure.append(image, text);
  return figure;
}

function button(text, action) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.addEventListener("click", safely(action));
  return made;
}

async function go(index) {
  state.scene = structuredClone(state.examples[index].scene);
  state.picked = Infinity;
  state.driven = [];
  forgetRun();
  drawMap();
  await refresh(state.byHand);
}

async function load(task) {
  state.examples = task.examples;
  $("task-name").value = task.name;
  forgetAnswer();
  drawExamples();
  for (const example of state.examples) {
    example.first = (await askJson("api/run", { scene: example.scene })).moments[0].rgb;
  }
  drawExamples();
  choose("drive");
  await go(0);
}

const asTask = () => ({
  name: $("task-name").value,
  examples: state.examples.map(({ scene, goal_rgb, goal_depth }) => ({ scene, goal_rgb, goal_depth })),
});

async function save() {
  const content = await (await ask("api/task.zip", asTask())).blob();
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = `${$("task-name").value}.zip`;
  link.click();
  URL.revokeObjectURL(link.href);
}

// --- synthesis ----------------------------------------------------------------------------------------------

/** It was for other examples. */
function forgetAnswer() {
  $("log").replaceChildren();
  $("result").hidden = true;
  $("progress").textContent = "";
}

async function synthesize() {
  forgetAnswer();
  $("progress").textContent = "beginning...";
  state.job = "starting";
  state.budget = Number($("actions").value);
  drawExamples();
  const begun = Date.now();
  const clock = setInterval(() => {
    if (!$("log").childElementCount) $("progress").textContent = `searching, ${Math.round((Date.now() - begun) / 1000)} s...`;
  }, 1000);
  try {
    const reply = await ask("api/synthesize",
      { ...asTask(), method: $("method").value, seconds: Number($("seconds").value), actions: state.budget });
    for await (const line of linesOf(reply)) hear(line);
    await tellReplaced();
  } catch (error) {
    $("progress").textContent = "";
    throw error;
  } finally {
    clearInterval(clock);
    state.job = null;
    $("stop").hidden = true;
    enable();
  }
}

async function* linesOf(reply) {
  const reader = reply.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read().catch(() => { throw new Error(GONE); });
    if (done) return;
    const lines = (rest + value).split("\n");
    rest = lines.pop();
    for (const line of lines) yield JSON.parse(line);
  }
}

function hear(line) {
  if (line.error) throw new Error(line.error);
  if (line.job) {
    state.job = line.job;
    $("stop").hidden = false;
  }
  if (line.news) {
    const passed = line.passed.filter(Boolean).length;
    $("progress").textContent = `${passed} of ${line.passed.length} goals, ${line.actions} of ${state.budget} actions simulated, ${line.seconds.toFixed(1)} s`;
    const entry = document.createElement("li");
    entry.textContent = `${line.seconds.toFixed(1)} s: ${line.news}`;
    if (line.python && line.python !== $("log").querySelector("li:last-of-type pre, li:nth-last-of-type(2) pre")?.textContent) {
      const best = document.createElement("pre");
      best.textContent = line.python;
      entry.append(best);
    }
    $("log").append(entry);
    $("log").scrollTop = $("log").scrollHeight;
    drawExamples(line.passed);
  }
  if (line.candidates) showAnswer(line);
}

function showAnswer(answer) {
  const [best, ...others] = answer.candidates;
  $("progress").textContent = `${answer.actions} of ${state.budget} actions simulated, ${answer.seconds.toFixed(1)} s`;
  if (!best) throw new Error("the search has found no program at all");
  const sure = answer.confidence === null || !answer.solved ? "" : `, confidence ${answer.confidence.toFixed(2)}`;
  const what = answer.solved ? "It reaches all five goals" : answer.stopped ? "Stopped; the best so far" : "None reaches all goals; the best so far";
  $("verdict").textContent = `${what}${sure} (${answer.seconds.toFixed(1)} s, ${answer.actions} actions)`;
  $("verdict").className = answer.solved ? "yes" : "no";
  $("found").textContent = best.python;
  $("report").href = $("report-save").href = `api/report/${state.job}`;
  $("others-box").hidden = others.length === 0;
  $("others").replaceChildren(...others.map((other) => {
    const entry = document.createElement("li");
    entry.textContent = `${other.passed.filter(Boolean).length} of ${other.passed.length}, ${other.origin}`;
    const text = document.createElement("pre");
    text.textContent = other.python;
    entry.append(text);
    return entry;
  }));
  $("result").hidden = false;
  drawExamples(best.passed);
}

// --- beginning ----------------------------------------------------------------------------------------------

function listen() {
  const on = (id, action, event = "click") => $(id).addEventListener(event, safely(action));
  on("random-scene", async () => { state.scene = await askJson("api/random-scene", {}); state.picked = Infinity; sceneChanged(); });
  for (const left of [true, false]) on(`turn-it-${left ? "left" : "right"}`, () => { turn(state.scene.robot, left); sceneChanged(); });
  on("take-it", () => { takeAway(pickedPlace()); sceneChanged(); });
  on("time", () => { if (!state.run) return; state.time = Number($("time").value); drawMoment(); }, "input");
  on("undo", async () => { state.driven.pop(); await refresh(); });
  on("restart", async () => { state.driven = []; await refresh(); });
  on("run", runProgram);
  on("five", makeFive);
  on("keep", () => { state.examples.push(exampleOf(state.scene, state.run)); forgetAnswer(); drawExamples(); });
  on("tasks", async () => { if ($("tasks").value) await load(await askJson(`api/tasks/${encodeURIComponent($("tasks").value)}`)); }, "change");
  on("random-task", async () => { await load(await askJson("api/random-task", {})); });
  on("save", save);
  on("message", () => {});
  on("clear", () => { state.examples = []; forgetAnswer(); drawExamples(); });
  on("synthesize", synthesize);
  on("stop", async () => { await askJson(`api/stop/${state.job}`, {}); });
  on("take", async () => { choose("program"); $("code").value = $("found").textContent; await runProgram(); });
  $("code").addEventListener("input", check);
  $("code").addEventListener("scroll", () => { $("lines").scrollTop = $("code").scrollTop; $("lines").scrollLeft = $("code").scrollLeft; });
  for (const tab of ["drive", "program"]) on(`tab-${tab}`, () => { choose(tab); });
  document.querySelector("[role=tablist]").addEventListener("keydown", (event) => {
    if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    const other = state.byHand ? "program" : "drive";
    choose(other);
    $(`tab-${other}`).focus();
  });
  $("drive").addEventListener("keydown", safely(async (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Backspace") { event.preventDefault(); state.driven.pop(); await refresh(); return; }
    const action = keys[event.key.toLowerCase()];
    if (!action || (event.key === " " && event.target.id !== "")) return; // space presses other buttons
    event.preventDefault();
    await drive(action);
  }));
}

async function begin() {
  facts = await askJson("api/facts");
  state.scene = facts.scene;
  state.examples = remembered();
  keys = Object.fromEntries(facts.keys);
  words = facts.words;
  $("known-keys").textContent = facts.keys.map(([key, action]) => `${key === " " ? "Space" : key.toUpperCase()} ${words[action]}`).join(", ");
  $("palette").append(...facts.kinds.map((kind) => {
    const made = button(`+ ${kind} `, () => add(kind));
    const colour = shape("svg", { viewBox: "0 0 10 10", width: 12, height: 12, "aria-hidden": true });
    shape("rect", { class: `body ${kind}`, width: 10, height: 10, rx: facts.blocks.includes(kind) ? 0 : 5 }, colour);
    made.append(colour);
    return made;
  }));
  $("buttons").append(...facts.keys.map(([, action]) => {
    const made = button(words[action], () => {});
    made.addEventListener("click", () => { safely(() => drive(action))(); }); // as often as it is pressed
    return made;
  }));
  $("known-actions").textContent = Object.values(facts.calls.actions).join(" ");
  $("known-conditions").textContent = facts.calls.conditions.join(" ");
  $("tasks").append(...facts.tasks.map((name) => new Option(name, name)));
  $("method").append(...facts.methods.map((name) => new Option(name, name)));
  $("code").value = facts.program;
  $("actions").value = facts.budget;
  $("depth").closest("figure").hidden = !facts.depth;
  listen();
  drawExamples();
  drawMap();
  await refresh();
}

safely(begin)();
