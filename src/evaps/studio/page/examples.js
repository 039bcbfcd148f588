// The five examples: made, shown, kept over a reload, loaded and saved as a task.

import { forgetAnswer } from "./answer.js";
import { button, enable, refocus } from "./buttons.js";
import { drawMap } from "./map.js";
import { choose, forgetRun, inTurn, refresh } from "./run.js";
import { ask, askJson } from "./server.js";
import { $, facts, state } from "./state.js";

/** While other examples are on their way, nothing can be done with those that are there. */
export async function replaceExamples(work) {
  const at = document.activeElement;
  state.changing = true;
  enable();
  try {
    await work();
  } finally {
    state.changing = false;
    enable();
    if (document.activeElement === document.body) at?.focus(); // a button that is disabled loses the focus
  }
}

export async function makeFive() {
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

function exampleOf(scene, run) {
  const last = run.moments.at(-1);
  return { scene: structuredClone(scene), goal_rgb: last.rgb, goal_depth: last.depth, first: run.moments[0].rgb };
}

export function keep() {
  state.examples.push(exampleOf(state.scene, state.run));
  forgetAnswer();
  drawExamples();
  refocus("synthesize");
}

export function drawExamples(passed = []) {
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

export function remembered() {
  try {
    return JSON.parse(sessionStorage.getItem(shelf())) ?? [];
  } catch {
    return [];
  }
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

const go = (index) => inTurn(async () => {
  state.scene = structuredClone(state.examples[index].scene);
  state.picked = Infinity;
  state.driven = [];
  forgetRun();
  drawMap();
  await refresh(state.byHand);
});

export async function load(task) {
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

export const asTask = () => ({
  name: $("task-name").value,
  examples: state.examples.map(({ scene, goal_rgb, goal_depth }) => ({ scene, goal_rgb, goal_depth })),
});

export async function save() {
  const content = await (await ask("api/task.zip", asTask())).blob();
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = `${$("task-name").value}.zip`;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000); // some browsers begin to read it late
}
