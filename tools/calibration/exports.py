"""Calibrations for other programs: files of an `affine` model in the form of each of `formats`, and the list of
losses."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, get_args

from pydantic import Field

from ..errors import InputError
from ..files import whole_file
from ..options import ExportTarget
from ..result import Result
from .affine import AffineModel, ExportRequest, stays_in_readings
from .correction import Correction
from .formats import FORMATS

TARGETS: tuple[str, ...] = get_args(ExportTarget)
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


def write_export(correction: Correction, to: str, out: Path, request: ExportRequest) -> ExportedCalibration:
    """Write a correction for another program; see `trihedron.export_calibration`."""
    if to not in TARGETS:
        raise InputError(f"--to {to}: is not known; give one of {', '.join(TARGETS)}")
    if not NAME.fullmatch(request.name):
        raise InputError(f"--name {request.name}: must be a name of C: letters, digits, underscores, a letter first")
    model = AffineModel.of(correction)
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
        lost=[*written.lost, *stays_in_readings(correction)],
        open=list(model.open),
    )


def _places(out: Path, contents: Mapping[str, bytes]) -> dict[Path, bytes]:
    """Return the contents by their files: `out`, and beside it NAME-gyros for the part of that name."""
    places = {}
    for part, content in contents.items():
        places[out.with_name(f"{out.stem}-{part}{out.suffix}") if part else out] = content
    return places
