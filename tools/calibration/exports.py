"""Calibrations for other programs: files of an `affine` model in the form of each of `formats`, and what they lose."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import Field

from ..errors import InputError
from ..files import bytes_of, whole_file
from ..result import Result
from .affine import Model, Request
from .correction import Correction
from .formats import FORMATS

Target = Literal["kalibr", "imucal", "ros", "c", "matlab", "csv", "xlsx", "imu_tk", "px4"]
TARGETS: tuple[str, ...] = get_args(Target)
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")
"""A name in C and in MATLAB."""


class ExportedCalibration(Result):
    """Files of a calibration for another program.

    Attributes
    ----------
    to : str
        the program or format
    files : list of str
    equation : list of str
        how it corrects, with the files' names of the matrices
    lost : list of str
        what of the calibration the format cannot hold, and its size
    open : list of str
        directions that the calibration leaves open
    """

    schema_: Literal["trihedron.exported-calibration/1"] = Field(
        default="trihedron.exported-calibration/1", alias="schema"
    )
    to: str
    files: list[str]
    equation: list[str]
    gravity: float = Field(alias="gravity_mps2")
    verdict: str
    lost: list[str]
    open: list[str]


def write_export(correction: Correction, to: str, out: Path, request: Request) -> ExportedCalibration:
    """Write a correction for another program; see `trihedron.export_calibration`."""
    if to not in TARGETS:
        raise InputError(f"--to {to}: is not known; give one of {', '.join(TARGETS)}")
    if not NAME.fullmatch(request.name):
        raise InputError(f"--name {request.name}: must be a name of C: letters, digits, underscores, a letter first")
    model = Model.of(correction)
    written = FORMATS[to](model, request)
    places = _places(out, written.contents)
    for path, content in places.items():
        with whole_file(path) as draft:
            draft.write_bytes(content)
    return ExportedCalibration(
        to=to,
        files=[str(path) for path in places],
        equation=list(written.equation),
        gravity_mps2=model.gravity,
        verdict=model.verdict,
        lost=list(written.lost),
        open=list(model.open),
    )


def _places(out: Path, contents: Mapping[str, bytes]) -> dict[Path, bytes]:
    """Return the contents by their files: `out`, and beside it NAME-gyros for the part of that name."""
    places = {}
    for part, content in contents.items():
        places[out.with_name(f"{out.stem}-{part}{out.suffix}") if part else out] = content
    return places


def noise_request(path: Path) -> Request:
    """Return the request with the densities and the rate of a result of `trihedron noise`.

    Each density is the largest of the three axes; where none is determined its upper limit is taken, with a note.
    """
    needed = "the file of `trihedron noise --json` is needed"
    try:
        content = json.loads(bytes_of(path).decode("utf-8"))
        if content["schema"] != "trihedron.noise/1":
            raise InputError(f"--noise {path}: the schema is {content['schema']!r}; {needed}")
        densities, notes = [], []
        for sensor, coefficient in (("f", "N"), ("f", "K"), ("w", "N"), ("w", "K")):
            channels = [
                channel for channel in content["channels"] if channel["name"] in (f"{sensor}{p}" for p in "123")
            ]
            largest, is_limit = _largest_of(channels, coefficient)
            if largest is None:
                raise InputError(
                    f"--noise {path}: has no {coefficient} of {sensor}1, {sensor}2, {sensor}3; measure longer"
                )
            if is_limit:
                notes.append(f"{coefficient} of the {'gyros' if sensor == 'w' else 'accelerometers'} is an upper limit")
            densities.append(largest)
        first, second, third, fourth = densities
        return Request((first, second, third, fourth), float(content["rate_hz"]), notes=tuple(notes))
    except (ValueError, KeyError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"--noise {path}: is not as its schema says; {needed}") from error


def _largest_of(channels: Sequence[Mapping[str, Any]], coefficient: str) -> tuple[float | None, bool]:
    """Return the largest coefficient of some channels, and whether it is an upper limit; None where one is missing."""
    values = []
    for channel in channels:
        entry = channel["coefficients"].get(coefficient) or {}
        if "estimate" in entry:
            values.append((float(entry["estimate"]), False))
        elif "upper" in entry:
            values.append((float(entry["upper"]), True))
    if len(values) < 3 or len(values) < len(channels):
        return None, False
    return max(values)
