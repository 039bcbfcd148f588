"""``evaps doctor``: what is missing on this machine."""

from __future__ import annotations

import json
from dataclasses import dataclass

from evaps.cli.command import Command, Failure


@dataclass(frozen=True)
class Doctor(Command):
    """Look at all that evaps needs: torch, the engine, checkpoints, memory, extras.

    The exit status is 1 if something is missing without which nothing works.
    """

    json: bool = False
    """Print one JSON object for each thing that was looked at."""

    def run(self) -> None:
        """Print what is found, each as soon as it is."""
        from evaps.doctor import examine

        sick = []
        for finding in examine():
            if self.json:
                print(json.dumps(vars(finding)), flush=True)
            else:
                mark = "ok  " if finding.well else "FAIL" if finding.needed else "--  "
                print(f"{mark} {finding.what:19} {finding.found}", flush=True)
            if finding.needed and not finding.well:
                sick.append(finding.what)
        if sick:
            raise Failure(f"something is wrong with: {', '.join(sick)}")
