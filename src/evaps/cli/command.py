"""What a command is, and what its end means: exit statuses and the one line about what went wrong."""

from __future__ import annotations

import json
import os
import sys
import traceback
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from evaps.dsl import UserError
from evaps.robots.base import EngineError

DONE, FAILED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130


class Failure(Exception):  # noqa: N818 - a job's honest end
    """A job came to a bad end that is no mistake in the code; the message says why, in one line."""


class Command(ABC):
    """A command: a frozen dataclass whose fields are its options and whose docstrings are its help.

    It loads what is heavy (torch, the engine) in `run`, so that the help is quick.
    """

    stopped: ClassVar[str] = "stopped"
    """What Ctrl-C says."""

    @abstractmethod
    def run(self) -> None:
        """Do the job.

        Raises:
            UserError: the input is wrong.
        """


def print_result(text: str, facts: Mapping[str, Any], as_json: bool) -> None:
    """Say what was done: in a line for people, or as one JSON object (paths as text) for scripts."""
    print(json.dumps(facts, default=str) if as_json else text)


def exit_status(command: Command, debug: bool = False) -> int:
    """Run a command; where it does not end well, say why in one line on standard error.

    Args:
        command: what to run.
        debug: show the traceback too.

    Returns:
        0 done, 2 the user's input is wrong, 130 stopped with Ctrl-C, 1 anything else.
    """
    try:
        command.run()
        sys.stdout.flush()
        return DONE
    except KeyboardInterrupt:
        return end(INTERRUPTED, command.stopped, debug)
    except BrokenPipeError:  # whoever reads our output has seen enough
        close_output()
        return FAILED
    except UserError as error:
        return end(WRONG_INPUT, str(error), debug)
    except (EngineError, Failure) as error:
        return end(FAILED, str(error), debug)
    except Exception as error:
        hint = "" if debug else " (evaps --debug COMMAND ... shows where)"
        return end(FAILED, f"unexpected {type(error).__name__}: {error}{hint}", debug)


def close_output() -> None:
    """Nobody reads standard output any more; Python need not complain about it when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def end(status: int, message: str, debug: bool = False) -> int:
    """Say in one line on standard error why a job has ended.

    Args:
        status: the exit status.
        message: why.
        debug: show the traceback too.

    Returns:
        the exit status.
    """
    if debug:
        traceback.print_exc()
    print("evaps:", " ".join(message.split()), file=sys.stderr)
    return status
