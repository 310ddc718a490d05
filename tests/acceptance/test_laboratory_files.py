"""Calibration and diagnosis of imported records are those of the clean record, in every dialect."""

from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from generator.positions import write_hidden_record
from laboratory_files import Bench, position_files
from trihedron.models.effects import EffectPlace
from trihedron.tools.records import PositionRecord, read_record

pytestmark = pytest.mark.acceptance


def test_verdict_radius_and_cause_are_those_of_the_clean_record(tmp_path: Path):
    write_hidden_record(tmp_path / "measured.csv", 7, EffectPlace("quadratic", "accelerometer-2"), (6e-4,))
    record = read_record(tmp_path / "measured.csv", PositionRecord)
    time, alpha, beta = np.round(record.time_s), *(np.round(np.degrees(a), 4) for a in (record.alpha, record.beta))
    bench = Bench(time, alpha, beta, record.specific_force, np.full(len(time), 20.0))
    number = np.arange(1, len(time) + 1)
    clean = PositionRecord(number, time, np.radians(alpha), np.radians(beta), record.specific_force)
    calibrated, diagnosed = th.calibrate(clean, noise_bound=1e-5), th.diagnose(clean, noise_bound=1e-5)
    files = [file for file in position_files(bench) if file.rows is None and file.grain < 1e-8]
    assert len(files) >= 40
    for file in files:
        path = tmp_path / f"lab{file.suffix}"
        path.write_bytes(file.content)
        imported = th.import_record(path, answers=file.needs).record
        result = th.calibrate(imported, noise_bound=1e-5)
        assert (result.verdict, result.radius) == (calibrated.verdict, pytest.approx(calibrated.radius, rel=1e-5)), (
            file.name
        )
        if file.name in ("German Windows", "sexagesimal", "volts"):
            again = th.diagnose(imported, noise_bound=1e-5)
            assert again.verdict == diagnosed.verdict == "explained"
            assert [cause.place for cause in again.causes] == [cause.place for cause in diagnosed.causes], file.name
