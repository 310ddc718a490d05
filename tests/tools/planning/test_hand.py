"""Plans by hand: predicted errors are those of calibrations, wanted errors are reached, measured poses count."""

from itertools import pairwise

import numpy as np
import pytest

import trihedron as th
from generator.carried import strapdown_record, true_motion
from trihedron.tools import cli
from trihedron.tools.motion.determinacy import Determinacy, slopes_of
from trihedron.tools.planning.hand import (
    MOVE_SD,
    OF_GYROS,
    TURN_PRIOR_SD,
    HandPlanRequest,
    PlannedTurn,
    TurnDeterminacy,
    plan_by_hand,
    turns_to,
)
from trihedron.tools.records import write_record


def turned(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation (3, 3) by an angle about an axis."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def carried_by(matrix: np.ndarray, turn: PlannedTurn, up: np.ndarray) -> np.ndarray:
    """Return the direction up (3,) behind a turn as gyros with I + M carry it, in many small steps."""
    steps = 2000
    rate = (np.eye(3) + matrix) @ turn.axis
    size = float(np.linalg.norm(rate))
    step = turned(rate / size, -size * turn.angle / steps)
    for _ in range(steps):
        up = step @ up
    return up


@pytest.mark.parametrize("seed", range(5))
def test_a_turn_ends_where_it_says_and_errors_of_gyros_move_its_end_as_predicted(seed):
    rng = np.random.default_rng(seed)
    up, target = rng.normal(size=(2, 3))
    up, target = up / np.linalg.norm(up), target / np.linalg.norm(target)
    for turn in [*turns_to(up, target), *turns_to(up, up), *turns_to(up, -up)]:
        np.testing.assert_allclose(carried_by(np.zeros((3, 3)), turn, up), turn.after, atol=1e-9)
        matrix = 1e-4 * rng.normal(size=(3, 3))
        moved = carried_by(matrix, turn, up) - turn.after
        # The same end by the covariance of one parameter set alone: its innovation is the moved end.
        direction = matrix.ravel() / np.linalg.norm(matrix)
        small = TurnDeterminacy(1e-6 * np.outer(direction, direction))
        after = small.with_turn(turn, 1.0)
        gain = 1e-6 - direction @ after.covariance @ direction
        noise = MOVE_SD**2 + 2.0
        size = np.linalg.norm(moved) / np.linalg.norm(matrix)
        assert gain == pytest.approx(1e-12 * size**2 / (noise + 1e-6 * size**2), rel=2e-3, abs=1e-18)


@pytest.mark.acceptance
def test_errors_of_gyros_fitted_over_the_moves_of_a_plan_are_the_predicted_ones():
    plan = plan_by_hand(HandPlanRequest(turn_accuracy="8arcmin"))
    turns, ups = [], [np.array(step.up) for step in plan.steps]
    for before, after in pairwise(ups):
        turns.append((before, turns_to(before, after)[0]))
    rng = np.random.default_rng(3)
    slopes = []
    for before, turn in turns:
        columns = []
        for element in range(9):
            change = np.zeros(9)
            change[element] = 1e-5
            columns.append((carried_by(change.reshape(3, 3), turn, before) - turn.after) / 1e-5)
        slopes.append(np.column_stack(columns))
    sd = np.hypot(MOVE_SD, np.sqrt(2.0) * plan.rest_sd)
    design = np.vstack([np.vstack(slopes) / sd, np.diag(1.0 / TURN_PRIOR_SD)])
    errors = []
    for _ in range(2000):
        truth = TURN_PRIOR_SD * rng.normal(size=9)
        noise = []
        for _, turn in turns:
            random = sd * rng.normal(size=3)
            noise.append(random - turn.after * (random @ turn.after))
        seen = np.vstack(slopes) @ truth + np.concatenate(noise)
        fitted = np.linalg.lstsq(design, np.concatenate([seen / sd, np.zeros(9)]), rcond=None)[0]
        errors.append(fitted - truth)
    predicted = [p.standard_error for p in plan.parameters if p.symbol in OF_GYROS]
    np.testing.assert_allclose(np.std(errors, axis=0), predicted, rtol=0.1)


def test_a_plan_reaches_what_is_wanted_and_its_poses_alone_do():
    plan = th.plan_hand(accuracy="0.7mg", turn_accuracy="9arcmin", targets=("bias_1=0.3mg", "M12=1.2mrad"))
    assert plan.pose_error <= 7e-4
    assert plan.turn_error <= np.radians(9.0 / 60.0)
    errors = {p.symbol: p for p in plan.parameters}
    assert errors["bias_1"].standard_error <= 3e-4
    assert errors["bias_1"].wanted == pytest.approx(3e-4)
    assert errors["M12"].standard_error <= 1.2e-3
    assert errors["M12"].wanted == pytest.approx(1.2e-3)
    ups = np.array([step.up for step in plan.steps])
    alone = Determinacy.of(slopes_of(ups), plan.rest_sd)
    assert alone.worst == pytest.approx(plan.pose_error, rel=1e-3)
    assert plan.minutes == pytest.approx(len(plan.steps) * (plan.steps[0].rest_s + 3.0) / 60.0)
    assert len(th.plan_hand(accuracy="5mg").steps) <= len(plan.steps)


def test_noise_makes_rests_longer():
    quiet, noisy = th.plan_hand(noise_density=1e-3), th.plan_hand(noise_density=6e-3)
    assert quiet.steps[0].rest_s == 3.0
    assert noisy.steps[0].rest_s > 10.0
    assert noisy.rest_sd < 4e-4


@pytest.mark.acceptance
def test_the_noise_of_a_result_counts(tmp_path):
    rng = np.random.default_rng(4)
    table = {"time_s": 0.01 * np.arange(20_000)}
    for axis in (1, 2, 3):
        table[f"w{axis}_radps"] = 1e-3 * rng.normal(size=20_000)
        table[f"f{axis}_mps2"] = 0.06 * rng.normal(size=20_000) + (9.81 if axis == 3 else 0.0)
    (tmp_path / "noise.json").write_text(th.noise(table).json_text(), encoding="utf-8")
    stated, given = th.plan_hand(noise_result=tmp_path / "noise.json"), th.plan_hand(noise_density=0.06 * 0.1)
    assert stated.rest_sd == pytest.approx(given.rest_sd, rel=0.02)
    assert abs(stated.steps[0].rest_s - given.steps[0].rest_s) <= 2.0


@pytest.mark.acceptance
def test_what_was_measured_counts(tmp_path):
    up = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], dtype=float)
    tilted = up + 0.15 * np.random.default_rng(2).normal(size=up.shape)
    record = strapdown_record(true_motion(tilted / np.linalg.norm(tilted, axis=1, keepdims=True)))
    write_record(record, tmp_path / "monday.csv")
    plan = th.plan_hand(measured=tmp_path / "monday.csv")
    assert 1 <= len(plan.steps) <= 4
    assert plan.measured == "monday.csv"
    assert "after the rests of monday.csv" in str(plan)
    whole = th.plan_hand(accuracy="300mg", measured=tmp_path / "monday.csv")
    assert whole.steps == []
    assert "Nothing is missing in monday.csv" in str(whole)


@pytest.mark.first(2)
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--accuracy 0.01mg", "out of reach by hand"),
        ("--accuracy 0mg", "--accuracy '0mg': must be a positive number"),
        ("--accuracy 3furlong", "alone or of mg, ug, g"),
        ("--target bias_4=1mg", "did you mean"),
        ("--target bias_1", "must say the wanted standard error"),
        ("--noise-density 0", "--noise-density 0"),
        ("--measured missing.csv", "missing.csv: no such file"),
    ],
)
def test_what_cannot_be_planned_is_said_in_one_line(words, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["plan", "hand", *words.split()]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert len(printed.splitlines()) == 1
