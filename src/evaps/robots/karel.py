"""Karel: a robot in a grid of walls and markers, seen as a whole or through a window ahead.

After Pattis, "Karel the Robot", 1981, with the actions and perceptions of Bunel et al., ICLR 2018.
"""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from evaps.robots.base import Pose, Robot, Scene, SceneError, Thing, ThingState, WorldState
from evaps.robots.frames import Image, PaletteFrame
from evaps.robots.world import World

SMALLEST, LARGEST = 8, 18  # cells on a side
MOST_MARKERS = 9  # in a cell
SIDE = 4 * LARGEST  # pixels
WINDOW = 5  # cells ahead, and as many across
WALLS, MARKED = 0.1, 0.12  # shares of the cells of a random scene
STEPS = {0: (1, 0), 90: (0, 1), 180: (-1, 0), 270: (0, -1)}
"""Where a move leads, by the heading."""
TURNS = {"turnLeft": 90, "turnRight": -90}
LOOKS = {"frontIsClear": 0, "leftIsClear": 90, "rightIsClear": -90}

NOTHING, FLOOR, WALL, ROBOT = 1, 2, 3, 4  # colours; n markers have that of the robot + n

Cell = tuple[int, int]


def palette() -> Image:
    """The colours of Karel's frames; no pixel that is seen is black, which stands for an invalid one."""
    colours = np.zeros((256, 3), np.uint8)
    colours[NOTHING], colours[FLOOR] = (40, 40, 48), (236, 234, 226)
    colours[WALL], colours[ROBOT] = (130, 74, 46), (30, 90, 200)
    for n in range(1, MOST_MARKERS + 1):
        colours[ROBOT + n] = (250 - 8 * n, 200 - 18 * n, 20 + 10 * n)
    return colours


PALETTE = palette()


