"""Maps as nav2_map_server saves them: a YAML file that names a picture and defines its colours.

The meaning of colours is that of nav2_map_server (ros-navigation/navigation2, nav2_map_server/src/map_io.cpp).
"""

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.errors import LogError, brief
from navirl_cli.files import open_regular
from navirl_cli.limits import REMEDY, Allowance
from navirl_cli.logs.map_geometry import LEAST_M, MOST_M, check_geometry, is_place, is_resolution
from navirl_cli.logs.recording import Occupancy
from navirl_cli.logs.yaml_file import read_mapping

if TYPE_CHECKING:
    from PIL.Image import Image

_FORMATS: Final = ("PPM", "PNG", "BMP")
_REMEDY: Final = "correct it, or save the map again with map_saver_cli"
#: Integers 0..100 and -1 for unknown.
_Cells = NDArray[np.int8]


def _is_number(value: object) -> bool:
    """Whether a value of YAML is a number that a map can hold; the bounds also refuse endless integers."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -1e9 < value < 1e9


def _is_share(value: Any) -> bool:
    return _is_number(value) and 0 <= value <= 1


#: By key: the expected value, and whether a value is as expected.
_KEYS: Final[dict[str, tuple[str, Callable[[Any], bool]]]] = {
    "image": ("the name of a pgm, png or bmp file", lambda value: isinstance(value, str) and value != ""),
    "resolution": (
        f"m a cell, from {LEAST_M:g} to {MOST_M:g}",
        lambda value: _is_number(value) and is_resolution(value),
    ),
    "origin": (
        "[x, y, yaw] in m, m and rad",
        lambda value: (
            isinstance(value, list) and len(value) == 3 and all(map(_is_number, value)) and all(map(is_place, value))
        ),
    ),
    "negate": ("0 or 1", lambda value: isinstance(value, int)),
    "occupied_thresh": ("a number from 0 to 1", _is_share),
    "free_thresh": ("a number from 0 to 1", _is_share),
    "mode": ("trinary, scale or raw", lambda value: isinstance(value, str) and value in {"trinary", "scale", "raw"}),
}


@dataclass(frozen=True)
class _Colours:
    """The meaning of a picture's colours."""

    mode: str
    negate: bool
    occupied: float
    free: float


def read_map(path: Path) -> Occupancy:
    """Read a map.

    Args:
        path: The YAML file. Its keys: image (a path relative to it), resolution (m a cell), origin ([x, y, yaw] of the
            lower left corner), negate, occupied_thresh, free_thresh, mode (trinary where it is left out).

    Returns:
        The map. Colours of 16 bits a channel are read as 8 bits, grey ones in full.

    Raises:
        LogError: The file or its picture cannot be read, a key is missing or wrong, or the map is rotated.
    """
    document = {"mode": "trinary", **read_mapping(path, _REMEDY)}
    for key, (expected, fits) in _KEYS.items():
        found = brief(document[key]) if key in document else "no such key"
        if key not in document or not fits(document[key]):
            raise LogError(f"{path}: key {key}: expected {expected}, found {found}; {_REMEDY}")
    x, y, yaw = document["origin"]
    check_geometry(f"{path}: key origin", float(document["resolution"]), (x, y), yaw, _REMEDY)
    cells = _picture(path, document["image"], _colours(path, document))
    return Occupancy(cells[::-1].copy(), float(document["resolution"]), (float(x), float(y)))


def _colours(path: Path, document: Mapping[str, Any]) -> _Colours:
    mode, occupied, free = document["mode"], document["occupied_thresh"], document["free_thresh"]
    # the scale between them needs a length
    if free > occupied or (free == occupied and mode == "scale"):
        raise LogError(
            f"{path}: key free_thresh: expected less than occupied_thresh, which is {occupied}, found {free}; {_REMEDY}"
        )
    return _Colours(mode, bool(document["negate"]), occupied, free)


def _picture(path: Path, name: str, colours: _Colours) -> _Cells:
    """The cells of a picture, top row first."""
    from PIL import Image, UnidentifiedImageError

    file = path.parent / name
    allowance = Allowance()
    expected = f"{path}: key image: expected a pgm, png or bmp file, found"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with open_regular(file) as stream, Image.open(stream, formats=_FORMATS) as image:
                most = allowance.most(os.fstat(stream.fileno()).st_size)
                if image.width * image.height > most:
                    raise LogError(
                        f"{expected} {file} of {image.width} x {image.height} cells, expected at most {most} for its "
                        f"size; {REMEDY}"
                    )
                light, alpha, full = _light(image)
    except FileNotFoundError as error:
        raise LogError(f"{expected} no file {file}; put it there or correct the key") from error
    except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
        limit = Image.MAX_IMAGE_PIXELS
        raise LogError(
            f"{expected} one of more than {limit} cells at {file}; cut the map or make it coarser"
        ) from error
    except UnidentifiedImageError as error:
        raise LogError(f"{expected} something else at {file}; {_REMEDY}") from error
    except (OSError, ValueError, SyntaxError) as error:
        what = getattr(error, "strerror", None) or f"one that does not decode ({brief(str(error))})"
        raise LogError(f"{expected} at {file}: {what}; {_REMEDY}") from error
    return _cells(light, alpha, full, colours)


def _light(image: "Image") -> tuple[NDArray[Any], NDArray[Any] | None, int]:
    """Sum of red, green and blue of each pixel, its opacity (None without), and the largest value of a channel."""
    if image.mode.startswith("I"):
        grey = np.asarray(image).astype(np.int32)
        clear = image.info.get("transparency")
        return 3 * grey, None if clear is None else np.where(grey == clear, 0, 65535), 65535
    if image.mode == "F":
        raise ValueError("its numbers are not colours")
    if image.mode in {"1", "L"} and not image.has_transparency_data:
        return 3 * np.asarray(image.convert("L")).astype(np.uint16), None, 255
    if not image.has_transparency_data:
        return np.asarray(image.convert("RGB")).sum(axis=2, dtype=np.uint16), None, 255
    channels = np.asarray(image.convert("RGBA"))
    return channels[..., :3].sum(axis=2, dtype=np.uint16), channels[..., 3], 255


def _cells(light: NDArray[Any], alpha: NDArray[Any] | None, full: int, colours: _Colours) -> _Cells:
    """Occupancy by pixel, from a table over the sums of channels."""
    channels = 3
    if colours.mode == "trinary" and alpha is not None:
        # as in ROS 1, Nav2 counts opacity as a colour
        light, channels = light + alpha, 4
    # nav2_map_server has 16 bits a channel: its rounding decides about colours on a threshold
    shade = np.arange(channels * full + 1) * (65535 // full) / channels / 65535
    occupied = shade if colours.negate else 1 - shade
    if colours.mode == "raw":
        value = np.rint(shade * 255)
        table = np.where(value <= 100, value, -1)
    else:
        between = np.full_like(occupied, -1)
        if colours.mode == "scale":
            between = np.rint((occupied - colours.free) / (colours.occupied - colours.free) * 100)
        table = np.where(occupied > colours.occupied, 100, np.where(occupied < colours.free, 0, between))
    table, cells = table.astype(np.int8), np.empty(light.shape, dtype=np.int8)
    for row in range(len(cells)):
        # numpy makes wide indices of these, eight bytes a cell
        cells[row] = table[light[row]]
    if colours.mode == "scale" and alpha is not None:
        cells[alpha != full] = -1
    return cells
