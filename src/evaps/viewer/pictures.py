"""Views of the robot as small pictures, PNGs without loss unless asked otherwise, each distinct one once."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from hashlib import sha256
from io import BytesIO

import numpy as np
from PIL import Image as Picture

from evaps.robots.frames import Image

PNG_URI = "data:image/png;base64,"
"""What an address begins with that is a PNG."""
WEBP_URI = "data:image/webp;base64,"
QUALITY = 60  # of 100, where there may be loss


@dataclass(frozen=True)
class PictureRef:
    """A picture of the page.

    Attributes:
        id: the picture's id in the page.
        width: in pixels.
        height: in pixels.
        data_uri: the picture itself.
    """

    id: str
    width: int
    height: int
    data_uri: str


@dataclass
class Pictures:
    """The distinct pictures that a page has shown so far, in the order in which they first appeared.

    Attributes:
        lossy: colours as WebP with a little loss, a third of the size, for pages with hundreds of them.
    """

    lossy: bool = False
    by_content: dict[bytes, PictureRef] = field(default_factory=dict)

    def rgb(self, pixels: Image) -> PictureRef:
        """A picture of colours, uint8 ``[height, width, 3]``."""
        return self._add(pixels, 0)

    def depth(self, depth: Image, furthest: int) -> PictureRef:
        """A picture of a depth plane, uint8 ``[height, width]``: near is dark, ``furthest`` is white."""
        return self._add(depth, furthest)

    def _add(self, pixels: Image, furthest: int) -> PictureRef:
        key = sha256(pixels.tobytes() + repr((pixels.shape, furthest)).encode()).digest()
        if key not in self.by_content:
            height, width = pixels.shape[:2]
            uri = self._uri(pixels, furthest)
            self.by_content[key] = PictureRef(f"p{len(self.by_content)}", width, height, uri)
        return self.by_content[key]

    def _uri(self, pixels: Image, furthest: int) -> str:
        if pixels.ndim == 2:
            return data_uri(depth_png(pixels, furthest))
        if self.lossy:
            webp = _encoded(Picture.fromarray(pixels), "WEBP", quality=QUALITY, method=6)
            return data_uri(webp, WEBP_URI)
        return data_uri(rgb_png(pixels))


def data_uri(content: bytes, begin: str = PNG_URI) -> str:
    """A picture, a PNG unless it begins otherwise, as an address that holds the picture itself."""
    return begin + base64.b64encode(content).decode("ascii")


def rgb_png(pixels: Image) -> bytes:
    """A PNG with exactly these colours; with a palette if there are at most 256 of them.

    Args:
        pixels: uint8 ``[height, width, 3]``.
    """
    codes = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    colours, indices = np.unique(codes, return_inverse=True)
    if len(colours) > 256:
        return _png(Picture.fromarray(pixels))
    palette = np.stack([colours >> 16, colours >> 8, colours], 1).astype(np.uint8)
    return _palette_png(indices.reshape(codes.shape).astype(np.uint8), palette)


def depth_png(depth: Image, furthest: int) -> bytes:
    """A greyscale PNG in which the depth ``furthest`` is white; the palette's indices are the depth itself.

    Args:
        depth: uint8 ``[height, width]``.
        furthest: the depth from which on everything is white.
    """
    levels = np.minimum(np.arange(256) * 255 // max(furthest, 1), 255).astype(np.uint8)
    return _palette_png(depth, np.repeat(levels[: int(depth.max()) + 1, None], 3, 1))


def _palette_png(indices: Image, palette: Image) -> bytes:
    picture = Picture.fromarray(indices)
    picture.putpalette(palette.tobytes())
    return _png(picture)


def _png(picture: Picture.Image) -> bytes:
    return _encoded(picture, "PNG", optimize=True)


def _encoded(picture: Picture.Image, kind: str, **options: int) -> bytes:
    file = BytesIO()
    picture.save(file, kind, **options)
    return file.getvalue()
