// What the page knows: the facts about the world, which stay, and what the user has made of it.

export const $ = (id) => document.getElementById(id);

/** What /api/facts says. */
export const facts = {};

export const state = {
  scene: null,
  picked: Infinity, // which thing of the map Tab leads to; the robot is the last of them
  driven: [],      // actions, if the robot is driven by hand
  byHand: true,
  run: null,       // what /api/run said of the current scene
  time: 0,
  examples: [],    // at most five: { scene, goal_rgb, goal_depth, first }
  changing: false, // whether other examples are on their way
  job: null,       // the search that is under way
  budget: 0,       // how many actions it may simulate
};

const asPython = (actions) => "def run():\n" + actions.map((a) => `    ${facts.calls.actions[a]}\n`).join("");
export const program = () => (state.byHand ? (state.driven.length ? asPython(state.driven) : null) : $("code").value);
