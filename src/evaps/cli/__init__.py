"""The command line: ``evaps COMMAND ...``."""

import sys

try:
    from evaps.cli.main import main
except KeyboardInterrupt:  # the import takes long enough to be stopped in it
    print("evaps: stopped", file=sys.stderr)
    raise SystemExit(130) from None

__all__ = ["main"]
