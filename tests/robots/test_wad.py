"""The world's text and the WAD file that holds it."""

import re
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaps.robots.engine import doom_palette
from evaps.robots.wad import ARENA_X, ARENA_Y, KINDS, arena_wad, decorate, mapinfo, pack, textmap, unpack

NAMES = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", min_size=1, max_size=8)


@given(st.lists(st.tuples(NAMES, st.binary(max_size=40)), unique_by=lambda lump: lump[0], max_size=6))
def test_what_is_packed_is_unpacked(lumps: list[tuple[str, bytes]]) -> None:
    wad = pack(lumps)
    assert wad[:4] == b"PWAD"
    assert len(wad) == 12 + sum(16 + len(content) for _, content in lumps)
    for name, content in lumps:
        assert unpack(wad, name) == content
    with pytest.raises(KeyError):
        unpack(wad, "missing")


def test_of_equal_names_the_first_is_found() -> None:
    assert unpack(pack([("A", b"one"), ("A", b"two")]), "A") == b"one"


def test_the_lumps_of_a_map_stand_in_the_order_that_the_engine_wants() -> None:
    wad = arena_wad()
    _, count, start = struct.unpack_from("<4sii", wad)
    names = [wad[start + 16 * i + 8 : start + 16 * i + 16].rstrip(b"\0").decode() for i in range(count)]
    assert names[names.index("MAP01") :] == ["MAP01", "TEXTMAP", "ENDMAP"]
    assert {"DECORATE", "MAPINFO"} <= set(names)
    assert unpack(wad, "DECORATE").decode() == decorate()
    assert unpack(wad, "MAPINFO").decode() == mapinfo()
    assert unpack(wad, "TEXTMAP").decode() == textmap()
    assert arena_wad() == wad, "the same bytes each time"


def test_another_text_can_be_packed() -> None:
    assert unpack(arena_wad("actor X {}"), "DECORATE") == b"actor X {}"
    assert unpack(arena_wad(""), "DECORATE") == b""


def test_the_map_is_one_rectangle_whose_walls_face_inwards() -> None:
    text = textmap()
    corners = [(float(x), float(y)) for x, y in re.findall(r"vertex { x = (\S+); y = (\S+); }", text)]
    assert sorted(corners) == sorted((float(x), float(y)) for x in ARENA_X for y in ARENA_Y)
    lines = [(int(a), int(b)) for a, b in re.findall(r"v1 = (\d); v2 = (\d);", text)]
    assert len(lines) == text.count("sidedef {") == 4
    area = sum(corners[a][0] * corners[b][1] - corners[b][0] * corners[a][1] for a, b in lines) / 2
    assert area == -640 * 448, "clockwise"
    assert text.count("sector {") == 1
    for fact in ("heightceiling = 104;", "lightlevel = 210;", '"CRATOP1";', '"BRICK12";'):
        assert fact in text


def test_every_monster_stands_still_and_dies_of_one_bullet() -> None:
    text = decorate()
    for kind, (sprite, _) in KINDS.items():
        (block,) = re.findall(rf"actor Evaps{kind} : {kind}\n(.*?\n}}\n)", text, re.DOTALL)
        for line in ("Health 1", "Speed 0", "+FRIENDLY", f"{sprite} A -1"):
            assert line in block
    assert 'playerclasses = "EvapsRobot"' in mapinfo()


def test_the_palette_is_the_engines() -> None:
    palette = doom_palette()
    assert palette.shape == (256, 3)
    assert palette[0].tolist() == [0, 0, 0]
    assert len({tuple(colour) for colour in palette.tolist()}) > 200
    with pytest.raises(ValueError, match="read-only"):
        palette[0] = 1
