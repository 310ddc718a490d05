"""Six faces and three turns against imucal, whose faces are exact: the same numbers within their errors."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from by_hand import GRAVITY, present
from field_files import field_file
from hand_sessions import FACES, PERIOD, ferraris
from trihedron.tools.calibrated import Calibration

SECTIONS = (*(f"{axis}_{side}" for axis in "xyz" for side in "pa"), "x_rot", "y_rot", "z_rot")


def of_imucal(parts: list[pl.DataFrame], rate: float, angle: float, gravity: float) -> dict[str, float]:
    """Return imucal's biases and scale errors of six faces and three turns [deg], by Trihedron's symbols."""
    imucal = pytest.importorskip("imucal", reason="imucal is not installed")
    regions = {}
    for name, part in zip(SECTIONS, parts, strict=True):
        regions[f"acc_{name}"] = part.select(pl.col("^f._mps2$")).to_numpy()
        regions[f"gyr_{name}"] = np.degrees(part.select(pl.col("^w._radps$")).to_numpy())
    sections = imucal.ferraris_calibration.FerrarisSignalRegions(**regions)
    method = imucal.FerrarisCalibration(grav=gravity, expected_angle=angle)
    info = method.compute(sections, rate, "m/s^2", "deg/s")
    matrix, gyro_matrix = info.K_a @ info.R_a, info.K_g @ info.R_g
    values = {}
    for axis in range(3):
        values[f"gamma_{axis + 1}{axis + 1}"] = matrix[axis, axis] - 1.0
        values[f"bias_{axis + 1}"] = info.b_a[axis] / gravity
        values[f"M{axis + 1}{axis + 1}"] = gyro_matrix[axis, axis] - 1.0
        values[f"B{axis + 1}"] = np.radians(info.b_g[axis])
    return values


def misses(result: Calibration, values: dict[str, float]) -> dict[str, float]:
    """Return the differences from imucal in standard errors."""
    ratios = {}
    for symbol, value in values.items():
        parameter = result[symbol]
        assert parameter.determined, symbol
        ratios[symbol] = (present(parameter.estimate) - value) / present(parameter.standard_error)
    return ratios


@pytest.mark.parametrize("seed", range(4))
def test_exact_faces_give_the_numbers_of_imucal(seed: int) -> None:
    _, table = ferraris(seed, 0.0)
    words = (*FACES, "1:360", "2:360", "3:360")
    parts = [table.filter(pl.col("part") == word) for word in words]
    ratios = misses(th.calibrate(table, gravity=GRAVITY), of_imucal(parts, 1.0 / PERIOD, 360.0, GRAVITY))
    assert max(map(abs, ratios.values())) < 3.0, ratios


def test_a_flip_between_two_faces_is_not_taken_for_a_whole_turn(tmp_path: Path) -> None:
    """In this session the block is flipped by 184 degrees about axis 1 before the turn about it."""
    record = tmp_path / "record.csv"
    answers = {"units.time": "102.4 Hz", "units.rate": "deg/s", "units.force": "m/s2"}
    th.import_record(field_file("ferraris_lab.csv", tmp_path), out=record, answers=answers)
    result = th.calibrate(record, gravity=GRAVITY, turns="1:-360,2:-360,3:-360")
    assert present(result.by_hand).turns == 3
