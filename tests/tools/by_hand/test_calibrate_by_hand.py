"""`calibrate` without a table: accelerometers alone, moves from rest to rest, faces; open parameters and refusals."""

from itertools import product
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.optimize import lsq_linear

import trihedron as th
from by_hand import GRAVITY, NAMES, Instrument, present
from hand_sessions import FACES, directions, hand_moved, poses, truth
from trihedron.tools.motion.determinacy import slopes_of

SD = 4e-4


def normal_poses(seed: int, count: int) -> tuple[Instrument, pl.DataFrame]:
    rng = np.random.default_rng(seed)
    instrument = Instrument(seed)
    up = directions(rng, count)
    return instrument, poses(instrument, up, rng.normal(0.0, SD, (count, 3)))


def test_accelerometers_alone_have_their_true_values_within_the_guaranteed_ends() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        instrument = Instrument(seed)
        table = poses(instrument, directions(rng, 24), rng.uniform(-1e-3, 1e-3, (24, 3)))
        result = th.calibrate(table, noise_bound=1e-3, gravity=GRAVITY)
        assert result.verdict == "consistent"
        assert result.sigma.kind == "bound"
        for symbol in NAMES:
            parameter, value = result[symbol], truth(instrument)[symbol]
            assert present(parameter.low) <= value <= present(parameter.high), (seed, symbol)
            assert present(parameter.low) <= present(parameter.estimate) <= present(parameter.high)
            assert present(parameter.high) - present(parameter.low) < 0.03


@pytest.mark.acceptance
def test_standard_errors_of_accelerometers_alone_are_right() -> None:
    ratios = []
    for seed in range(60):
        instrument, table = normal_poses(seed, 20)
        result = th.calibrate(table, noise_sd=SD, gravity=GRAVITY)
        for symbol in NAMES:
            ratios.append(
                (present(result[symbol].estimate) - truth(instrument)[symbol]) / present(result[symbol].standard_error)
            )
    # Nine parameters of 60 sessions: their rms is known to 5 %.
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.12)


def test_three_spare_readings_tell_that_the_model_does_not_explain_them() -> None:
    """Twelve faces and edges of accelerometers whose range ends below 1 g."""
    instrument = Instrument(4)
    edges = [[0, 1, 1], [0, -1, 1], [1, 0, 1], [1, 0, -1], [1, 1, 0], [-1, 1, 0]]
    up = np.vstack([np.eye(3), -np.eye(3), np.array(edges) / np.sqrt(2.0)])
    table = poses(instrument, up, np.zeros((12, 3)))
    names = [f"f{axis}_mps2" for axis in (1, 2, 3)]
    result = th.calibrate(table.with_columns(pl.col(*names).clip(-9.5, 9.5)), gravity=GRAVITY)
    assert any("or the model does not explain everything" in line for line in result.warnings)
    for symbol in NAMES:
        p = result[symbol]
        assert abs(present(p.estimate) - truth(instrument)[symbol]) < 4.0 * present(p.standard_error), symbol
    assert th.calibrate(table, gravity=GRAVITY).warnings == []
    # Nine poses test nothing.
    nine = table[[*range(6), 6, 8, 10]]
    assert any("no rest is beside the parameters" in line for line in th.calibrate(nine, gravity=GRAVITY).warnings)
    assert th.calibrate(nine, gravity=GRAVITY, noise_bound=1e-3).warnings == []


