"""Lots of instruments, simulated: records in a folder and the table that names them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from generator.positions import Session
from generator.stands import Stand
from trihedron.tools.records import write_record

SIGMA = 1e-5
Sized = tuple[Any, tuple[float, ...]]
FIRST_SERIAL = 96


def serial_of(number: int) -> str:
    """Return the serial number of an instrument: their order passes 100, which texts sort wrongly."""
    return f"U-{FIRST_SERIAL + number}"


def write_lot(
    folder: Path,
    count: int,
    seed: int,
    *,
    hidden: Mapping[int, Sequence[Sized]] | None = None,
    changed: Callable[[int, Stand], Stand] = lambda _, stand: stand,
    positions: int = 30,
) -> Path:
    """Write records of a lot with effects hidden in some, and the table of its records; return the table.

    `changed` changes the stand of an instrument by its number.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    lines = ["file,serial,date,temperature_degC"]
    for number in range(count):
        stand = changed(number, Stand.drawn(rng))
        session = Session.planned(stand, *np.radians(np.round(rng.uniform(0.0, 360.0, (2, positions)), 1)))
        error = rng.uniform(-SIGMA, SIGMA, (positions, 3))
        record = replace(session.record((hidden or {}).get(number, ()), error), temperature=None)
        write_record(record, folder / f"record-{number}.csv")
        date = f"2026-{1 + number * 12 // count:02d}-{1 + number % 28:02d}"
        lines.append(f"record-{number}.csv,{serial_of(number)},{date},{rng.uniform(15.0, 30.0):.1f}")
    table = folder / "lot.csv"
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return table
