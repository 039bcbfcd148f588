"""A robot of your own, first half: its words. docs/own-robot.md says how evaps comes to know it."""

from evaps.domain import Domain

DOMAIN = Domain(
    name="vacuum",
    actions=("north", "south", "east", "west", "suck"),
    perceptions=("dirtHere", "wallNorth", "wallEast"),
    world="own_world:WORLD",
)