@pytest.mark.first(1)
@pytest.mark.parametrize("noise", [3e-4, 2e-3])
@pytest.mark.parametrize("count", [9, 10, 12, 18])
def test_standard_errors_hold_a_noise_that_only_the_norms_tell(noise: float, count: int) -> None:
    """Nine poses have no reading beside the parameters: each noise that averaged readings have is possible."""
    ratios, worst = [], []
    for seed in range(8):
        rng = np.random.default_rng([seed, count])
        instrument, drawn = Instrument(seed), [directions(rng, count) for _ in range(60)]
        up = max(drawn, key=lambda up: float(np.linalg.svd(slopes_of(up), compute_uv=False)[-1]))
        result = th.calibrate(poses(instrument, up, rng.normal(0.0, noise, (count, 3))), gravity=GRAVITY)
        known = truth(instrument)
        ratios.append([(present(p.estimate) - known[p.symbol]) / present(p.standard_error) for p in result.parameters])
        worst.append(present(result.by_hand).pose_error.worst)
        assert ("assumed" in result.sigma.basis) == (count == 9)
    assert np.sqrt(np.mean(np.square(ratios))) < 1.3
    assert np.abs(ratios).max() < 5.0
    assert count < 12 or np.median(worst) < 5.0 * noise


@pytest.mark.acceptance
def test_a_move_in_which_rows_are_lost_is_named() -> None:
    """Half a second of one move is not in the record, and its stamps do not show it."""
    _, table = hand_moved(15)
    lost = pl.concat([table[:850], table[900:]]).with_columns(time_s=table["time_s"][: len(table) - 50])
    (line,) = [line for line in th.calibrate(lost, gravity=GRAVITY).warnings if "rows lost" in line]
    assert "the moves after 6" in line or "the moves after 7" in line, line
    assert not any("rows lost" in line for line in th.calibrate(table, gravity=GRAVITY).warnings)


@pytest.mark.acceptance
def test_nine_rests_whose_errors_nothing_tests_are_insufficient() -> None:
    """Readings err by 2 mg from rest to rest, seven times as much as is assumed; one more rest shows it."""
    for seed in (2, 5):
        result = th.calibrate(hand_moved(seed, 9, error=2e-3)[1], gravity=GRAVITY)
        assert result.verdict == "insufficient"
        assert any("nothing tests that a reading errs by" in line for line in result.warnings) or result.open
        assert th.calibrate(hand_moved(seed, 9)[1], gravity=GRAVITY, noise_sd=3e-4).verdict != "usable"
    for seed in (2, 3, 5):
        instrument, table = hand_moved(seed, 11, error=2e-3)
        result = th.calibrate(table, gravity=GRAVITY)
        for symbol in NAMES:
            p = result[symbol]
            assert abs(present(p.estimate) - truth(instrument)[symbol]) < 4.0 * present(p.standard_error), symbol


@pytest.mark.acceptance
def test_a_bias_of_a_gyro_that_drifts_is_named() -> None:
    instrument, table = hand_moved(4, 18)
    drift = 0.004 * pl.col("time_s") / float(table["time_s"][-1])
    result = th.calibrate(table.with_columns(pl.col("w2_radps") + drift), gravity=GRAVITY)
    (line,) = [line for line in result.warnings if "the rates at rest drift over the record, of gyro 2 by" in line]
    assert line.count("gyro") == 1
    error = present(result["B2"].standard_error)
    assert abs(present(result["B2"].estimate) - truth(instrument)["B2"] - 0.002) < error < 0.003


@pytest.mark.acceptance
@pytest.mark.parametrize(("seed", "step"), [(1, 0.002), (2, 0.01)])
def test_a_bias_of_a_gyro_that_changes_is_named_and_its_error_holds_that(seed: int, step: float) -> None:
    instrument, table = hand_moved(seed, 18)
    late = pl.col("time_s") > 45.0
    result = th.calibrate(
        table.with_columns(pl.col("w1_radps") + pl.when(late).then(step).otherwise(0.0)), gravity=GRAVITY
    )
    (line,) = [line for line in result.warnings if "the rates at rest change before" in line]
    assert "of gyro 1 by" in line
    # Only the quieter half of the rests tells of the gyros.
    assert any(f"change before {begin}" in line for begin in (45, 50))
    error = present(result["B1"].standard_error)
    assert abs(present(result["B1"].estimate) - truth(instrument)["B1"]) < 3.0 * error
    assert error < step
    assert not any("rates at rest" in line for line in th.calibrate(table, gravity=GRAVITY).warnings)


