// The studio's page: functions that draw a part of the state each, and what its buttons do.

import { add, drawMap, pickedPlace, shape, takeAway, turn, whenMoved } from "./map.js";
import { ask, askJson, linesOf } from "./server.js";
import { $, facts, state } from "./state.js";

let keys = {}; // of the keyboard, and the actions that they are for

function say(text) {
  $("message").hidden = !text;
  $("message").textContent = text ?? "";
}

/** A listener that says what went wrong, and lets a button be pressed once at a time; without an event, what was said stays. */
function safely(action) {
  return async (event) => {
    const button = event?.currentTarget instanceof HTMLButtonElement ? event.currentTarget : null;
    if (button?.getAttribute("aria-busy")) return;
    button?.setAttribute("aria-busy", "true");
    try {
      if (event) say(null);
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
  $("now").textContent = action ? `next: ${facts.words[action]}` : moments.length > 1 ? ending : "";
  $("driven").textContent = state.driven.map((a) => facts.words[a]).join(", ") || "nothing yet";
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

let inHand = Promise.resolve();
/** One change of the scene or its actions after the other, however quickly they are asked for: none falls into the scene before. */
function inTurn(change) {
  inHand = inHand.catch(() => {}).then(change);
  return inHand;
}

const drive = (action) => inTurn(async () => {
  state.driven.push(action);
  enable();
  try {
    await refresh();
  } catch (error) { // an action that fails is taken back
    state.driven.pop();
    enable();
    throw error;
  }
  if (state.run?.halted === false) { // and so is one too many
    state.driven.pop();
    await refresh();
    throw new Error(`${state.driven.length} actions are the most that a run can have`);
  }
});

const undo = () => inTurn(async () => { state.driven.pop(); await refresh(); });
const restart = () => inTurn(async () => { state.driven = []; await refresh(); });

const randomScene = () => inTurn(async () => {
  state.scene = await askJson("api/random-scene", {});
  state.picked = Infinity;
  sceneChanged();
});

function choose(name) {
  for (const tab of ["drive", "program"]) {
    const chosen = tab === name;
    $(`tab-${tab}`).setAttribute("aria-selected", chosen);
    $(`tab-${tab}`).tabIndex = chosen ? 0 : -1;
    $(tab).hidden = !chosen;
  }
  state.byHand = name === "drive";
  enable();
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

const runProgram = () => inTurn(async () => {
  state.byHand = false;
  state.driven = [];
  await refresh(false);
  $("code-error").textContent = "";
});

/** While other examples are on their way, nothing can be done with those that are there. */
async function replaceExamples(work) {
  state.changing = true;
  enable();
  try {
    await work();
  } finally {
    state.changing = false;
    enable();
  }
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
  const fixed = state.job !== null || state.changing; // what is searched for has to stay as it is
  $("keep").disabled = full || !current || state.run.halted === false || fixed;
  $("save").disabled = !full || state.changing;
  for (const id of ["five", "clear", "tasks", "random-task"]) $(id).disabled = fixed;
  for (const remove of document.querySelectorAll("button.remove")) remove.disabled = fixed;
  $("synthesize").disabled = !full || fixed;
}

/** Where the focus goes, if what had it cannot have it any longer. */
function refocus(...ids) {
  const at = document.activeElement;
  if (at && at !== document.body && !at.disabled && at.offsetParent !== null) return;
  ids.map($).find((element) => !element.disabled && element.offsetParent !== null)?.focus();
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

const go = (index) => inTurn(async () => {
  state.scene = structuredClone(state.examples[index].scene);
  state.picked = Infinity;
  state.driven = [];
  forgetRun();
  drawMap();
  await refresh(state.byHand);
});

async function load(task) {
  state.examples = task.examples;
  $("task-name").value = task.name.replace(/[^A-Za-z0-9 _-]+/g, "-").replace(/^[^A-Za-z0-9]+/, "").slice(0, 60) || "task";
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
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000); // some browsers begin to read it late
}

// --- synthesis ----------------------------------------------------------------------------------------------

/** It was for other examples. */
function forgetAnswer() {
  $("log").replaceChildren();
  $("verdict").textContent = "";
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
    refocus("verdict", "synthesize");
  }
}

function hear(line) {
  if (line.error) throw new Error(line.error);
  if (line.job) {
    state.job = line.job;
    $("stop").hidden = false;
    refocus("stop");
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
  on("random-scene", randomScene);
  for (const left of [true, false]) on(`turn-it-${left ? "left" : "right"}`, () => { turn(state.scene.robot, left); sceneChanged(); });
  on("take-it", () => { takeAway(pickedPlace()); sceneChanged(); });
  on("time", () => { if (!state.run) return; state.time = Number($("time").value); drawMoment(); }, "input");
  on("undo", undo);
  on("restart", restart);
  on("run", runProgram);
  on("five", () => replaceExamples(makeFive));
  on("keep", () => { state.examples.push(exampleOf(state.scene, state.run)); forgetAnswer(); drawExamples(); refocus("synthesize"); });
  const chosen = () => `api/tasks/${encodeURIComponent($("tasks").value)}`;
  on("tasks", () => $("tasks").value && replaceExamples(async () => load(await askJson(chosen()))), "change");
  on("random-task", () => replaceExamples(async () => load(await askJson("api/random-task", {}))));
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
    if (event.key === "Backspace") { event.preventDefault(); await undo(); return; }
    const action = keys[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    await drive(action);
  }));
}

async function begin() {
  Object.assign(facts, await askJson("api/facts"));
  state.scene = facts.scene;
  state.examples = remembered();
  keys = Object.fromEntries(facts.keys);
  $("known-keys").textContent = facts.keys.filter(([key]) => key).map(([key, action]) => `${key.toUpperCase()} ${facts.words[action]}`).join(", ");
  $("palette").append(...facts.kinds.map((kind) => {
    const made = button(`+ ${kind} `, () => add(kind));
    const colour = shape("svg", { viewBox: "0 0 10 10", width: 12, height: 12, "aria-hidden": true });
    shape("rect", { class: `body ${kind}`, width: 10, height: 10, rx: facts.blocks.includes(kind) ? 0 : 5 }, colour);
    made.append(colour);
    return made;
  }));
  $("buttons").append(...facts.keys.map(([, action]) => {
    const made = button(facts.words[action], () => {});
    made.addEventListener("click", () => { safely(() => drive(action))({}); }); // as often as it is pressed
    return made;
  }));
  $("known-actions").textContent = Object.values(facts.calls.actions).join(" ");
  $("known-conditions").textContent = facts.calls.conditions.join(" ");
  $("tasks").append(...facts.tasks.map((name) => new Option(name, name)));
  $("method").append(...facts.methods.map((name) => new Option(name, name)));
  $("code").value = facts.program;
  $("actions").value = facts.budget;
  $("depth").closest("figure").hidden = !facts.depth;
  whenMoved(sceneChanged);
  listen();
  drawExamples();
  drawMap();
  await refresh();
}

safely(begin)();
