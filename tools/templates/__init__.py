"""Files to fill in or go on from: scenario, records with their columns explained, mountings, a notebook."""

import json
from collections.abc import Callable
from importlib import resources
from math import degrees
from pathlib import Path
from typing import Literal, get_args

from numpy import arange

from ..calibration.calibration import checked_noise_bound
from ..errors import InputError, nearest
from ..files import write_text
from ..planning.positions import stored_counts, stored_positions
from ..planning.tour import separated
from ..records import StrapdownRecord, read_record
from ..records.columns import POSITION, RAW, STRAPDOWN_RATES

Template = Literal["scenario", "record", "raw-record", "strapdown-record", "mounting"]
TEMPLATES: tuple[str, ...] = get_args(Template)
"""Kinds of files that `new` makes; a "record" is a position record."""
POSITIONS = 12
"""Positions of a template where nothing else is asked for."""

ABOUT = {
    "position": "counts the positions in the order of measurement, from 1",
    "time_s": "s, grows from row to row",
    "alpha_deg": "encoder reading of the outer axis, degrees",
    "beta_deg": "encoder reading of the inner axis, degrees",
    "f1_mps2": "readings of the three accelerometers, m/s2; a level block reads (0, 0, +g)",
    "w1_radps": "readings of the three gyros, rad/s",
}


def new(kind: str, path: str | Path | None = None, *, positions: int = POSITIONS) -> list[Path]:
    """Write a file to fill in; `trihedron.new` says more. Of a scenario its position programme is written too."""
    if kind not in TEMPLATES:
        raise InputError(f"new {kind}: there is no such template; {nearest(kind, TEMPLATES)}")
    ending = ".toml" if kind in ("scenario", "mounting") else ".csv"
    target = Path(path) if path is not None else Path(f"{kind}{ending}")
    if target.suffix.lower() != ending:
        raise InputError(f"{target}: a {kind} is a {ending} file; give a name that ends so")
    if '"' in target.stem or "\\" in target.stem:
        raise InputError(f"{target}: a quote or a backslash cannot stand in the name of a template")
    files = {target: _text(kind, target.stem, positions)}
    if kind == "scenario":
        files[target.with_name(f"{target.stem}-positions.csv")] = _programme(positions)
    for file in files:
        if file.exists() or file.is_symlink():
            raise InputError(f"{file}: is there already; give another name")
    for file, text in files.items():
        write_text(file, text)
    return list(files)


def _text(kind: str, name: str, positions: int) -> str:
    if kind in ("scenario", "mounting"):
        text = resources.files("trihedron.tools.templates").joinpath(f"{kind}.toml").read_text(encoding="utf-8")
        return text.format(name=name)
    makers: dict[str, Callable[[], str]] = {
        "record": lambda: _position_record(name, positions),
        "raw-record": lambda: _series(RAW.required, "a row for each sample, the moves of the table included", name),
        "strapdown-record": lambda: _series(STRAPDOWN_RATES.required, "a row for each sample", name),
    }
    return makers[kind]()


def _angles(positions: int) -> list[tuple[float, float]]:
    places = stored_positions(positions)
    if places is None:
        counts = stored_counts()
        raise InputError(
            f"--positions {positions}: there is no plan of so many; there are plans of {counts[0]} to {counts[-1]}"
        )
    programme = places.angle[separated(arange(len(places)), places.angle)]
    return [(round(degrees(alpha), 4), round(degrees(beta), 4)) for alpha, beta in programme.tolist()]


def _programme(positions: int) -> str:
    rows = [f"{alpha:g},{beta:g}" for alpha, beta in _angles(positions)]
    heading = "# Where the table goes, in this order; a column dwell_s may give each position its own time."
    return "\n".join([heading, "alpha_deg,beta_deg", *rows, ""])


def _about(names: tuple[str, ...], what: str, name: str) -> list[str]:
    lines = [f"# {what}. `trihedron check {name}.csv` says what is not filled in yet."]
    for column in names:
        if column in ABOUT:
            lines.append(f"# {column}: {ABOUT[column]}")
    return lines


