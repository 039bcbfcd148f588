// The studio's page: what its buttons and keys do, and how it begins.

import { forgetAnswer, synthesize } from "./answer.js";
import { button, safely } from "./buttons.js";
import { drawExamples, keep, load, makeFive, remembered, replaceExamples, save } from "./examples.js";
import { add, drawMap, look, pickedPlace, shape, takeAway, turn, whenMoved, whileMoving } from "./map.js";
import { check, choose, drawMoment, drive, follow, randomScene, refresh, restart, runProgram, sceneChanged, undo } from "./run.js";
import { askJson } from "./server.js";
import { $, facts, state } from "./state.js";

let keys = {}; // of the keyboard, and the actions that they are for

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
  on("keep", keep);
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
    shape("rect", { ...look(kind), width: 10, height: 10, rx: facts.blocks.includes(kind) ? 0 : 5 }, colour);
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
  whileMoving(safely(follow));
  listen();
  drawExamples();
  drawMap();
  await refresh();
}

safely(begin)();
