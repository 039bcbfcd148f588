// What is said to the user, and which buttons can be pressed.

import { $, facts, program, state } from "./state.js";

export function say(text) {
  $("message").hidden = !text;
  $("message").textContent = text ?? "";
}

/** A listener that says what went wrong, and lets a button be pressed once at a time; without an event, what was said stays. */
export function safely(action) {
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

export function button(text, action) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.addEventListener("click", safely(action));
  return made;
}

/** Which buttons can be pressed now. */
export function enable() {
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
export function refocus(...ids) {
  const at = document.activeElement;
  if (at && at !== document.body && !at.disabled && at.offsetParent !== null) return;
  ids.map($).find((element) => !element.disabled && element.offsetParent !== null)?.focus();
}