def _position_record(name: str, positions: int) -> str:
    lines = _about(POSITION.required, "A row for each rest of the table: fill in the angles that were set, too", name)
    lines += ["# Where known, more columns: temperature_degC; approach_alpha, approach_beta (+1 or -1); mounting."]
    lines.append(",".join(POSITION.required))
    lines += [f"{k},,{alpha:g},{beta:g},,," for k, (alpha, beta) in enumerate(_angles(positions), start=1)]
    return "\n".join([*lines, ""])


def _series(names: tuple[str, ...], what: str, name: str) -> str:
    row = "," * (len(names) - 1)
    further = "# Where known, more columns: temperature_degC"
    if "w1_radps" in names:
        further += "; q0, q1, q2, q3"
    heading = _about(names, what[0].upper() + what[1:], name)
    return "\n".join([*heading, further + ".", ",".join(names), f"0.00{row}", ""])


# A notebook with the calls that calibrate and diagnose a record

OF_POSITIONS = (
    ("Each number with its guaranteed interval.", "calibration = th.calibrate(record{bound})\ncalibration"),
    ("Residuals, in units of the noise bound.", 'calibration.figure("residuals")'),
    ("One number: what the readings leave possible, and the equation that corrects.", 'calibration["X16"]'),
    (
        "Whether the simulation can be true of the record; if not, what it lacks.",
        "found = th.diagnose(record{bound})\nfound",
    ),
    ("Every picture of the page, by its name.", "figures = found.figures()\nlist(figures)"),
    ("The pages, to hand on.", 'calibration.report("calibration.html")\nfound.report("diagnosis.html")'),
)
OF_MOTION = (
    ("Rests, moves and noise.", "th.inspect(record)"),
    ("Whether the simulation can be true of the record; if not, what it lacks.", "found = th.diagnose(record)\nfound"),
    ("Every picture of the page, by its name.", "figures = found.figures()\nlist(figures)"),
    ("The attitude by the gyros.", "th.attitude(record)"),
    ("The page, to hand on.", 'found.report("diagnosis.html")'),
)


def export_notebook(record: Path, out: Path | None = None, *, noise_bound: float | None = None) -> Path:
    """Write the notebook of a record; `trihedron.export_notebook` says more."""
    target = Path(f"{record.name.split('.')[0]}.ipynb") if out is None else out
    if target.suffix.lower() != ".ipynb":
        raise InputError(f"{target}: a notebook is an .ipynb file; give a name that ends so")
    if target.exists() or target.is_symlink():
        raise InputError(f"{target}: is there already; give another name")
    run = read_record(record)
    strapdown = isinstance(run, StrapdownRecord)
    if strapdown and noise_bound is not None:
        raise InputError(f"--noise-bound {noise_bound:g}: is of a record of a table; a strapdown record tells its own")
    said = str(run).removeprefix(f"{record}: ")
    bound = "" if noise_bound is None else f", noise_bound={checked_noise_bound(noise_bound)!r}"
    cells = [
        _cell(0, "markdown", f"# {record.name}\n\nMade by `trihedron export-notebook`; {said}."),
        _cell(1, "code", f"import trihedron as th\n\nrecord = th.read_record({str(record)!r})\nrecord.to_polars()"),
    ]
    for text, call in OF_MOTION if strapdown else OF_POSITIONS:
        cells += [_cell(len(cells), "markdown", text), _cell(len(cells) + 1, "code", call.replace("{bound}", bound))]
    notebook = {
        "cells": cells,
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    write_text(target, json.dumps(notebook, indent=1, ensure_ascii=False) + "\n")
    return target


def _cell(number: int, kind: str, text: str) -> dict[str, object]:
    made: dict[str, object] = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": text}
    return made | ({"execution_count": None, "outputs": []} if kind == "code" else {})