@pytest.mark.acceptance
@pytest.mark.parametrize("step", [np.radians(1.0), 1e-3])
def test_steps_of_gyros_wider_than_their_noise_are_in_the_errors_of_biases(step: float) -> None:
    """At rest they read one number, which may be wrong by half a step."""
    instrument, table = hand_moved(3, 16)
    names = [f"w{axis}_radps" for axis in (1, 2, 3)]
    result = th.calibrate(table.with_columns((pl.col(*names) / step).round() * step), gravity=GRAVITY)
    for symbol in ("B1", "B2", "B3"):
        p = result[symbol]
        assert abs(present(p.estimate) - truth(instrument)[symbol]) < 3.0 * present(p.standard_error), symbol


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [15, 16])
def test_gyros_come_from_the_other_moves_where_rows_of_two_are_lost(seed: int) -> None:
    """Half a second of two moves is not in the record; in that of seed 16 one of them seems to be a cut."""
    instrument, table = hand_moved(seed)
    lost = pl.concat([table[:850], table[900:2850], table[2900:]]).with_columns(
        time_s=table["time_s"][: len(table) - 100]
    )
    result = th.calibrate(lost, gravity=GRAVITY)
    assert result.verdict == "usable"
    assert present(result.by_hand).moves == 11
    assert any("left out: are rows lost there" in line for line in result.warnings)
    for p in result.parameters:
        assert abs(present(p.estimate) - truth(instrument)[p.symbol]) < 4.0 * present(p.standard_error) + 1e-9, p.symbol


def test_few_moves_beside_wrong_ones_ask_for_the_turn_that_they_lack() -> None:
    """Of four moves one has lost rows."""
    _, table = hand_moved(15, 5)
    lost = pl.concat([table[:850], table[900:]]).with_columns(time_s=table["time_s"][: len(table) - 50])
    result = th.calibrate(lost, gravity=GRAVITY)
    assert result.verdict == "insufficient"
    assert any("left out: are rows lost there" in line for line in result.warnings)
    assert any("turns by 90° and more about axis" in entry.close_by for entry in result.open)


def test_readings_that_no_parameters_explain_are_falsified_and_have_estimates() -> None:
    _, table = normal_poses(3, 20)
    spoilt = table.with_columns(f1_mps2=pl.col("f1_mps2") + pl.Series([0.1] + [0.0] * 19))
    result = th.calibrate(spoilt, noise_bound=1e-4, gravity=GRAVITY)
    assert result.verdict == "falsified"
    assert present(result.stands_with_sigma) > 1e-4
    assert all(result[symbol].estimate is not None and result[symbol].low is None for symbol in NAMES)
    assert (
        th.calibrate(spoilt, noise_bound=1.01 * present(result.stands_with_sigma), gravity=GRAVITY).verdict
        == "consistent"
    )


def test_six_faces_leave_the_misalignments_open_and_three_edges_close_them() -> None:
    instrument = Instrument(5)
    rng = np.random.default_rng(5)
    up = np.vstack([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]] + rng.normal(0.0, 0.03, (6, 3))
    up = up / np.linalg.norm(up, axis=1)[:, None]
    table = poses(instrument, up, np.zeros((6, 3))).with_columns(face=pl.Series(FACES))
    result = th.calibrate(table, gravity=GRAVITY)
    assert result.verdict == "insufficient"
    assert {p.symbol for p in result.parameters if not p.determined} == {"gamma_21", "gamma_31", "gamma_32"}
    advised = [entry.close_by for entry in result.open]
    assert len(advised) == 3
    assert all("both at 45°" in pose for pose in advised)
    assert present(present(result.by_hand).case).rotation == pytest.approx(np.eye(3), abs=0.05)
    edges = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]]) / np.sqrt(2.0)
    result = th.calibrate(poses(instrument, np.vstack([up, edges]), np.zeros((9, 3))), gravity=GRAVITY)
    assert result.verdict == "usable"
    for symbol in NAMES:
        assert result[symbol].estimate == pytest.approx(truth(instrument)[symbol], abs=1e-3)


