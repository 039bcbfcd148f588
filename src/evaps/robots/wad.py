"""The Doom robot's world as text: the map (UDMF) and its things (DECORATE), packed into a WAD file."""

from __future__ import annotations

import struct
from collections.abc import Mapping

KINDS = {"Demon": ("SARG", 30), "HellKnight": ("BOS2", 24), "Revenant": ("SKEL", 20)}  # kind: sprite, radius
CLIP = "Clip"
RADII = {**{kind: radius for kind, (_, radius) in KINDS.items()}, CLIP: 20}  # map units
ROBOT_RADIUS = 16

ARENA_X = (-512, 128)  # the walls, in map units
ARENA_Y = (64, 512)
PREFIX = "Evaps"  # our classes: EvapsDemon, EvapsRobot, ...

_MONSTER = """actor {prefix}{kind} : {kind}
{{
  Health 1
  Speed 0
  +FRIENDLY
  States
  {{
  Spawn:
    {sprite} A -1
    Stop
  See:
    {sprite} A -1
    Stop
  }}
}}
"""

_ROBOT = """actor {prefix}Robot : DoomPlayer
{{
  +INVULNERABLE
  +DONTTHRUST
}}
"""

_MAPINFO = """gameinfo {{ playerclasses = "{prefix}Robot" }}
map MAP01 "Arena" {{ }}
"""


def decorate() -> str:
    """The classes of the things that stand in the arena, and of the robot."""
    monsters = [_MONSTER.format(prefix=PREFIX, kind=kind, sprite=s) for kind, (s, _) in KINDS.items()]
    return "".join([_ROBOT.format(prefix=PREFIX), *monsters])


def mapinfo() -> str:
    """Which class the player is, and that there is one map."""
    return _MAPINFO.format(prefix=PREFIX)


def textmap() -> str:
    """The arena: one rectangular room, as UDMF."""
    (left, right), (bottom, top) = ARENA_X, ARENA_Y
    corners = [(left, bottom), (left, top), (right, top), (right, bottom)]  # clockwise: walls face inwards
    textures = dict(texturefloor="CRATOP1", textureceiling="CRATOP1")
    sector = dict(heightfloor=0, heightceiling=104, **textures, lightlevel=210)
    start = dict(x=(left + right) / 2, y=(bottom + top) / 2, type=1, angle=0, single=True)
    start |= {f"skill{i}": True for i in range(1, 6)}
    blocks = [_block("thing", start), _block("sector", sector)]
    for i, (x, y) in enumerate(corners):
        blocks.append(_block("vertex", dict(x=float(x), y=float(y))))
        blocks.append(_block("sidedef", dict(sector=0, texturemiddle="BRICK12")))
        blocks.append(_block("linedef", dict(v1=i, v2=(i + 1) % 4, sidefront=i, blocking=True)))
    return 'namespace = "zdoom";\n' + "".join(blocks)


def _block(name: str, fields: Mapping[str, object]) -> str:
    return f"{name} {{ {' '.join(f'{key} = {_literal(value)};' for key, value in fields.items())} }}\n"


def _literal(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)


def pack(lumps: list[tuple[str, bytes]]) -> bytes:
    """A WAD file: a header, the lumps' contents, and the directory (offset, size, name) behind them."""
    offset, body, directory = 12, b"", b""
    for name, content in lumps:
        directory += struct.pack("<ii8s", offset + len(body), len(content), name.encode())
        body += content
    return struct.pack("<4sii", b"PWAD", len(lumps), offset + len(body)) + body + directory


def unpack(wad: bytes, name: str) -> bytes:
    """The content of the first lump called ``name``.

    Raises:
        KeyError: there is no such lump.
    """
    _, count, start = struct.unpack_from("<4sii", wad)
    for i in range(count):
        offset, size, found = struct.unpack_from("<ii8s", wad, start + 16 * i)
        if found.rstrip(b"\0") == name.encode():
            return wad[offset : offset + size]
    raise KeyError(name)


def arena_wad(decorate_text: str | None = None) -> bytes:
    """The whole world as a WAD; nodes are left to the engine, which builds them when it loads the map."""
    text = decorate() if decorate_text is None else decorate_text
    lumps = {"DECORATE": text, "MAPINFO": mapinfo(), "MAP01": "", "TEXTMAP": textmap(), "ENDMAP": ""}
    return pack([(name, content.encode()) for name, content in lumps.items()])
