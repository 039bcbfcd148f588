"""The command line: ``evaps COMMAND ...``."""

from evaps.cli.main import main

__all__ = ["main"]
