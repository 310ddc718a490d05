"""Six faces and three turns against imucal, whose faces are exact: the same numbers within their errors."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

import trihedron as th
from by_hand import GRAVITY, Instrument, present
from field_files import field_file
from hand_sessions import FACES, NOISE, PERIOD, ferraris, strapdown, turning
from trihedron.tools.calibrated import Calibration

UP = np.array([0.0, 0.0, 1.0])
MATRIX = tuple(f"M{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))
SECTIONS = (*(f"{axis}_{side}" for axis in "xyz" for side in "pa"), "x_rot", "y_rot", "z_rot")


def of_imucal(parts: list[pl.DataFrame], rate: float, angle: float, gravity: float) -> dict[str, float]:
    """Return imucal's biases and scale errors of six faces and three turns of an angle [deg], by our symbols."""
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


@dataclass(frozen=True)
class Session:
    """Rests on six exact faces, each twice, three turns by hand, the moves between: record, and imucal's parts."""

    instrument: Instrument
    table: pl.DataFrame
    parts: list[pl.DataFrame]

    @staticmethod
    def drawn(seed: int, over: Sequence[float]) -> "Session":
        """Draw a session whose turns are over a whole one by some angles (3,) [deg]."""
        rng = np.random.default_rng(seed)
        instrument = Instrument(seed)
        instrument.sensitivity = np.zeros((3, 3))
        ups = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
        faces = [Rotation.align_vectors([UP], [up])[0] for up in ups]
        sections = [turning([*faces, *faces], 2.0, 3.0)[1]]
        for axis, beyond in enumerate(over):
            sections.append(turning([sections[-1][-1], faces[2 * axis]], 2.0, 3.0)[1])
            share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 400))
            way = Rotation.from_rotvec(np.radians(360.0 + beyond) * share[:, None] * UP)
            sections.append(way * faces[2 * axis])
            sections.append(turning([sections[-1][-1]] * 2, 0.5, 3.0)[1])
        attitude = Rotation.concatenate(sections)
        table = strapdown(instrument, PERIOD * np.arange(len(attitude)), attitude, rng, NOISE)
        ends = np.cumsum([len(section) for section in sections])
        rests = [table[500 * number + 50 : 500 * number + 250] for number in range(6)]
        turns = [table[ends[k] : ends[k + 1]] for k in (1, 4, 7)]
        return Session(instrument, table, [*rests, *turns])


def angles_by(result: Calibration, turns: Sequence[pl.DataFrame], period: float) -> list[float]:
    """Return the angles of turns [deg] by calibrated gyros, independent of the program."""
    bias = np.array([present(result[f"B{axis}"].estimate) for axis in (1, 2, 3)])
    matrix = np.eye(3) + np.reshape([present(result[symbol].estimate) for symbol in MATRIX], (3, 3))
    angles = []
    for turn in turns:
        rate = turn.select(pl.col("^w._radps$")).to_numpy() - bias
        angles.append(float(np.degrees(np.linalg.norm(np.linalg.solve(matrix, period * rate.sum(axis=0))))))
    return angles


def of_imucal_by_angles(parts: list[pl.DataFrame], period: float, angles: Sequence[float]) -> dict[str, float]:
    """Return imucal's scale errors of the gyros where each turn has an angle of its own [deg]."""
    scales = {}
    for axis, angle in enumerate(angles, start=1):
        scales[f"M{axis}{axis}"] = of_imucal(parts, 1.0 / period, angle, GRAVITY)[f"M{axis}{axis}"]
    return scales


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", range(4))
def test_turns_by_hand_that_are_no_whole_ones_are_told_by_the_moves(seed: int) -> None:
    """imucal takes each turn as exactly 360 degrees; with the angles that we measure it gives our numbers."""
    over = np.random.default_rng(seed).uniform(1.5, 4.0, 3) * np.random.default_rng(seed + 50).choice([-1.0, 1.0], 3)
    session = Session.drawn(seed, over.tolist())
    result = th.calibrate(session.table, gravity=GRAVITY)
    angles = angles_by(result, session.parts[6:], PERIOD)
    np.testing.assert_allclose(angles, 360.0 + over, atol=0.2)
    whole = of_imucal_by_angles(session.parts, PERIOD, [360.0] * 3)
    measured = of_imucal_by_angles(session.parts, PERIOD, angles)
    for axis in range(3):
        symbol = f"M{axis + 1}{axis + 1}"
        ours, true = result[symbol], session.instrument.gyro_matrix[axis, axis] - 1.0
        assert abs(present(ours.estimate) - true) < 3.5 * present(ours.standard_error)
        assert whole[symbol] - true == pytest.approx(over[axis] / 360.0, rel=0.05)
        assert abs(measured[symbol] - present(ours.estimate)) < 3.0 * present(ours.standard_error)


@pytest.mark.acceptance
def test_a_real_session_differs_from_imucal_by_what_its_turns_miss(tmp_path: Path) -> None:
    """Rests and turns of the laboratory's session [s]; the turns are within a hand's two degrees of whole ones."""
    record = tmp_path / "record.csv"
    answers = {"units.time": "102.4 Hz", "units.rate": "deg/s", "units.force": "m/s2"}
    th.import_record(field_file("ferraris_lab.csv", tmp_path), out=record, answers=answers)
    table, period = pl.read_csv(record, comment_prefix="#"), 1.0 / 102.4
    spans = [(4.0, 13.0), (15.0, 24.0), (26.0, 33.5), (36.0, 41.5), (43.0, 49.5), (52.0, 59.0)]
    spans += [(64.97, 70.44), (77.76, 83.25), (88.72, 94.06)]
    parts = [table.filter(pl.col("time_s").is_between(*span)) for span in spans]
    result = th.calibrate(record, gravity=GRAVITY)
    angles = angles_by(result, parts[6:], period)
    np.testing.assert_allclose(angles, 360.0, atol=2.0)
    whole = of_imucal_by_angles(parts, period, [-360.0] * 3)
    measured = of_imucal_by_angles(parts, period, [-angle for angle in angles])
    off = misses(result, whole)
    assert max(map(abs, off.values())) > 2.0
    assert max(map(abs, misses(result, measured).values())) < 0.5


@pytest.mark.acceptance
def test_a_flip_between_two_faces_is_not_taken_for_a_whole_turn(tmp_path: Path) -> None:
    """In this session the block is flipped by 184 degrees about axis 1 before the turn about it."""
    record = tmp_path / "record.csv"
    answers = {"units.time": "102.4 Hz", "units.rate": "deg/s", "units.force": "m/s2"}
    th.import_record(field_file("ferraris_lab.csv", tmp_path), out=record, answers=answers)
    result = th.calibrate(record, gravity=GRAVITY, turns="1:-360,2:-360,3:-360")
    assert present(result.by_hand).turns == 3
