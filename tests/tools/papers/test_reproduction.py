"""The published errors of attitude algorithms are reproduced under the paper's conditions, and only under those.

Chelnokov, Perelyaev, Chelnokova 2016, Tables 1 to 3 and section 3.1.1. 240 of the 264 printed numbers are reproduced
within 5 % (99 of the 105 of Table 1 within 0.2 %). `trihedron.tools.papers.attitude` lists the others and the attempts.
"""

import csv
import json
import math
from collections import Counter

import numpy as np
import pytest

from trihedron.models.harmonic_motion import attitude_of_angles, move_harmonically
from trihedron.tools.errors import InputError
from trihedron.tools.motion import algorithm_named, run_algorithm, sample_motion
from trihedron.tools.papers import (
    CAUSES,
    EXACT,
    MOTIONS,
    PAPER,
    UNEXPLAINED,
    Conditions,
    Reproduction,
    angle_errors,
    paper_motion,
    published_rows,
    reproduce_attitude,
)
from trihedron.tools.reports import write_reproduction

QUICK = (8, 10, 12, 24, 32, 34, 39, 42, 56, 57)
"""Rows with steps of 10 ms and more: one algorithm of each family, and five of the nine causes."""


@pytest.fixture(scope="module")
def quick():
    return reproduce_attitude(QUICK)


def test_all_published_rows_are_there():
    rows = published_rows()
    assert [row.row for row in rows] == list(range(1, 89))
    assert Counter(row.table for row in rows) == {"1": 35, "3.1.1": 24, "2": 12, "3": 17}


@pytest.mark.acceptance
def test_rows_of_coarse_steps_come_out(quick):
    for row in quick.rows:
        # Printed to three or four digits; the ψ of row 57 and others of 3.1.1 to three.
        bound = 2e-3 if row.table == "1" else 6e-3
        assert np.abs(row.ratio - 1.0).max() < bound, row.title


@pytest.mark.acceptance
def test_leaving_a_cause_out_spoils_the_rows_that_show_it(quick):
    assert {effect.cause for effect in quick.effects} == {"other_frequencies", "series_cut", "nodes_as_run"}
    for effect in quick.effects:
        assert np.abs(effect.ratio - 1.0).max() < 6e-3
        assert np.abs(effect.ratio_without - 1.0).min() > 0.2


def test_causes_are_the_switches():
    assert {cause.switch for cause in CAUSES} == set(Conditions.__dataclass_fields__)
    assert PAPER.without("short_pi", "trapezoid", "not_normalised") == EXACT


def test_true_method_error_is_that_of_an_independent_computation():
    """Compute (22) at 100 Hz, h = 0.01 s, on variant 1: SciPy's rotations, Gauss-Legendre increments of twelve
    nodes."""
    from scipy.spatial.transform import Rotation

    harmonics = paper_motion("1", EXACT)
    period, count = 0.005, 400
    nodes, weights = np.polynomial.legendre.leggauss(12)

    def rate(t):
        angle, angle_rate, rates = [0.0] * 3, [0.0] * 3, [0.0] * 3
        move_harmonically(t, list(harmonics), angle, angle_rate, rates)
        return np.array(rates)

    increments = np.zeros((count, 3))
    for x, w in zip(nodes, weights, strict=True):
        for k in range(count):
            increments[k] += 0.5 * period * w * rate(period * (k + 0.5 + 0.5 * x))
    samples = sample_motion(harmonics, period, count)
    assert np.abs(samples.increments - increments).max() < 1e-16
    algorithm = algorithm_named("two-sample-rodrigues")
    attitudes = run_algorithm(algorithm, samples.increments)
    turned = Rotation.identity()
    for k in range(0, count, 2):
        a, b = increments[k], increments[k + 1]
        x = (0.25 + a @ a / 48) * a + (0.25 + b @ b / 48) * b + np.cross(a, b) / 6
        turned = turned * Rotation.from_mrp(x)
        assert abs(turned.as_quat(scalar_first=True) @ attitudes[k // 2]) > 1.0 - 1e-14
    true, work = [0.0] * 4, [0.0] * 4
    attitude_of_angles(list(samples.angles[-1]), true, work)
    euler = (Rotation.from_quat(true, scalar_first=True)).as_euler("YZX")
    assert euler == pytest.approx(samples.angles[-1], abs=1e-14)
    last = turned.as_euler("YZX") - euler
    history = angle_errors(attitudes[-1:], samples.angles_at_steps(algorithm)[-1:], True)
    assert np.abs(last) == pytest.approx(history, abs=1e-14)


def test_angles_beyond_half_a_turn_are_compared_around_the_circle():
    q = np.array([[math.cos(1.5707963), 0.0, math.sin(1.5707963), 0.0]])
    angles = np.array([[-math.pi + 1e-3, 0.0, 0.0]])
    assert angle_errors(q, angles, True)[0] == pytest.approx(1e-3, abs=1e-6)


def test_unknown_motion_is_refused():
    with pytest.raises(InputError, match="did you mean 'second'"):
        paper_motion("secnd", PAPER)
    assert len(MOTIONS) == 9


@pytest.mark.acceptance
def test_outputs_agree(quick, tmp_path):
    files = write_reproduction(quick, tmp_path / "out")
    assert [file.name for file in files] == ["attitude.csv", "attitude.svg"]
    table = list(csv.DictReader(files[0].read_text(encoding="utf-8").splitlines()))
    document = json.loads(quick.json_text())
    assert document["schema"] == "trihedron.attitude-reproduction/1"
    assert [float(line["ratio_psi"]) for line in table] == [row["ratio"][0] for row in document["rows"]]
    assert [int(line["row"]) for line in table] == list(QUICK)
    text = str(quick)
    assert "Table 1: 18 of 18 numbers within 0.2 %" in text
    assert Reproduction.model_validate_json(quick.json_text()).json_text() == quick.json_text()


@pytest.mark.acceptance
def test_all_published_rows():
    """Compare the scores with the reached ones; rows that are not reproduced are named."""
    result = reproduce_attitude()
    print(result)
    assert [(score.numbers, score.of) for score in result.scores] == [(99, 105), (63, 72), (76, 87)]
    unexplained = {row.row for row in result.rows if row.not_reproduced}
    assert unexplained == set().union(*(numbers for numbers, _ in UNEXPLAINED))
    for row in result.rows:
        assert bool(row.remark) == (row.row in unexplained)
    ratios = {row.row: row.ratio for row in result.rows}
    # The "instability" of ψ is reproduced to the printed digits with the amplitudes as typed.
    for number in (60, 61, 67, 71, 72, 73, 76, 79, 81, 84, 88):
        assert ratios[number][0] == pytest.approx(1.0, abs=5e-4)
    for effect in result.effects:
        if effect.cause == "short_pi":
            assert effect.ratio_without[0] < 3e-3
        elif effect.cause == "typed_amplitudes":
            assert effect.ratio_without[0] == pytest.approx(1.0037, abs=3e-4)
        else:
            assert np.abs(effect.ratio_without - 1.0).max() > 0.2
    # The printed 4e-7 degrees of (22) are the trapezoid rule's.
    assert result.rows[0].published_deg[0] / result.rows[0].method_error_deg[0] > 1000.0