@pytest.mark.acceptance
def test_gyros_and_accelerometers_of_a_block_moved_by_hand() -> None:
    instrument, table = hand_moved(2)
    result = th.calibrate(table, gravity=GRAVITY)
    assert result.verdict == "usable"
    assert (present(result.by_hand).rests, present(result.by_hand).moves) == (14, 13)
    assert present(present(present(result.by_hand).gain).move_after) < 0.2 * present(
        present(present(result.by_hand).gain).move_before
    )
    for p in result.parameters:
        assert abs(present(p.estimate) - truth(instrument)[p.symbol]) < 4.0 * present(p.standard_error) + 1e-9, p.symbol
    assert "S11" not in result


@pytest.mark.acceptance
def test_sensitivity_to_gravity_is_taken_where_it_is_proven() -> None:
    instrument, table = hand_moved(4, 20, sensitivity=True)
    result = th.calibrate(table, gravity=GRAVITY)
    assert present(present(result.by_hand).sensitivity).taken
    assert result["S11"].estimate == pytest.approx(instrument.sensitivity[0, 0], abs=3e-4)


def test_a_series_without_noise_has_its_rests() -> None:
    force = np.repeat(GRAVITY * directions(np.random.default_rng(1), 12), 300, axis=0)
    columns = {f"f{axis + 1}_mps2": force[:, axis] for axis in range(3)}
    result = th.calibrate(pl.DataFrame({"time_s": 0.01 * np.arange(len(force)), **columns}), gravity=GRAVITY)
    assert present(result.by_hand).rests == 12
    assert all(abs(present(result[symbol].estimate)) < 1e-4 for symbol in NAMES)


def test_a_block_that_rests_in_two_poses_says_what_is_open() -> None:
    instrument = Instrument(8)
    table = poses(instrument, np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]), np.zeros((2, 3)))
    result = th.calibrate(table, gravity=GRAVITY)
    assert result.verdict == "insufficient"
    assert len(result.open) >= 5
    assert present(present(result.by_hand).pose_error).worst > 0.02


def test_one_line_refuses_options_of_a_table_and_columns_that_may_be_gyros(tmp_path: Path) -> None:
    _, table = normal_poses(1, 12)
    with pytest.raises(ValueError, match=r"convention: is of a record of a table"):
        th.calibrate(table, convention="A2")
    with pytest.raises(ValueError, match="2 faces are given for 12 rests"):
        th.calibrate(table, faces="+1,-1")
    with pytest.raises(ValueError, match="is not a face"):
        th.calibrate(table, faces=",".join(["up"] * 12))
    with pytest.raises(ValueError, match="alpha_deg"):
        th.calibrate(table.with_columns(alpha=pl.lit(0.0)))
    with pytest.raises(ValueError, match="rest_scatter"):
        th.calibrate(table, rest_scatter=3.0)
    with pytest.raises(ValueError, match="never changes"):
        th.calibrate(table.with_columns(f2_mps2=pl.lit(0.1)))
    _, moved = hand_moved(3, 6)
    with pytest.raises(ValueError, match="never changes"):
        th.calibrate(moved.drop("w1_radps", "w2_radps", "w3_radps").with_columns(f2_mps2=pl.lit(0.1)))


def test_the_covariance_of_the_json_predicts_the_error_of_a_pose() -> None:
    _, table = normal_poses(5, 16)
    result = th.calibrate(table, noise_sd=SD, gravity=GRAVITY)
    covariance = np.array(result.to_json()["by_hand"]["covariance"])
    errors = [float(present(result[symbol].standard_error)) for symbol in NAMES]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), errors, rtol=1e-12)
    # A pose along u reads A u + b. The norm of the corrected reading changes by each parameter as finite steps show.
    x = np.array([result[symbol].estimate for symbol in NAMES])
    up = np.array(present(present(result.by_hand).pose_error).direction)
    reading = affine(x)[0] @ up + affine(x)[1]
    slopes = []
    for step in 1e-6 * np.eye(9):
        sizes = [np.linalg.norm(np.linalg.solve(*_equation(x + sign * step, reading))) for sign in (1.0, -1.0)]
        slopes.append((sizes[0] - sizes[1]) / 2e-6)
    assert np.sqrt(np.array(slopes) @ covariance @ slopes) == pytest.approx(
        present(present(result.by_hand).pose_error).worst, rel=1e-6
    )


