"""``evaps studio``: the live page."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Annotated

from tyro.conf import Positional, arg

from evaps.cli.command import Command
from evaps.cli.synthesize import shipped_tasks
from evaps.domain import CHOSEN
from evaps.dsl import UserError


@dataclass(frozen=True)
class Studio(Command):
    """A local page on which to set up scenes, drive the robot, run programs, and have them written.

    Needs the extra `viewer`: pip install 'evaps[viewer]'. It listens on this machine only; Ctrl-C ends it.
    """

    tasks: Annotated[Positional[tuple[Path, ...]], arg(help_behavior_hint="(default: none)")] = ()
    """Task folders that can be loaded, beside the shipped ones."""
    port: int = 8000
    """Where it listens; 0 for any that is free."""
    host: str = "127.0.0.1"
    """The address to listen on; with another than this machine's own, whoever can reach it can use it."""
    model: str = CHOSEN.model
    """A shipped set of checkpoints, a folder of them, or hub:OWNER/NAME."""

    def run(self) -> None:
        """Serve it until Ctrl-C."""
        if not 0 <= self.port <= 65_535:
            raise UserError(f"--port must be between 0 and 65535, not {self.port}")
        try:
            import uvicorn

            from evaps.studio import LOOPBACK, create_app
            from evaps.tasks.task import load_task
        except ImportError as error:
            raise UserError(f"the studio needs {error.name}; try: pip install 'evaps[viewer]'") from error

        if self.model != CHOSEN.model:  # the usual set may be missing: then it is a page for driving
            from evaps.models import model_folder

            model_folder(self.model)
        for folder in self.tasks:
            load_task(folder)  # what cannot be loaded is told before anybody looks for it
        listening = _listen(self.host, self.port)
        name, port = listening.getsockname()[:2]
        everywhere = name in ("0.0.0.0", "::")
        folders, names = [*shipped_tasks(), *self.tasks], {*LOOPBACK, self.host, name}
        app = create_app(folders, self.model, names, everywhere)
        shown = socket.gethostname() if everywhere else f"[{name}]" if ":" in name else name
        print(f"evaps studio: http://{shown}:{port}/ (Ctrl-C ends it)", flush=True)

        class Server(uvicorn.Server):
            def handle_exit(self, sig: int, frame: FrameType | None) -> None:
                """Ctrl-C: a search that somebody listens to has to end before the server can."""
                app.state.searches.interrupt()
                super().handle_exit(sig, frame)

        server = Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=5))
        server.run([listening])


def _listen(host: str, port: int) -> socket.socket:
    """A socket that listens, before anything heavy is begun."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family)
    except (OSError, UnicodeError) as error:
        raise UserError(
            f"cannot listen on {host}, port {port}: {error}; try another --host or --port"
        ) from error
