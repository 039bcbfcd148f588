"""What the page has to know of the domain: its map, its words, and which keys drive the robot."""

from __future__ import annotations

from string import ascii_lowercase
from typing import Any

import numpy as np

from evaps.domain import CHOSEN, DOOM
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS, PERCEPTIONS
from evaps.robots.world import World

DOOM_KEYS = {
    "q": ("TURN_LEFT", "turn left"),
    "w": ("MOVE_FORWARD", "ahead"),
    "e": ("TURN_RIGHT", "turn right"),
    "a": ("MOVE_LEFT", "left"),
    "s": ("MOVE_BACKWARD", "back"),
    "d": ("MOVE_RIGHT", "right"),
    "f": ("ATTACK", "shoot"),
}

KEYS = "123456789" + ascii_lowercase
"""Of other domains, in the order of the actions; further ones have buttons only."""


def facts_of(here: World) -> dict[str, Any]:
    """The facts about a world, as JSON values; ``keys`` are in the order of the buttons."""
    anywhere = (here.x, here.y)
    keys = [(key, action) for key, (action, _) in DOOM_KEYS.items()]
    words = dict(DOOM_KEYS.values())
    if CHOSEN is not DOOM:
        keys = [(KEYS[i : i + 1], action) for i, action in enumerate(ACTIONS)]
        words = {action: _read_aloud(action) for action in ACTIONS}
    actions = {action: f"{CHOSEN.spelt(action)}()" for action in ACTIONS}
    conditions = [p.python for p in PERCEPTIONS]
    program = f"def run():\n    if {conditions[0]}:\n        {actions[ACTIONS[0]]}\n"
    if CHOSEN is DOOM:
        program = "def run():\n    while not in_target(Demon):\n        turn_left()\n    attack()\n"
    start = here.start or here.random_scene(np.random.default_rng(0))
    return {
        "arena": {"x": here.x, "y": here.y},
        "places": {who: here.places.get(who, anywhere) for who in ("robot", "things")},
        "radii": here.radii,
        "kinds": here.kinds if here.kinds is not None else [k for k in here.radii if k != "robot"],
        "headings": here.headings,
        "grid": here.grid,
        "border": here.border,
        "blocks": here.blocks,
        "depth": here.depth,
        "tolerance": CHOSEN.tolerance,
        "budget": CHOSEN.budget,
        "scene": start.to_json(),
        "perceptions": PERCEPTION_KEYS,
        "keys": keys,
        "words": {**words, **{key: " ".join(map(_read_aloud, key.split(" "))) for key in PERCEPTION_KEYS}},
        "calls": {"actions": actions, "conditions": conditions},
        "program": program,
    }


def _read_aloud(word: str) -> str:
    """A word of the language in human words; a thing keeps its name."""
    return word if word in CHOSEN.things else CHOSEN.spelt(word).replace("_", " ")