def affine(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix (3, 3) and the biases (3,) of nine parameters."""
    matrix = np.eye(3)
    matrix[np.tril_indices(3)] += x[:6]
    return matrix, x[6:]


def _equation(x: np.ndarray, reading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    matrix, bias = affine(x)
    return matrix, reading - bias


def ends_of_norms(x: np.ndarray, reading: np.ndarray, bound: float) -> np.ndarray:
    """Return the least and largest |f| (K, 2) of readings (K, 3) with errors within a bound, by nine parameters."""
    matrix = np.eye(3)
    matrix[np.tril_indices(3)] += x[:6]
    inverse = np.linalg.inv(matrix)
    corners = bound * np.array(list(product((-1.0, 1.0), repeat=3)))
    ends = []
    for row in reading - x[6:]:
        least = np.linalg.norm(inverse @ lsq_linear(inverse, np.zeros(3), (row - bound, row + bound)).x)
        ends.append((least, np.linalg.norm((row + corners) @ inverse.T, axis=1).max()))
    return np.array(ends)


@pytest.mark.first(1)
@pytest.mark.parametrize(("seed", "count"), [(6, 20), (4, 40), (13, 40), (2, 80), (26, 80)])
def test_estimates_with_a_bound_keep_every_reading_within_it_together(seed: int, count: int) -> None:
    """Every error is at its bound: least squares then leave more than it, and no parameter beyond its interval."""
    instrument, bound, rng = Instrument(seed), 1e-3, np.random.default_rng(seed)
    table = poses(instrument, directions(rng, count), rng.choice([-bound, bound], (count, 3)))
    result = th.calibrate(table, noise_bound=bound, gravity=GRAVITY)
    reading = np.column_stack([table[f"f{axis}_mps2"] for axis in (1, 2, 3)]) / GRAVITY
    estimate, plain = (np.array([getattr(result[s], of) for s in NAMES]) for of in ("estimate", "least_squares"))
    ends = ends_of_norms(plain, reading, bound)
    assert ends[:, 0].max() > 1.0 or ends[:, 1].min() < 1.0
    ends = ends_of_norms(estimate, reading, bound)
    assert ends[:, 0].max() <= 1.0 + 1e-8
    assert ends[:, 1].min() >= 1.0 - 1e-8
    known = truth(instrument)
    for symbol in NAMES:
        assert result[symbol].possible(present(result[symbol].estimate))
        assert result[symbol].possible(known[symbol])


def test_estimates_keep_readings_within_the_bound_where_the_solver_for_the_nearest_fails(monkeypatch) -> None:
    """The library's solver is patched, since no drawn record makes it fail."""

    def unsolved(*_: object) -> None:
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr("trihedron.tools.motion.possible.nnls", unsolved)
    instrument, bound, rng = Instrument(6), 1e-3, np.random.default_rng(6)
    table = poses(instrument, directions(rng, 20), rng.choice([-bound, bound], (20, 3)))
    result = th.calibrate(table, noise_bound=bound, gravity=GRAVITY)
    reading = np.column_stack([table[f"f{axis}_mps2"] for axis in (1, 2, 3)]) / GRAVITY
    ends = ends_of_norms(np.array([result[symbol].estimate for symbol in NAMES]), reading, bound)
    assert ends[:, 0].max() <= 1.0 + 1e-8
    assert ends[:, 1].min() >= 1.0 - 1e-8
