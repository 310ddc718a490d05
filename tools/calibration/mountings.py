"""Mountings of the block on the inner frame: presets, and matrices from a TOML file."""

import tomllib
from collections.abc import Mapping
from math import atan, cos, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.bench import checked_rotation
from ..errors import InputError, nearest
from ..records import PositionRecord


def frame_turn(axis: int, angle: float) -> NDArray:
    """Direction cosines (3, 3) of a frame turned by `angle` [rad] about its axis 1, 2 or 3."""
    i, j = {1: (1, 2), 2: (2, 0), 3: (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = cos(angle)
    matrix[i, j], matrix[j, i] = sin(angle), -sin(angle)
    return matrix


PRESETS: dict[str, NDArray] = {
    "identity": np.eye(3),
    "cyclic": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "rz45": frame_turn(3, radians(45)),
    "ry45": frame_turn(2, radians(45)),
    "tripod": frame_turn(2, atan(1 / sqrt(2))) @ frame_turn(1, radians(45)),
    "skew": frame_turn(3, radians(20)) @ frame_turn(2, radians(30)) @ frame_turn(1, radians(40)),
}
"""Q by name: components in the block's axes from those in the inner frame. `rz45` and `ry45` are turned by 45° about
axes 3 and 2; `tripod` has all three axes equally inclined; `skew` is turned by 20°, 30°, 40° about axes 3, 2, 1."""


def checked_mounting(matrix: Any, where: str) -> NDArray:
    """A proper rotation (3, 3) from nested lists, or an InputError that begins with `where`."""
    try:
        return checked_rotation(matrix)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def read_mounting_file(path: Path) -> dict[str, NDArray]:
    """The mountings of a TOML file, `[name] matrix = [[...], [...], [...]]` for each; an InputError for any other."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(
            f"--mounting {path}: neither a file nor a preset ({nearest(str(path), tuple(PRESETS))})"
        ) from error
    except OSError as error:
        raise InputError(f"--mounting {path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"--mounting {path}: not UTF-8 text") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"--mounting {path}: not TOML: {error}") from error
    if not content:
        raise InputError(f"--mounting {path}: holds no mounting; write [name] and matrix = [[...], [...], [...]]")
    mountings = {}
    for name, table in content.items():
        where = f"--mounting {path}: [{name}]"
        if not isinstance(table, dict):
            raise InputError(f"--mounting {path}: '{name}' stands outside a [name] table")
        unknown = [key for key in table if key != "matrix"]
        if unknown or "matrix" not in table:
            wrong = f"has the unknown key '{unknown[0]}'" if unknown else "has no matrix"
            raise InputError(f"{where} {wrong}; write matrix = [[...], [...], [...]]")
        mountings[name] = checked_mounting(table["matrix"], where)
    return mountings


def mountings_of(given: Mapping[str, ArrayLike] | str) -> dict[str, NDArray]:
    """The matrices (3, 3) of mountings by name, of a preset, or of a TOML file.

    Raises
    ------
    InputError
        for an unreadable file, or a matrix that is no rotation
    """
    if not isinstance(given, str):
        return {name: checked_mounting(q, f"mounting '{name}'") for name, q in given.items()}
    return {given: PRESETS[given]} if given in PRESETS else read_mounting_file(Path(given))


def read_mounting(option: str, record: PositionRecord) -> dict[str, NDArray]:
    """The matrix of every mounting of a record, in the order in which they first appear.

    Parameters
    ----------
    option : str
        a preset's name, or the path of a TOML file
    record : PositionRecord
        its `mounting` column, where it has one, names the mountings

    Returns
    -------
    dict of str to (3, 3) array
        one entry under the option's own name when the record has no `mounting` column

    Raises
    ------
    InputError
        for an unreadable file, a matrix that is no rotation, a mounting of the record without a matrix
    """
    known = PRESETS if option in PRESETS else read_mounting_file(Path(option))
    names = mounting_names(record)
    if names is None:
        if option in PRESETS:
            return {option: PRESETS[option]}
        if len(known) > 1:
            raise InputError(
                f"{record.path}: has no column mounting, and --mounting {option} holds {len(known)} mountings "
                f"({', '.join(known)}); give a file with one, or the column"
            )
        return dict(known)
    if option in PRESETS and len(names) == 1 and names[0] not in PRESETS:
        return {names[0]: PRESETS[option]}
    if option in PRESETS and option != "identity" and names != (option,):
        raise InputError(
            f"{record.path}: its column mounting names {', '.join(names)}, which --mounting {option} does not give; "
            "give a TOML file with a matrix for each name"
        )
    return select(names, known, record, f"--mounting {option}")


def select(
    names: tuple[str, ...], known: Mapping[str, ArrayLike], record: PositionRecord, source: str
) -> dict[str, NDArray]:
    """The matrices of the named mountings; an InputError when one is missing."""
    for name in names:
        if name not in known:
            row = int(record.row[(record.mounting or ()).index(name)])
            raise InputError(
                f"{record.path}: row {row}, column mounting: {source} has no mounting '{name}' "
                f"({nearest(name, tuple(known))}); give a TOML file with [{name}] matrix = [[...], [...], [...]]"
            )
    return {name: checked_mounting(known[name], f"mounting '{name}'") for name in names}


def mounting_names(record: PositionRecord) -> tuple[str, ...] | None:
    """Names in the record's mounting column in the order of appearance; None without the column."""
    return None if record.mounting is None else tuple(dict.fromkeys(record.mounting))
