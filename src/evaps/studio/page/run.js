// Runs of the scene at hand: driving the robot, programs, and what is seen step by step.

import { enable, safely, say } from "./buttons.js";
import { drawMap } from "./map.js";
import { askJson } from "./server.js";
import { $, facts, program, state } from "./state.js";

let asked = 0;
let waiting; // for a scene that is still being changed
/** Run a program on the scene, or only look at it; only the answer to the newest question counts. */
export async function refresh(atEnd = true, what = program()) {
  clearTimeout(waiting);
  const question = ++asked;
  const found = await askJson("api/run", { scene: state.scene, program: what });
  if (question !== asked) return;
  state.run = { ...found, program: what };
  state.time = atEnd ? found.moments.length - 1 : 0;
  drawMoment();
  await tellReplaced();
}

export async function tellReplaced() {
  const health = await askJson("api/health");
  if (health.engines_replaced > (tellReplaced.before ?? Infinity)) { // what was before this page is no news
    say("An engine had died; a new one has taken its place, and nothing is lost.");
  }
  tellReplaced.before = health.engines_replaced;
}

let following = false;
let behind = false; // the view is of where the thing was before
/** While something is dragged the view goes along, one question at a time. */
export async function follow() {
  state.run = null; // what was run was run on another scene
  state.driven = [];
  enable();
  behind = true;
  if (following) return;
  following = true;
  while (behind) {
    behind = false;
    await refresh(true, null).catch(() => {}); // a place where it cannot stay is told when it is let go there
  }
  following = false;
}

function refreshSoon() {
  clearTimeout(waiting);
  waiting = setTimeout(safely(() => refresh(true, null)), 120);
}

/** What was run was run on another scene: until there is an answer for this one, there is nothing to keep. */
export function sceneChanged() {
  asked++;
  behind = false;
  state.driven = [];
  forgetRun();
  drawMap();
  refreshSoon();
}

export function forgetRun() {
  state.run = null;
  state.time = 0;
  $("world").classList.add("stale");
  enable();
}

// --- what is seen ---------------------------------------------------------------------------------------------------

export function drawMoment() {
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
  const ended = moments.length > 1 || state.run.halted === false;
  $("now").textContent = action ? `next: ${facts.words[action]}` : ended ? ending : "";
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

// --- driving, and programs ------------------------------------------------------------------------------------------

let inHand = Promise.resolve();
/** One change of the scene or its actions after the other, however quickly they are asked for: none falls into the scene before. */
export function inTurn(change) {
  inHand = inHand.catch(() => {}).then(change);
  return inHand;
}

export const drive = (action) => inTurn(async () => {
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

export const undo = () => inTurn(async () => { state.driven.pop(); await refresh(); });
export const restart = () => inTurn(async () => { state.driven = []; await refresh(); });

export const randomScene = () => inTurn(async () => {
  state.scene = await askJson("api/random-scene", {});
  state.picked = Infinity;
  sceneChanged();
});

export function choose(name) {
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
export function check() {
  clearTimeout(checking);
  checking = setTimeout(safely(async () => {
    const text = $("code").value;
    const found = await askJson("api/check", { program: text });
    if (text !== $("code").value) return; // there will be another check
    $("code-error").textContent = found.error?.message ?? "";
    drawLines(state.run?.program === text ? state.run.moments[state.time].lines : [], found.error?.line);
    enable();
  }), 250);
}

export const runProgram = () => inTurn(async () => {
  state.byHand = false;
  state.driven = [];
  await refresh(false);
  $("code-error").textContent = "";
});
