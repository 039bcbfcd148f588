"""A robot of your own, second half: a vacuum cleaner in a room of eight by eight cells, and its world."""

import numpy as np

from evaps.robots.base import Pose, Robot, Scene, SceneError, Thing, ThingState, WorldState
from evaps.robots.frames import PaletteFrame
from evaps.robots.world import World

SIDE = 8
MOVES = {"north": (0, 1), "south": (0, -1), "east": (1, 0), "west": (-1, 0), "suck": (0, 0)}
FLOOR, DIRT, ROBOT = 1, 2, 2  # a cell has the sum of what is in it: 1 to 4
PALETTE = np.zeros((256, 3), np.uint8)
PALETTE[1:5] = (235, 235, 225), (120, 90, 60), (40, 90, 200), (90, 60, 160)


class Vacuum(Robot):
    """It sees the room from above, four pixels a cell."""

    def reset(self, scene: Scene) -> None:
        self.x, self.y = int(scene.robot.x), int(scene.robot.y)
        self.dirt = {(int(thing.x), int(thing.y)) for thing in scene.things}

    def act(self, action: str) -> None:
        dx, dy = MOVES[action]
        self.x, self.y = (min(SIDE - 1, max(0, v)) for v in (self.x + dx, self.y + dy))
        if action == "suck":
            self.dirt.discard((self.x, self.y))

    def perceive(self, perception: str) -> bool:
        dirty, north, east = (self.x, self.y) in self.dirt, self.y == SIDE - 1, self.x == SIDE - 1
        return {"dirtHere": dirty, "wallNorth": north, "wallEast": east}[perception]

    def observe(self) -> PaletteFrame:
        cells = np.full((SIDE, SIDE), FLOOR, np.uint8)
        for x, y in self.dirt:
            cells[y, x] = DIRT
        cells[self.y, self.x] += ROBOT
        north_up = cells[::-1].repeat(4, 0).repeat(4, 1)
        return PaletteFrame(north_up, np.full((32, 32), 255, np.uint8), PALETTE)

    def state(self) -> WorldState:
        things = tuple(ThingState("Dirt", True, x, y) for x, y in sorted(self.dirt))
        return WorldState(Pose(self.x, self.y, 0), ammo=0, health=0, things=things)

    def fingerprint(self) -> object:
        return self.x, self.y, frozenset(self.dirt)


def validate(scene: Scene) -> None:
    for place in (scene.robot, *scene.things):
        if place.x not in range(SIDE) or place.y not in range(SIDE):
            raise SceneError(f"({place.x}, {place.y}) is not in the room of {SIDE} by {SIDE} cells")


def random_scene(rng: np.random.Generator) -> Scene:
    places = [(int(x), int(y)) for x, y in rng.integers(0, SIDE, (int(rng.integers(4, 24)), 2))]
    return Scene(Pose(*places[0], 0), tuple(Thing("Dirt", x, y) for x, y in sorted(set(places[2:]))))


ROOM, RADII = (-0.5, SIDE - 0.5), {"robot": 0.4, "Dirt": 0.3}
MAP = dict(x=ROOM, y=ROOM, radii=RADII, grid=1, depth=False)
WORLD = World("vacuum-v0", Vacuum, random_scene, (32, 32), lambda: PALETTE, validate, **MAP)
