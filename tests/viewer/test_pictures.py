import base64
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from evaps.viewer.pictures import WEBP_URI, Pictures, depth_png, rgb_png


@pytest.mark.parametrize(("colours", "mode"), [(1, "P"), (2, "P"), (17, "P"), (256, "P"), (257, "RGB")])
def test_colours_are_exact(colours, mode):
    rng = np.random.default_rng(colours)
    palette = np.arange(colours) * 65_521 + 77  # distinct in 24 bits
    codes = np.concatenate([palette, rng.choice(palette, 24 * 32 - colours)]).reshape(24, 32)
    pixels = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], -1).astype(np.uint8)
    with Image.open(BytesIO(rgb_png(pixels))) as picture:
        assert picture.mode == mode
        assert np.array_equal(np.array(picture.convert("RGB")), pixels)


@pytest.mark.parametrize("furthest", [0, 60, 255])
def test_depth_is_exact_in_the_indices_and_grey_in_the_colours(furthest):
    depth = np.arange(0, 120, dtype=np.uint8).reshape(10, 12)
    with Image.open(BytesIO(depth_png(depth, furthest))) as picture:
        assert np.array_equal(np.array(picture), depth)
        grey = np.array(picture.convert("RGB"))
    assert np.array_equal(grey[..., 0], grey[..., 2])
    assert np.all(np.diff(grey[..., 0].ravel().astype(int)) >= 0)
    assert np.all(grey[depth >= max(furthest, 1)] == 255)


def test_a_little_loss_makes_pictures_smaller():
    rng = np.random.default_rng(0)
    slope = np.linspace(0, 200, 120 * 160).reshape(120, 160, 1) + rng.integers(0, 30, (120, 160, 3))
    pixels = slope.astype(np.uint8)
    uri, exact = (Pictures(lossy=lossy).rgb(pixels).data_uri for lossy in (True, False))
    assert len(uri) < len(exact) / 2
    with Image.open(BytesIO(base64.b64decode(uri.removeprefix(WEBP_URI)))) as picture:
        seen = np.array(picture.convert("RGB")).astype(int)
    assert np.abs(seen - pixels).mean() < 15


def test_equal_pictures_are_there_once():
    pictures = Pictures()
    white = np.full((4, 6, 3), 255, np.uint8)
    assert pictures.rgb(white) is pictures.rgb(white.copy())
    assert pictures.rgb(white).id != pictures.rgb(white.reshape(6, 4, 3)).id
    assert (pictures.rgb(white).width, pictures.rgb(white).height) == (6, 4)
    assert len(pictures.by_content) == 2
