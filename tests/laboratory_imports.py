"""Imports of laboratories' files in tests: questions, refusals, and comparison with the clean record."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from laboratory_files import Bench, LabFile
from trihedron.tools.cli import main


def ideal_bench(count: int, period: float = 60.0) -> Bench:
    """Return readings of an ideal bench, each rest with its own angles; nine decimals."""
    k = np.arange(float(count))
    alpha, beta = (37.0 * k + 11.0) % 360.0, (101.0 * k + 7.0) % 360.0
    a, b = np.radians(alpha), np.radians(beta)
    force = 9.80665 * np.stack([np.sin(a) * np.sin(b), np.sin(a) * np.cos(b), np.cos(a)], axis=1)
    return Bench(period * k, alpha, beta, np.round(force, 9), np.full(count, 20.0))


def written(folder: Path, content: bytes | str, name: str = "lab.csv") -> Path:
    """Write a file of this content into the folder."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def imported(folder: Path, content: bytes | str, answers: dict[str, str] | None = None, **options: Any):
    """Import this content."""
    name = options.pop("name", "lab.csv")
    return th.import_record(written(folder, content, name), answers=answers, **options)


def refused(folder: Path, content: bytes | str, answers: dict[str, str] | None = None) -> str:
    """Return the line in which an import of this content is refused."""
    return questions_of(written(folder, content), answers)[1]


def questions_of(path: Path, answers: dict[str, str] | None = None) -> tuple[set[str], str]:
    """Return the keys that an import asks for, and the line with them."""
    with pytest.raises(th.InputError) as refusal:
        th.import_record(path, answers=answers)
    message = str(refusal.value)
    assert "\n" not in message
    return set(re.findall(r"--set '?([\w.]+)=", message)), message


def imported_as_asked(folder: Path, file: LabFile) -> tuple[Any, Any]:
    """Import a file with the requested answers, and read the record that it writes.

    Each missing fact is asked for, and no other, in the file's number of rounds.
    """
    path = written(folder, file.content, f"lab{file.suffix}")
    answers: dict[str, str] = {}
    for last in range(file.rounds if file.needs else 0):
        keys, message = questions_of(path, answers)
        assert keys <= set(file.needs), message
        answers |= {key: file.needs[key] for key in keys}
        assert (set(answers) == set(file.needs)) == (last == file.rounds - 1), message
    conversion = th.import_record(path, out=folder / "record.csv", answers=file.needs)
    record = th.read_record(folder / "record.csv")
    assert {key: record.about.get(key) for key in file.keeps} == file.keeps
    return conversion, record


def assert_clean(record: Any, bench: Bench, rows: Any = None, grain: float = 1e-8) -> None:
    """Assert that a record has the readings, angles and times between rests of these rows of a run."""
    rows = np.arange(len(bench.time)) if rows is None else np.array(rows)
    assert record.specific_force == pytest.approx(bench.force[rows], abs=grain)
    for angles, clean in ((record.alpha, bench.alpha), (record.beta, bench.beta)):
        assert np.abs((np.degrees(angles) - clean[rows] + 180.0) % 360.0 - 180.0).max() < 1e-6
    assert np.diff(record.time_s) == pytest.approx(np.diff(bench.time[rows]), abs=1e-3)


def import_proposed(path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the refusal of a file that is not a record; assert that it and `check` name the command that imports
    it."""
    command = f"trihedron import {path} --out RECORD.csv"
    assert command in str(th.check(path))
    assert main(["diagnose", str(path), "--noise-bound", "1e-5"]) == 2
    line = capsys.readouterr().err
    assert command in line
    assert line.count("\n") == 1
    return line
