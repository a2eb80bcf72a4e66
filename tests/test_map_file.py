import itertools
import math
import re

import numpy as np
import pytest
from PIL import Image

from navirl_cli.errors import LogError
from navirl_cli.logs.map_file import read_map

KEYS = {
    "image": "map.png",
    "resolution": 0.05,
    "origin": "[-1.5, 2.25, 0.0]",
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write(folder, name="map.yaml", **keys):
    """A YAML file; a key of None is left out."""
    lines = [f"{key}: {value}" for key, value in {**KEYS, **keys}.items() if value is not None]
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def slow_map(pixels, full, *, mode="trinary", negate=False, occupied=0.65, free=0.196):
    """nav2_map_server's rule, pixel by pixel, in its 16 bits; a pixel is (r, g, b) or (r, g, b, opacity)."""
    rows = []
    for line in reversed(pixels):
        row = []
        for pixel in line:
            deep = [channel * 257 if full == 255 else channel for channel in pixel]
            counted = deep if mode == "trinary" else deep[:3]
            shade = sum(counted) / len(counted) / 65535
            share = shade if negate else 1 - shade
            if mode == "raw":
                value = math.floor(shade * 255 + 0.5)
                row.append(value if value <= 100 else -1)
            elif mode == "scale" and len(pixel) == 4 and pixel[3] != full:
                row.append(-1)
            elif share > occupied:
                row.append(100)
            elif share < free:
                row.append(0)
            else:
                row.append(round((share - free) / (occupied - free) * 100) if mode == "scale" else -1)
        rows.append(row)
    return rows


def picture(rng, kind):
    """An image of every mode that Pillow has for maps, and its pixels as the slow twin takes them."""
    rows, columns = rng.integers(1, 12, 2)
    grey = rng.integers(0, 256, (rows, columns), dtype=np.uint8)
    # most pixels of a map have one of few colours, and opaque ones must be there
    grey = np.where(rng.random(grey.shape) < 0.5, rng.choice([0, 51, 100, 205, 254, 255], grey.shape), grey)
    grey = grey.astype(np.uint8)
    alpha = np.where(rng.random(grey.shape) < 0.5, 255, rng.integers(0, 256, grey.shape)).astype(np.uint8)
    colour = rng.integers(0, 256, (rows, columns, 3), dtype=np.uint8)
    options = {}
    if kind == "L":
        image, channels = Image.fromarray(grey), [grey] * 3
    elif kind == "L, one clear":
        clear = int(grey[0, 0])
        image, channels = Image.fromarray(grey), [grey] * 3 + [np.where(grey == clear, 0, 255)]
        options = {"transparency": clear}
    elif kind == "LA":
        image, channels = Image.fromarray(np.dstack([grey, alpha])), [grey] * 3 + [alpha]
    elif kind == "RGB":
        image, channels = Image.fromarray(colour), np.moveaxis(colour, 2, 0)
    elif kind == "RGBA":
        image, channels = Image.fromarray(np.dstack([colour, alpha])), [*np.moveaxis(colour, 2, 0), alpha]
    elif kind == "P":
        image, channels = palette(grey, colour), [colour.reshape(-1, 3)[grey % (rows * columns), i] for i in range(3)]
    elif kind == "P, one clear":
        image, index = palette(grey, colour), grey % (rows * columns)
        clear = int(index[0, 0])
        channels = [colour.reshape(-1, 3)[index, i] for i in range(3)] + [np.where(index == clear, 0, 255)]
        options = {"transparency": clear}
    elif kind == "1":
        image, channels = Image.fromarray(grey > 100), [np.where(grey > 100, 255, 0)] * 3
    else:
        deep = grey.astype(np.uint16) * 256 + alpha
        image, channels = Image.fromarray(deep), [deep] * 3
        if kind == "I;16, one clear":
            options = {"transparency": int(deep[0, 0])}
            channels = [*channels, np.where(deep == deep[0, 0], 0, 65535)]
    pixels = [[tuple(int(channel[r, c]) for channel in channels) for c in range(columns)] for r in range(rows)]
    return image, pixels, options


def palette(grey, colour):
    table = colour.reshape(-1, 3)
    image = Image.frombytes("P", grey.shape[::-1], (grey % len(table)).astype(np.uint8).tobytes())
    image.putpalette(table.tobytes())
    return image


KINDS = ["L", "L, one clear", "LA", "RGB", "RGBA", "P", "P, one clear", "1", "I;16", "I;16, one clear"]


@pytest.mark.parametrize("kind", KINDS)
def test_cells_are_those_of_the_slow_twin(tmp_path, kind):
    rng = np.random.default_rng(KINDS.index(kind))
    seen = set()
    for mode, negate, number in itertools.product(("trinary", "scale", "raw"), (False, True), range(4)):
        image, pixels, options = picture(rng, kind)
        image.save(tmp_path / "map.png", **options)
        occupied, free = [(0.65, 0.196), (0.65, 0.25), (0.6, 0.2), (0.9, 0.05)][number]
        path = write(tmp_path, mode=mode, negate=int(negate), occupied_thresh=occupied, free_thresh=free)
        found = read_map(path)
        full = 65535 if kind.startswith("I") else 255
        expected = slow_map(pixels, full, mode=mode, negate=negate, occupied=occupied, free=free)
        assert found.data.tolist() == expected, (mode, negate, number)
        assert found.data.dtype == np.int8
        seen |= set(found.data.ravel().tolist())
    assert {-1, 0, 100} <= seen, seen


def test_the_first_row_of_the_picture_has_the_highest_y(tmp_path):
    Image.fromarray(np.array([[0, 255], [205, 255], [255, 0]], dtype=np.uint8)).save(tmp_path / "map.pgm")
    found = read_map(write(tmp_path, image="map.pgm"))
    # 205 is the grey of unknown cells: 50 / 255 = 0.196..., which is not less than the threshold
    assert found.data.tolist() == [[0, 100], [-1, 0], [100, 0]]
    assert (found.resolution_m, found.origin_m) == (0.05, (-1.5, 2.25))
    assert found.data.flags.c_contiguous


@pytest.mark.parametrize(
    ("content", "cells"),
    [
        (b"P2\n# made by hand\n3 1\n255\n0 205 254\n", [[100, -1, 0]]),
        (b"P5\n# made by hand\n3 1\n255\n\x00\xcd\xfe", [[100, -1, 0]]),
        (b"P5 3 1 65535\n\x00\x00\xcd\xcd\xfe\xfe", [[100, -1, 0]]),
        (b"P5 3 1 100\n\x00\x32\x64", [[100, -1, 0]]),
        (b"P6 1 1 255\n\x00\x00\xff", [[100]]),
    ],
)
def test_every_pgm_is_read(tmp_path, content, cells):
    (tmp_path / "map.pgm").write_bytes(content)
    assert read_map(write(tmp_path, image="map.pgm")).data.tolist() == cells


def test_a_byte_order_mark_is_no_part_of_the_first_key(tmp_path):
    Image.fromarray(np.array([[0, 255]], dtype=np.uint8)).save(tmp_path / "map.png")
    path = write(tmp_path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_map(path).data.tolist() == [[100, 0]]


def test_a_colour_on_the_threshold_is_rounded_as_nav2_does(tmp_path):
    # the sums of channels whose brightness, computed in 8 bits, would be another double
    sums = [total for total in range(766) if total / 3 / 255 != total * 257 / 3 / 65535]
    assert sums
    for total in sums[:: len(sums) // 20]:
        colour = [total // 3 + (place < total % 3) for place in range(3)]
        Image.fromarray(np.array([[colour]], dtype=np.uint8)).save(tmp_path / "map.png")
        share = total * 257 / 3 / 65535
        path = write(tmp_path, negate=1, occupied_thresh=repr(share), free_thresh=repr(share))
        assert read_map(path).data.tolist() == [[-1]]


def test_bmp_and_paths_outside_of_the_folder_are_read(tmp_path):
    (tmp_path / "pictures").mkdir()
    (tmp_path / "maps").mkdir()
    file = tmp_path / "pictures" / "hall.bmp"
    Image.fromarray(np.array([[0, 255]], dtype=np.uint8)).save(file)
    for name in (file, "../pictures/hall.bmp"):
        assert read_map(write(tmp_path / "maps", image=name)).data.tolist() == [[100, 0]]


def test_in_the_trinary_mode_opacity_counts_as_a_colour_and_in_scale_it_decides(tmp_path):
    Image.fromarray(np.array([[[255, 0], [255, 255], [0, 255]]], dtype=np.uint8)).save(tmp_path / "map.png")
    assert read_map(write(tmp_path)).data.tolist() == [[-1, 0, 100]]
    assert read_map(write(tmp_path, free_thresh=0.26)).data.tolist() == [[0, 0, 100]]
    assert read_map(write(tmp_path, mode="scale")).data.tolist() == [[-1, 0, 100]]
    assert read_map(write(tmp_path, mode="raw")).data.tolist() == [[-1, -1, 0]]


def test_equal_thresholds_serve_where_nothing_lies_between_them(tmp_path):
    Image.fromarray(np.array([[0, 255]], dtype=np.uint8)).save(tmp_path / "map.png")
    same = {"occupied_thresh": 0.5, "free_thresh": 0.5}
    assert read_map(write(tmp_path, **same)).data.tolist() == [[100, 0]]
    with pytest.raises(
        LogError, match=r"key free_thresh: expected less than occupied_thresh, which is 0\.5, found 0\.5"
    ):
        read_map(write(tmp_path, mode="scale", **same))


REMEDY = "; correct it, or save the map again with map_saver_cli"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        *[
            ({key: None}, f"key {key}: expected {expected}, found no such key{REMEDY}")
            for key, expected in [
                ("image", "the name of a pgm, png or bmp file"),
                ("resolution", "m a cell, from 0.001 to 100"),
                ("origin", "[x, y, yaw] in m, m and rad"),
                ("negate", "0 or 1"),
                ("occupied_thresh", "a number from 0 to 1"),
                ("free_thresh", "a number from 0 to 1"),
            ]
        ],
        ({"image": "3"}, "key image: expected the name of a pgm, png or bmp file, found 3"),
        ({"image": "''"}, "key image: expected the name of a pgm, png or bmp file, found ''"),
        ({"resolution": 0}, "key resolution: expected m a cell, from 0.001 to 100, found 0;"),
        ({"resolution": -0.05}, "found -0.05;"),
        ({"resolution": 1e-9}, "key resolution: expected m a cell, from 0.001 to 100, found 1e-09;"),
        ({"resolution": 101}, "found 101;"),
        ({"origin": [2e6, 0.0, 0.0]}, "key origin: expected [x, y, yaw] in m, m and rad, found [2000000.0, 0.0, 0.0];"),
        ({"resolution": ".nan"}, "key resolution: expected m a cell, from 0.001 to 100, found nan;"),
        ({"resolution": ".inf"}, "found inf;"),
        ({"resolution": "true"}, "found True;"),
        ({"resolution": "[1]"}, "found [1];"),
        ({"resolution": "9" * 400}, "key resolution: expected m a cell, from 0.001 to 100, found 9999"),
        ({"resolution": "5 cm"}, "found '5 cm';"),
        ({"origin": "[0, 0]"}, "key origin: expected [x, y, yaw] in m, m and rad, found [0, 0];"),
        ({"origin": "[0, 0, {}]"}, "found [0, 0, {}];"),
        ({"origin": "{x: 0}"}, "found {'x': 0};"),
        ({"origin": "[0, 0, .nan]"}, "found [0, 0, nan];"),
        ({"origin": "[0, 0, 0.5]"}, "key origin: expected a map whose cells run along its frame's axes, found one"),
        ({"origin": "[0, 0, -1.5]"}, "rotated by -85.9 degrees; save the map with an origin of yaw 0"),
        ({"negate": "maybe"}, "key negate: expected 0 or 1, found 'maybe';"),
        ({"occupied_thresh": 65}, "key occupied_thresh: expected a number from 0 to 1, found 65;"),
        ({"free_thresh": -0.1}, "key free_thresh: expected a number from 0 to 1, found -0.1;"),
        ({"free_thresh": 0.7}, "key free_thresh: expected less than occupied_thresh, which is 0.65, found 0.7;"),
        ({"mode": "ternary"}, "key mode: expected trinary, scale or raw, found 'ternary';"),
        ({"mode": "[raw]"}, "key mode: expected trinary, scale or raw, found ['raw'];"),
        ({"image": "none.png"}, "key image: expected a pgm, png or bmp file, found no file {folder}/none.png; put"),
        ({"image": "."}, "found at {folder}: a folder, expected a regular file;"),
        ({"image": '"a\\0b"'}, "one that does not decode ('embedded null byte')"),
        ({"image": "text.png"}, "found something else at {folder}/text.png" + REMEDY),
        ({"image": "photo.jpg"}, "found something else at {folder}/photo.jpg" + REMEDY),
        ({"image": "cut.pgm"}, "found at {folder}/cut.pgm: one that does not decode ("),
        ({"image": "few.pgm"}, "found at {folder}/few.pgm: one that does not decode ('not enough image data')"),
        ({"image": "broken.png"}, "found at {folder}/broken.png: one that does not decode ("),
        ({"image": "float.ppm"}, "one that does not decode ('its numbers are not colours')"),
        ({"image": "bomb.pgm"}, "found one of more than 89478485 cells at {folder}/bomb.pgm; cut the map"),
        ({"image": "big.pgm"}, "found one of more than 89478485 cells at {folder}/big.pgm; cut the map"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore")
def test_what_is_no_map_is_named(tmp_path, keys, message):
    Image.fromarray(np.zeros((20, 20), dtype=np.uint8)).save(tmp_path / "map.png")
    Image.new("L", (20, 20)).save(tmp_path / "photo.jpg")
    png = (tmp_path / "map.png").read_bytes()
    files = {
        "text.png": b"hello",
        "cut.pgm": b"P5 3 3 255\nab",
        "few.pgm": b"P2 3 3 255\n1 2",
        "broken.png": png[:-30],
        "float.ppm": b"Pf\n1 1\n-1.0\n" + bytes(4),
        "bomb.pgm": b"P5 99999 99999 255\n",
        "big.pgm": b"P5 10000 10000 255\n",
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    path = write(tmp_path, **keys)
    with pytest.raises(LogError, match=re.escape(message.replace("{folder}", str(tmp_path)))) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"{path}: key ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected YAML with keys and values, found an empty file"),
        (b"- 1\n- 2\n", "expected YAML with keys and values, found [1, 2]"),
        (b"image: [1, 2\nresolution: 3\n", "found line 2: expected ',' or ']', but got ':'"),
        (b"image: a\nimage: b\n", "found line 2: found duplicate key"),
        (b"\xff\xfe\x00", "found 'utf-8' codec can't decode byte 0xff"),
        (b"made: 2024-13-45\n", "found month must be in 1..12"),
        (b"made: !!bool maybe\n", "found 'maybe'"),
        (b"[" * 500, "found line 1: more than 40 levels of nesting"),
        (b"P5 3 1 255\n\0\0\0", "found "),
    ],
)
def test_what_is_no_yaml_is_named(tmp_path, content, message):
    path = tmp_path / "map.yaml"
    path.write_bytes(content)
    with pytest.raises(LogError, match=re.escape(message)) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"{path}: expected YAML with keys and values, found ")
    assert str(caught.value).endswith(REMEDY)
    assert "\n" not in str(caught.value)


def test_a_missing_yaml_file(tmp_path):
    with pytest.raises(LogError, match=r"none.yaml: expected a YAML file, found: No such file or directory; correct"):
        read_map(tmp_path / "none.yaml")
