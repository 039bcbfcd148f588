"""The studio: a local page on which people set up scenes, drive the robot, and have programs written."""

from evaps.studio.app import LOOPBACK, create_app

__all__ = ["LOOPBACK", "create_app"]
