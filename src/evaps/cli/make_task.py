"""``evaps make-task``: a task folder from a program of your own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from evaps.cli.command import Command, print_result
from evaps.cli.inputs import File, Folder, ProgramFile, read_program, read_scenes, writing
from evaps.dsl import Limits, Program, UserError

if TYPE_CHECKING:
    from evaps.robots.base import Robot, Scene
    from evaps.tasks.task import Example


@dataclass(frozen=True)
class MakeTask(Command):
    """Write a task folder: five scenes, and what the robot sees where the program leads it from each.

    The program itself is not in the folder: `evaps synthesize` is to find one that does the same.
    """

    program: ProgramFile
    """File with the program, in the token form or the Python form; - reads standard input."""
    scenes: File
    """JSON file with a list of exactly five scenes, each as `evaps run` takes it."""
    out: Folder
    """The folder to write; it must not exist."""
    json: bool = False
    """Print one JSON object."""

    def run(self) -> None:
        """Run the program from each scene and write the folder."""
        from evaps.robots.world import world
        from evaps.tasks.task import EXAMPLES, Task, save_task

        program, scenes = read_program(self.program), read_scenes(self.scenes, EXAMPLES)
        robot = world().robot()
        try:
            examples = tuple(_example(program, scene, i, robot) for i, scene in enumerate(scenes))
        finally:
            robot.close()
        with writing(self.out):
            save_task(Task(self.out.name, examples), self.out)
        print_result(f"wrote {self.out}", {"task": self.out}, self.json)


def _example(program: Program, scene: Scene, index: int, robot: Robot) -> Example:
    from evaps.dsl import run
    from evaps.tasks.task import Example

    robot.reset(scene)
    limits = Limits()
    trace = run(program, robot, limits)
    if not trace.halted:
        out_of_actions = len(trace.actions) >= limits.actions
        limit = f"{limits.actions} actions" if out_of_actions else f"{limits.calls} interpreter calls"
        raise UserError(f"scenes[{index}]: the program does not halt within {limit}; change it or the scene")
    return Example(scene, trace.observations[-1])
