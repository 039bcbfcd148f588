"""The command line: ``evaps COMMAND ...``."""

import sys
from multiprocessing import parent_process

from evaps.domain import DomainError

try:
    from evaps.cli.main import main
except KeyboardInterrupt:  # the import takes long enough to be stopped in it
    if parent_process() is None:  # a worker need not say it, too
        print("evaps: stopped", file=sys.stderr)
    raise SystemExit(130) from None
except DomainError as error:  # without the domain's words nothing can be loaded
    print(f"evaps: {error}", file=sys.stderr)
    raise SystemExit(2) from None

__all__ = ["main"]
