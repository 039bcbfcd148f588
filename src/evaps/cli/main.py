"""The list of commands, and where the command line enters."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, suppress
from dataclasses import dataclass
from importlib.metadata import version
from io import StringIO
from itertools import takewhile
from typing import Annotated, TypeAlias

import tyro
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, OmitSubcommandPrefixes, subcommand

from evaps.cli.bench import Bench
from evaps.cli.command import DONE, FAILED, WRONG_INPUT, close_output, exit_status
from evaps.cli.data import Data
from evaps.cli.doctor import Doctor
from evaps.cli.evaluate import Evaluate
from evaps.cli.export import Export
from evaps.cli.generate import Generate, Render
from evaps.cli.make_task import MakeTask
from evaps.cli.report import Report
from evaps.cli.run import Run
from evaps.cli.studio import Studio
from evaps.cli.synthesize import Demo, Synthesize
from evaps.cli.train import Train

# A line adds a command: a `Command` from a module of its own, which loads what is heavy in `run`.
AnyCommand: TypeAlias = (
    Annotated[Run, subcommand("run")]
    | Annotated[MakeTask, subcommand("make-task")]
    | Annotated[Generate, subcommand("generate")]
    | Annotated[Render, subcommand("render")]
    | Annotated[Data, subcommand("data")]
    | Annotated[Train, subcommand("train")]
    | Annotated[Synthesize, subcommand("synthesize")]
    | Annotated[Evaluate, subcommand("evaluate")]
    | Annotated[Report, subcommand("report")]
    | Annotated[Export, subcommand("export")]
    | Annotated[Bench, subcommand("bench")]
    | Annotated[Studio, subcommand("studio")]
    | Annotated[Doctor, subcommand("doctor")]
    | Annotated[Demo, subcommand("demo")]
)


@dataclass(frozen=True)
class Evaps:
    """Readable robot programs from five examples, checked and repaired on the real ViZDoom engine.

    Exit status: 0 done, 2 the input is wrong, 130 stopped with Ctrl-C, 1 anything else.
    `evaps --version` says which one this is.
    """

    command: AnyCommand
    debug: bool = False
    """Show where an error arose; like the next two it stands before the command."""
    quiet: bool = False
    """Show no progress, only results and what goes wrong."""
    verbose: bool = False
    """Show progress more often, and what synthesize finds as it goes on."""


def main(args: Sequence[str] | None = None) -> int:
    """Run ``evaps`` with these arguments, else with those of the process; the exit status.

    Raises:
        SystemExit: 0 after help, 2 if the arguments are wrong.
    """
    if [*(sys.argv[1:] if args is None else args)] == ["--version"]:
        print(f"evaps {version('evaps')}")
        return DONE
    config = (OmitSubcommandPrefixes, OmitArgPrefixes, FlagCreatePairsOff)
    complaint = StringIO()
    try:
        with redirect_stderr(complaint):
            evaps = tyro.cli(Evaps, prog="evaps", args=args, config=config)
    except BrokenPipeError:  # whoever reads the help has seen enough
        close_output()
        return FAILED
    except OSError as error:  # a completion that is to be written where nothing can be
        print(f"evaps: {error.filename}: {error.strerror}; is there such a folder?", file=sys.stderr)
        return WRONG_INPUT
    except SystemExit:
        with suppress(BrokenPipeError):
            sys.stdout.flush()
        if complaint.getvalue():
            print(f"evaps: {_first_part(complaint.getvalue())}", file=sys.stderr)
        raise
    if evaps.quiet or evaps.verbose:
        _speak(evaps.quiet, evaps.verbose)
    return exit_status(evaps.command, evaps.debug)


def _speak(quiet: bool, verbose: bool) -> None:
    from evaps.tasks.progress import LOUDNESS

    LOUDNESS.quiet, LOUDNESS.verbose = quiet, verbose


def _first_part(box: str) -> str:
    """What is wrong, from the first part of the box in which tyro says it, in one line."""
    lines = [line.strip("│ ") for line in box.splitlines() if not line.startswith(("╭", "╰"))]
    said = takewhile(lambda line: not line.startswith("─"), lines)
    what = " ".join(" ".join(said).split()).rstrip(".").replace("'command.", "'")
    return f"{what}; evaps --help and evaps COMMAND --help list what there is"
