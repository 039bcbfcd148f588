// The search for a program: asked for, heard of, and its answer.

import { enable, refocus } from "./buttons.js";
import { asTask, drawExamples } from "./examples.js";
import { tellReplaced } from "./run.js";
import { ask, linesOf } from "./server.js";
import { $, state } from "./state.js";

/** It was for other examples. */
export function forgetAnswer() {
  $("log").replaceChildren();
  $("verdict").textContent = "";
  $("result").hidden = true;
  $("progress").textContent = "";
}

export async function synthesize() {
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
