"""The command line: ``evaps COMMAND ...``."""

import sys

from evaps.domain import DomainError

try:
    from evaps.cli.main import main
except KeyboardInterrupt:  # the import takes long enough to be stopped in it
    if "--multiprocessing-fork" not in sys.orig_argv:  # a worker that is being started need not say it, too
        print("evaps: stopped", file=sys.stderr)
    raise SystemExit(130) from None
except DomainError as error:  # without the domain's words nothing can be loaded
    print(f"evaps: {error}", file=sys.stderr)
    raise SystemExit(2) from None

__all__ = ["main"]
