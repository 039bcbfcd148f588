"""``evaps run``: a program on the robot."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from evaps.cli.command import Command
from evaps.cli.inputs import File, MaybeFile, ProgramFile, check_writable, read_program, read_scene

if TYPE_CHECKING:
    from evaps.dsl import Trace
    from evaps.robots.base import WorldState
    from evaps.robots.frames import Image, Observation


FEW = 20  # things that are listed one by one


@dataclass(frozen=True)
class Run(Command):
    """Run a program on the robot and show what happened.

    A run ends after 20 actions or 100 interpreter calls; one that would need more has not halted. Scenes are
    in whole units of the world and whole degrees counter-clockwise from east.
    """

    program: ProgramFile
    """File with the program, in the token form or the Python form; - reads standard input."""
    scene: File
    """JSON file with the scene: {"robot": {"x", "y", "heading"}, "things": [{"kind", "x", "y"}, ...]}."""
    json: bool = False
    """Print one JSON object instead of a summary; it also has SHA-256 sums of the first and last views."""
    film: MaybeFile = None
    """Write what happened as pictures: a .gif that plays, or a .png in which they stand in rows."""

    def run(self) -> None:
        """Run the program from the scene."""
        from evaps.dsl import run
        from evaps.robots.world import world

        program, scene = read_program(self.program), read_scene(self.scene)
        if self.film is not None:
            from evaps.viewer.film import check_film

            check_film(self.film)
            check_writable(self.film)
        robot = world().robot()
        try:
            if self.film is None:
                robot.reset(scene)
                trace = run(program, robot)
            else:
                from evaps.viewer.film import record, save_film

                trace, moments = record(program, scene, robot)
                save_film(self.film, trace, scene, moments)
            state = robot.state()
        finally:
            robot.close()
        if self.json:
            print(json.dumps(as_json(trace, state)))
        else:
            _print_summary(trace, state)


def as_json(trace: Trace[Observation], state: WorldState) -> dict[str, Any]:
    """The object that ``evaps run --json`` prints.

    Args:
        trace: of the run.
        state: the world after it.
    """
    first, last = trace.observations[0], trace.observations[-1]
    return {
        "halted": trace.halted,
        "actions": list(trace.actions),
        "final": state.to_json(),
        "rgb_sha256": _sha256(last.rgb),
        "depth_sha256": _sha256(last.depth),
        "first_rgb_sha256": _sha256(first.rgb),
        "first_depth_sha256": _sha256(first.depth),
    }


def _sha256(plane: Image) -> str:
    return hashlib.sha256(plane.tobytes("C")).hexdigest()


def _print_summary(trace: Trace[Observation], state: WorldState) -> None:
    from rich.console import Console
    from rich.table import Table

    console, robot = Console(highlight=False), state.robot
    how = "[green]halted[/]" if trace.halted else "[yellow]did not halt[/] within its limits"
    console.print(trace.program.to_python(), markup=False)
    console.print(f"{how}: {len(trace.actions)} actions, {trace.calls} interpreter calls")
    console.print(" ".join(trace.actions) or "no action", style="bold", soft_wrap=True)
    console.print(f"robot at x {robot.x:g}, y {robot.y:g}, heading {robot.heading:g} degrees")
    if state.ammo or state.health:
        console.print(f"ammunition {state.ammo}, health {state.health}")
    if len(state.things) > FEW:
        kinds = Counter(thing.kind for thing in state.things)
        console.print("things:", ", ".join(f"{number} {kind}" for kind, number in kinds.items()))
        return
    table = Table("thing", "alive", "x", "y")
    for thing in state.things:
        table.add_row(thing.kind, "yes" if thing.alive else "no", f"{thing.x:g}", f"{thing.y:g}")
    if state.things:
        console.print(table)