class KarelRobot(Robot):
    """A robot that walks a grid and carries markers.

    ## Description
    A grid of 8 to 18 cells on a side. A thing of the kind ``Corner`` says where it ends: in the cells
    (1, 1) to (x - 1, y - 1). Other things are ``Wall`` and ``Marker``; several markers may lie in a cell.

    ## Actions
    ``move``, ``turnLeft``, ``turnRight``, ``pickMarker``, ``putMarker``. What cannot be done does nothing: a
    step into a wall, a marker picked where there is none, a tenth one put.

    ## Perceptions
    ``frontIsClear``, ``leftIsClear``, ``rightIsClear``, ``markersPresent``, ``noMarkersPresent``.

    ## Observations
    RGB, uint8 ``[72, 72, 3]``: the whole grid, with north up, four pixels a cell; or the 5 x 5 cells ahead,
    seen from behind the robot, 14 pixels a cell. Depth says nothing: it is 255 everywhere.

    ## Units
    Places in cells, headings in degrees: 0 (east), 90, 180 or 270. ``ammo`` and ``health`` are 0.

    Args:
        window: whether it sees only what lies ahead.
    """

    def __init__(self, window: bool = False) -> None:
        self._window = window
        self._end: Cell = (0, 0)
        self._walls: frozenset[Cell] = frozenset()
        self._markers: dict[Cell, int] = {}
        self._at: Cell = (0, 0)
        self._heading = 0

    def reset(self, scene: Scene) -> None:
        """Set up the grid.

        Raises:
            SceneError: the scene is not valid.
        """
        validate(scene)
        places = [(t.kind, (int(t.x), int(t.y))) for t in scene.things]
        self._end = next(place for kind, place in places if kind == "Corner")
        self._walls = frozenset(place for kind, place in places if kind == "Wall")
        self._markers = {}
        for kind, place in places:
            if kind == "Marker":
                self._markers[place] = self._markers.get(place, 0) + 1
        self._at, self._heading = (int(scene.robot.x), int(scene.robot.y)), int(scene.robot.heading)

    def act(self, action: str) -> None:
        """Do what can be done.

        Raises:
            KeyError: there is no such action.
        """
        here = self._markers.get(self._at, 0)
        if action == "move":
            ahead = self._ahead()
            self._at = ahead if self._is_clear(ahead) else self._at
        elif action == "pickMarker":
            self._set_markers(max(0, here - 1))
        elif action == "putMarker":
            self._set_markers(min(MOST_MARKERS, here + 1))
        else:
            self._heading = (self._heading + TURNS[action]) % 360

    def _set_markers(self, markers: int) -> None:
        self._markers.pop(self._at, None)
        if markers:
            self._markers[self._at] = markers

    def _ahead(self, turned: int = 0) -> Cell:
        dx, dy = STEPS[(self._heading + turned) % 360]
        return self._at[0] + dx, self._at[1] + dy

    def _is_clear(self, cell: Cell) -> bool:
        return self._is_inside(cell) and cell not in self._walls

    def _is_inside(self, cell: Cell) -> bool:
        return 0 < cell[0] < self._end[0] and 0 < cell[1] < self._end[1]

    def perceive(self, perception: str) -> bool:
        """The value of a perception.

        Raises:
            ValueError: the robot has no such perception.
        """
        if perception in LOOKS:
            return self._is_clear(self._ahead(LOOKS[perception]))
        if perception not in ("markersPresent", "noMarkersPresent"):
            raise ValueError(f"Karel has no perception {perception!r}")
        return (self._at in self._markers) == (perception == "markersPresent")

    def observe(self) -> PaletteFrame:
        """The grid, or what lies ahead."""
        if self._window:
            return _drawn(self._colours_ahead(), WINDOW // 2, 0, 90)
        colours = np.full((LARGEST, LARGEST), NOTHING, np.uint8)
        for x in range(1, self._end[0]):
            for y in range(1, self._end[1]):
                colours[y - 1, x - 1] = self._colour((x, y))
        return _drawn(colours, self._at[0] - 1, self._at[1] - 1, self._heading)

    def _colours_ahead(self) -> Image:
        """Of the cells in the window: the robot's row first, each from left to right."""
        colours = np.empty((WINDOW, WINDOW), np.uint8)
        ahead, right = STEPS[self._heading], STEPS[(self._heading - 90) % 360]
        for far, column in np.ndindex(WINDOW, WINDOW):
            across = column - WINDOW // 2
            x = self._at[0] + far * ahead[0] + across * right[0]
            y = self._at[1] + far * ahead[1] + across * right[1]
            colours[far, column] = self._colour((x, y))
        return colours

    def _colour(self, cell: Cell) -> int:
        if not self._is_inside(cell):
            return NOTHING
        if cell in self._walls:
            return WALL
        markers = self._markers.get(cell, 0)
        return ROBOT + markers if markers else FLOOR

    def state(self) -> WorldState:
        """Where the robot and the markers are; walls stay where they are."""
        markers = tuple(
            ThingState("Marker", True, float(x), float(y))
            for (x, y), number in sorted(self._markers.items())
            for _ in range(number)
        )
        return WorldState(Pose(float(self._at[0]), float(self._at[1]), float(self._heading)), 0, 0, markers)

    def fingerprint(self) -> Hashable:
        """Everything that changes."""
        return self._at, self._heading, frozenset(self._markers.items())


DEPTH = np.full((SIDE, SIDE), 255, np.uint8)
DEPTH.flags.writeable = False


def _drawn(colours: Image, x: int, y: int, heading: int) -> PaletteFrame:
    """Cells, as large as there is room for, north up; the robot is the half of its cell that it looks to."""
    cell = SIDE // len(colours)
    pixels = np.full((SIDE, SIDE), NOTHING, np.uint8)
    seen = colours.repeat(cell, 0).repeat(cell, 1)
    pixels[: len(seen), : len(seen)] = seen
    dx, dy = STEPS[heading]
    half = cell // 2
    left, low = x * cell + half * (dx > 0), y * cell + half * (dy > 0)
    wide, high = (half if dx else cell), (half if dy else cell)
    pixels[low : low + high, left : left + wide] = ROBOT
    return PaletteFrame(np.ascontiguousarray(pixels[::-1]), DEPTH, PALETTE)


def validate(scene: Scene) -> None:
    """Check that there is such a grid.

    Raises:
        SceneError: which value is wrong, and what it may be.
    """
    corners = [t for t in scene.things if t.kind == "Corner"]
    if len(corners) != 1 or not all(
        v in range(SMALLEST + 1, LARGEST + 2) for v in (corners[0].x, corners[0].y)
    ):
        raise SceneError(
            f"the things need one Corner, with x and y from {SMALLEST + 1} to {LARGEST + 1}: "
            "the grid is from (1, 1) to the cell before it"
        )
    taken: dict[Cell, list[str]] = {}
    for thing in scene.things:
        if thing.kind not in ("Corner", "Wall", "Marker"):
            raise SceneError(f"unknown kind {thing.kind!r}; known are Corner, Wall, Marker")
        if thing.kind != "Corner":
            _check_inside(thing, corners[0], f"a {thing.kind}")
            taken.setdefault((int(thing.x), int(thing.y)), []).append(thing.kind)
    _check_inside(scene.robot, corners[0], "the robot")
    if scene.robot.heading not in STEPS:
        raise SceneError(f"the robot's heading must be 0, 90, 180 or 270, not {scene.robot.heading}")
    for (x, y), kinds in taken.items():
        if "Wall" in kinds and (len(kinds) > 1 or (x, y) == (scene.robot.x, scene.robot.y)):
            raise SceneError(f"there is a Wall at ({x}, {y}): nothing else can be there")
        if len(kinds) > MOST_MARKERS:
            raise SceneError(f"{len(kinds)} markers at ({x}, {y}); a cell holds {MOST_MARKERS}")


def _check_inside(place: Thing | Pose, corner: Thing, name: str) -> None:
    if not (0 < place.x < corner.x and 0 < place.y < corner.y and place.x % 1 == place.y % 1 == 0):
        raise SceneError(
            f"{name} is at ({place.x}, {place.y}); it must be in a whole cell "
            f"from (1, 1) to ({corner.x - 1}, {corner.y - 1})"
        )


def random_scene(rng: np.random.Generator) -> Scene:
    """A grid of random size with random walls and markers, and a robot anywhere between them."""
    width, height = (int(side) for side in rng.integers(SMALLEST, LARGEST + 1, 2))
    kinds = rng.random((width, height))
    things = [Thing("Corner", width + 1, height + 1)]
    clear = []
    for x, y in np.ndindex(width, height):
        if kinds[x, y] < WALLS:
            things.append(Thing("Wall", x + 1, y + 1))
            continue
        clear.append((x + 1, y + 1))
        if kinds[x, y] < WALLS + MARKED:
            things += [Thing("Marker", x + 1, y + 1)] * int(min(MOST_MARKERS, rng.geometric(0.7)))
    x, y = clear[int(rng.integers(len(clear)))]
    return Scene(Pose(x, y, int(90 * rng.integers(4))), tuple(things))


def _world(version: str, window: bool) -> World:
    return World(
        version,
        lambda: KarelRobot(window),
        random_scene,
        (SIDE, SIDE),
        lambda: PALETTE,
        validate,
        x=(0.5, LARGEST + 0.5),
        y=(0.5, LARGEST + 0.5),
        radii={"Wall": 0.5, "Marker": 0.25, "Corner": 0.1, "robot": 0.4},
        places=dict.fromkeys(("robot", "things"), ((1, LARGEST + 1), (1, LARGEST + 1))),
        kinds=("Wall", "Marker"),
        headings=90,
        grid=1,
        border="Corner",
        blocks=("Wall",),
        depth=False,
    )


WORLD = _world("karel-v0", window=False)
WINDOW_WORLD = _world("karel-window-v1", window=True)
