"""The Doom robot: programs acting in a 3D arena of stock ViZDoom, seen through RGB and depth."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

from evaps.robots.base import EngineError, Pose, Robot, Scene, Thing, ThingState, WorldState
from evaps.robots.engine import BUTTONS, HEIGHT, MEMORY_LIMIT, TIME_LIMIT, WIDTH, Engine, doom_palette
from evaps.robots.frames import Observation, PaletteFrame
from evaps.robots.scenes import ANY_Y, ROBOT_X, THING_X, random_scene, validate
from evaps.robots.wad import ARENA_X, ARENA_Y, CLIP, PREFIX, RADII, ROBOT_RADIUS
from evaps.robots.world import World

CENTRE_X, CENTRE_Y = WIDTH // 2, HEIGHT // 2

# Each action presses one button for some tics and then waits until the world is at rest: with fewer
# tics of rest the robot still slides, and equal worlds stop looking equal.
TICS = {
    "MOVE_FORWARD": (5, 45),
    "MOVE_BACKWARD": (5, 45),
    "MOVE_LEFT": (5, 45),
    "MOVE_RIGHT": (5, 45),
    "TURN_LEFT": (5, 5),
    "TURN_RIGHT": (5, 5),
    "ATTACK": (1, 80),
}
TICS_BEFORE_TURN = 14  # in the first tics of an episode the engine takes no turn
REST_AFTER_RESET = 40  # straight after a warp the view height is still wrong
LAST_TICS = 2  # of a rest: they wait until it is known whether anybody looks
STEP = 42  # map units; no move is longer
CLIP_REACH = RADII[CLIP] + ROBOT_RADIUS + 1  # on both axes
PRESSED = {action: [float(action == other) for other in BUTTONS] + [0.0] for action in TICS}
RELEASED = [0.0] * (len(BUTTONS) + 1)
TRIES = 3  # engines, before a call gives up
CHECK_MEMORY_EVERY = 200  # scenes

Result = TypeVar("Result")


class DoomRobot(Robot):
    """A robot with a pistol in a room of monsters and clips, on stock ViZDoom.

    ## Description
    One rectangular room, 640 by 448 map units. Demons, HellKnights and Revenants stand still and die of one
    bullet; walking over a Clip picks it up. The world is deterministic: from one scene, one sequence of
    actions always gives the same bytes.

    ## Actions
    ``MOVE_FORWARD MOVE_BACKWARD MOVE_LEFT MOVE_RIGHT`` (5 tics of 1/35 s, then 45 of rest), ``TURN_LEFT
    TURN_RIGHT`` (8.79 degrees), ``ATTACK`` (one bullet straight ahead).

    ## Perceptions
    ``ISTHERE m``: a living m has a visible pixel. ``INTARGET m``: the box around a visible living m strictly
    contains the centre of the view. m is ``Demon``, ``HellKnight`` or ``Revenant``.

    ## Observations
    RGB, uint8 ``[120, 160, 3]``, and depth, uint8 ``[120, 160]`` (about 14 levels per 100 map units).

    ## Units
    Places in map units, headings in degrees counter-clockwise from east.

    ## The engine
    A process of its own; it starts with the first reset and ends with `close`. One that dies, hangs or
    grows without end is replaced, and the new one is brought to where the old one stood: nobody outside
    notices, except by the time it takes.

    Args:
        time_limit: seconds after which an engine that does not answer is replaced.
    """

    def __init__(self, time_limit: float = TIME_LIMIT) -> None:
        self._time_limit = time_limit
        self._engine: Engine | None = None
        self._scene: Scene | None = None
        self._path: list[str] = []  # the actions since the scene was set up
        self._done: int | None = None  # how many of them the engine has executed; None: no scene is set up
        self._waiting = 0  # tics of rest that it has not executed yet
        self._fired = False  # since somebody last looked
        self._to_clip = math.inf  # on the axis on which it is further; it may be more
        self._resets = 0
        self._replaced = 0
        self._seen: Any = None
        self._view: PaletteFrame | None = None

    def reset(self, scene: Scene) -> None:
        """Put the world back to the start of ``scene``.

        Raises:
            SceneError: the scene is not valid.
            EngineError: no engine can be started, or each has died.
        """
        validate(scene)
        self._scene, self._path, self._done = scene, [], None
        self._look_away()
        self._resets += 1
        if self._resets % CHECK_MEMORY_EVERY == 0 and self._engine and self._engine.memory > MEMORY_LIMIT:
            self._end_engine()
        self._on_engine(self._catch_up)

    def act(self, action: str) -> None:
        """Press the button of ``action``, release it, and let the world come to rest.

        Raises:
            KeyError: there is no such action; nothing has happened.
            EngineError: there was no reset, or one engine after the other has died.
        """
        if action not in TICS:
            raise KeyError(action)
        self._check_scene()
        self._path.append(action)
        self._look_away()
        self._on_engine(self._catch_up)

    def perceive(self, perception: str) -> bool:
        """``ISTHERE m`` or ``INTARGET m`` in the current view.

        Raises:
            ValueError: the robot has no such perception.
        """
        name, _, kind = perception.partition(" ")
        if name not in ("ISTHERE", "INTARGET") or kind not in RADII:
            raise ValueError(f"the Doom robot has no perception {perception!r}")
        boxes = [box for box in self._look().labels if box.object_name == PREFIX + kind]
        return bool(boxes) if name == "ISTHERE" else any(map(_on_centre, boxes))

    def observe(self) -> Observation:
        """The current view."""
        if self._view is None:
            seen = self._look()
            self._view = PaletteFrame(seen.screen_buffer, seen.depth_buffer, doom_palette())
        return self._view

    def state(self) -> WorldState:
        """The hidden state, for evaluation alone."""
        x, y, heading, health, ammo, *_ = self._look().game_variables
        things = [
            ThingState(name.removeprefix(PREFIX), not dead, round(o.position_x, 2), round(o.position_y, 2))
            for o in self._look().objects
            for dead, name in [(o.name.startswith("Dead"), o.name.removeprefix("Dead"))]
            if name.removeprefix(PREFIX) in RADII
        ]
        things.sort(key=lambda t: (t.kind, t.x, t.y))
        pose = Pose(round(float(x), 2), round(float(y), 2), round(float(heading), 2))
        return WorldState(pose, int(ammo), int(health), tuple(things))

    def fingerprint(self) -> Hashable:
        """All numbers of robot and things as the engine has them, and nothing rounded.

        The engine's random numbers are not among them: here they decide about nothing that can be seen at
        rest. ``tests/robots/test_doom.py`` goes on from pairs of equal worlds and compares.
        """
        seen = self._look()
        things = sorted((o.name, o.position_x, o.position_y, o.position_z, o.angle) for o in seen.objects)
        return tuple(seen.game_variables), tuple(things)

    @property
    def replaced(self) -> int:
        """How many engines have died or hung so far."""
        return self._replaced

    def close(self) -> None:
        """End the engine's process."""
        self._end_engine()
        self._scene = None
        self._look_away()

    def _end_engine(self) -> None:
        if self._engine is not None:
            self._engine.close()
        self._engine = self._done = None

    def _check_scene(self) -> None:
        if self._scene is None:
            raise EngineError("the robot has no scene yet: call reset(scene) first")

    def _look_away(self) -> None:
        self._seen = self._view = None

    def _on_engine(self, work: Callable[[Any], Result]) -> Result:
        """Work on an engine; where it dies, a new one takes its place."""
        for tries_left in reversed(range(TRIES)):
            try:
                self._engine = self._engine or Engine(self._time_limit)
                return self._engine.call(work)
            except EngineError:
                self._end_engine()
                self._replaced += 1
                if not tries_left:
                    raise
            except BaseException:  # Ctrl-C in the middle of an action: nobody knows where the engine stands
                self._done = None
                raise
        raise AssertionError("unreachable")

    def _catch_up(self, game: Any) -> None:
        """Bring the engine to where the robot stands, from wherever it is."""
        assert self._scene is not None
        if self._done is None:
            self._set_up(game, self._scene)
            self._done = 0
        for action in self._path[self._done :]:
            self._press(game, action)
            self._done += 1

    def _set_up(self, game: Any, scene: Scene) -> None:
        game.set_seed(0)
        game.set_action(RELEASED)
        game.new_episode()
        # `summon` puts a thing in front of the robot at 2 radii + 16, and `warp` kills what it lands on: so
        # from the largest x to the smallest, each time standing to the west of everything placed before.
        for thing in sorted(scene.things, key=lambda t: -t.x):
            game.send_game_command(f"warp {thing.x - 2 * RADII[thing.kind] - 16} {thing.y}")
            game.send_game_command(f"summon {PREFIX + thing.kind if thing.kind != 'Clip' else thing.kind}")
            game.advance_action(1, False)
        game.send_game_command(f"warp {scene.robot.x} {scene.robot.y}")
        game.advance_action(max(1, TICS_BEFORE_TURN - len(scene.things)), False)
        game.set_action([*RELEASED[:-1], -float(scene.robot.heading)])
        game.advance_action(1, False)
        self._rest(game, REST_AFTER_RESET)
        self._fired = False  # a new episode has a frame of its own, with the right number
        clips = [(thing.x, thing.y) for thing in scene.things if thing.kind == CLIP]
        self._to_clip = _furthest_axis(scene.robot.x, scene.robot.y, clips)

    def _press(self, game: Any, action: str) -> None:
        pressed, rest = TICS[action]
        if self._waiting:
            game.advance_action(self._waiting, False)
        game.set_action(PRESSED[action])
        game.advance_action(pressed, False)
        self._rest(game, rest)
        self._fired = self._fired or action == "ATTACK"
        if action.startswith("MOVE"):
            self._to_clip -= STEP

    def _rest(self, game: Any, tics: int) -> None:
        """Let the world come to rest, but for the last tics: only if somebody looks are they rendered."""
        game.set_action(RELEASED)
        game.advance_action(tics - LAST_TICS, False)
        self._waiting = LAST_TICS

    def _look(self) -> Any:
        """The engine's state with the current view, rendered when it is first asked for."""
        if self._seen is None:
            self._check_scene()
            self._seen = self._on_engine(self._render)
        return self._seen

    def _render(self, game: Any) -> Any:
        """Render the last tic; where the number of bullets may have changed, the last two.

        A view shows the number of the view before it. After a shot it has changed, and where a clip is so
        near that it may have been picked up, it may have.
        """
        self._catch_up(game)
        if self._fired or self._to_clip < CLIP_REACH:
            game.advance_action(self._waiting - 1, True)
            game.advance_action(1, True)
        else:
            game.advance_action(self._waiting, True)
        self._waiting, self._fired = 0, False
        seen = game.get_state()
        if seen is None:
            raise EngineError("the ViZDoom engine has died (it shows nothing any more)")
        clips = [(o.position_x, o.position_y) for o in seen.objects if o.name == CLIP]
        x, y = seen.game_variables[:2]
        self._to_clip = _furthest_axis(x, y, clips)
        return seen


def _furthest_axis(x: float, y: float, places: Sequence[tuple[float, float]]) -> float:
    """How far it is to the nearest of the places, on the axis on which that is further."""
    return min((max(abs(x - px), abs(y - py)) for px, py in places), default=math.inf)


def _on_centre(box: Any) -> bool:
    return bool(box.x < CENTRE_X < box.x + box.width and box.y < CENTRE_Y < box.y + box.height)


WORLD = World(
    "doom-v0",
    DoomRobot,
    random_scene,
    (HEIGHT, WIDTH),
    doom_palette,
    validate,
    engine="vizdoom",
    x=ARENA_X,
    y=ARENA_Y,
    radii={**RADII, "robot": ROBOT_RADIUS},
    places={"robot": (ROBOT_X, ANY_Y), "things": (THING_X, ANY_Y)},
    start=Scene(Pose(-300, 288, 0), (Thing("Demon", -100, 300),)),
)
"""The arena, for everything that works in any domain."""
