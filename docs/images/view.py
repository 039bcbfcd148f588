"""Makes view.png: what the Doom robot sees in one scene, colours and depth side by side."""

from pathlib import Path

import numpy as np
from PIL import Image

from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.doom import DoomRobot

SCENE = Scene(
    Pose(-300, 280, 10),
    (
        Thing("Demon", -60, 300),
        Thing("HellKnight", -100, 200),
        Thing("Revenant", 0, 400),
        Thing("Clip", -180, 300),
    ),
)


def main() -> None:
    """Look once and save it."""
    robot = DoomRobot()
    robot.reset(SCENE)
    seen = robot.observe()
    depth = np.repeat((seen.depth.astype(int) * 255 // seen.depth.max()).astype(np.uint8)[..., None], 3, -1)
    both = np.concatenate([seen.rgb, depth], 1).repeat(3, 0).repeat(3, 1)
    Image.fromarray(both).quantize(256).save(Path(__file__).with_name("view.png"), optimize=True)
    robot.close()


if __name__ == "__main__":
    main()
