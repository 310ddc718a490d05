"""A notebook with the calls that calibrate and diagnose a record, to go on from."""

import json
from pathlib import Path

from ..calibration.calibration import checked_noise_bound
from ..errors import InputError
from ..files import write_text
from ..records import StrapdownRecord, read_record

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
    ("The attitude by the gyros.", "th.attitude_of_record(record)"),
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
