"""``evaps export``: a program for robots that know nothing of evaps."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Literal

from evaps.cli.command import Command
from evaps.cli.inputs import MaybeFile, ProgramFile, check_writable, read_program
from evaps.files import write_atomically


@dataclass(frozen=True)
class Export(Command):
    """Write a program as a plain Python function, or as a behaviour tree (BehaviorTree.CPP 4, XML)."""

    program: ProgramFile
    """File with the program, in the token form or the Python form; - reads standard input."""
    to: Literal["python", "behavior-tree"] = "python"
    """The form."""
    out: MaybeFile = None
    """The file; standard output without it."""

    def run(self) -> None:
        """Translate the program."""
        from evaps.dsl.export import to_behavior_tree, to_function

        program = read_program(self.program)
        text = to_function(program) if self.to == "python" else to_behavior_tree(program)
        if self.out is None:
            sys.stdout.write(text)
            return
        check_writable(self.out)
        write_atomically(self.out, text.encode())
