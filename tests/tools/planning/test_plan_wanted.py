"""Positions for what is wanted: a correction's error, what is measured already, limits."""

from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from generator.stands import random_bench, simulated
from planning_tasks import known_optima, planned, stored, tables_task
from trihedron.models.bench import nominal_input
from trihedron.tools.calibration import calibrate
from trihedron.tools.errors import InputError
from trihedron.tools.planning import positions
from trihedron.tools.planning.check import read_angles
from trihedron.tools.planning.common import common_positions
from trihedron.tools.planning.positions import Places, costs
from trihedron.tools.planning.request import FACES, Request
from trihedron.tools.planning.wanted import fewest_positions
from trihedron.tools.records import write_record

SIGMA = 1e-5
LEVEL = tuple(dict.fromkeys(symbol for face in FACES for symbol in face))


def levelling_error(errors) -> float:
    return max(float(np.hypot(errors[one], errors[other])) for one, other in FACES)


def record_at(angle: np.ndarray):
    rng = np.random.default_rng(3)
    noise = rng.uniform(-SIGMA, SIGMA, (len(angle), 3))
    return simulated(random_bench(rng), angle[:, 0], angle[:, 1], noise)


def angles(plan) -> np.ndarray:
    return np.radians([(one.alpha_deg, one.beta_deg) for one in plan.positions])


def test_a_set_for_levelling_keeps_its_promise_and_is_better_for_it_than_one_for_all_targets():
    symbols = LEVEL
    with mock.patch.object(positions, "_optima", return_value=(np.full(len(symbols), 2.05), np.zeros((0, 2)))):
        plan = common_positions(9, Request(goal="levelling", admissible="tables", starts=1, cuts=0))
        task = positions.task_of(Request(goal="levelling", admissible="tables"))
    assert plan.levelling_error == pytest.approx(levelling_error(plan.costs), rel=1e-12)
    own, other = (
        max((costs(task, at).ratio * task.best).tolist())
        for at in (Places(angles(plan), np.zeros(9, dtype=int)), stored(9))
    )
    assert own == pytest.approx(max(plan.costs.values()), rel=1e-6)
    assert own < other
    found = calibrate(record_at(angles(plan)), noise_bound=SIGMA, targets=symbols)
    errors = {one.symbol: (one.guaranteed_error or np.inf) / SIGMA for one in found.parameters if one.symbol in symbols}
    assert set(errors) == set(symbols)
    for symbol, error in errors.items():
        # Readings whose sign is not certain before are used too, and derivatives are those at the fit.
        assert 0.9 * plan.costs[symbol] < error < 1.02 * plan.costs[symbol]
    assert plan.to_json()["levelling_error"] == plan.levelling_error


def test_the_fewest_positions_that_keep_a_wanted_error_or_that_none_do():
    symbols = LEVEL
    request = Request(goal="gyrocompass", latitude_deg=-45.0, admissible="tables", starts=1, cuts=0, noise_bound=2e-5)
    with mock.patch.object(positions, "_optima", return_value=(np.full(len(symbols), 2.0), np.zeros((0, 2)))):
        plan = fewest_positions(replace(request, accuracy="100urad"))
        with pytest.raises(InputError, match=r"--accuracy 11arcsec: no positions, however many, .* than 11\.66 arcsec"):
            fewest_positions(replace(request, accuracy="11arcsec"))
    assert plan.accuracy_kept is not None
    assert plan.accuracy is not None
    assert plan.azimuth_error == pytest.approx(plan.levelling_error)
    assert plan.azimuth_error == pytest.approx(plan.accuracy_kept / 2e-5)
    assert plan.accuracy == pytest.approx(100e-6)
    assert plan.accuracy_kept <= plan.accuracy
    assert plan.fewer_keep is not None
    assert plan.fewer_keep > 100e-6
    assert replace(request, latitude_deg=60.0).magnified == pytest.approx(np.sqrt(3.0))


@pytest.mark.parametrize("text", ["7", "7 arcsec", "20ug", "5ppm", "1e-5"])
def test_an_accuracy_is_read_with_its_unit(text: str):
    known = {"7": 7e5, "7 arcsec": 7e5 * np.pi / 648000.0, "20ug": 2.0, "5ppm": 0.5, "1e-5": 1.0}
    assert Request(accuracy=text).wanted == pytest.approx(known[text])


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"goal": "gyrocompass", "latitude_deg": 50.0, "accuracy": "45ug"}, "one of rad; write it in arcsec or urad"),
        ({"targets": ("X16",), "accuracy": "45ppm"}, "one of g; write it in ug"),
        ({"targets": ("X4",), "accuracy": "45urad"}, "one of 1; write it in ppm"),
    ],
)
def test_an_accuracy_in_units_of_something_else_is_refused(asked: dict, said: str):
    with pytest.raises(InputError, match=said):
        fewest_positions(Request(starts=1, cuts=0, **asked))


@pytest.mark.parametrize("text", ["", "arcsec", "7 minutes", "-1", "nan", "0", "inf"])
def test_what_is_no_accuracy_is_refused(text: str):
    with pytest.raises(InputError, match=r"--accuracy .*: must be a positive number, alone or of arcsec"):
        _ = Request(accuracy=text).wanted
    with pytest.raises(InputError, match="--accuracy: the targets have units 1, g, rad"), known_optima():
        fewest_positions(Request(accuracy="1e-5", admissible="tables"))


def test_what_is_measured_already_counts_and_stays(tmp_path: Path):
    known = stored(8)
    write_record(record_at(known.angle), tmp_path / "known.csv")
    request = Request(admissible="tables", measured=tmp_path / "known.csv", starts=1, cuts=0)
    plan = planned(3, request)
    assert len(plan.positions) == 3
    assert plan.to_json()["measured"] == 8
    task, new = tables_task(), Places(angles(plan), np.zeros(3, dtype=int))
    together = costs(task, new.joined(known)).ratio * task.best
    np.testing.assert_allclose(together, list(plan.costs.values()), rtol=1e-6)
    assert plan.worst_ratio < costs(task, known).worst - 0.005
    with pytest.raises(InputError, match="--detect: does not go with --measured"):
        planned(3, Request(admissible="tables", measured=tmp_path / "known.csv", detect=("quadratic",)))


def test_a_cone_of_tilt_is_a_limit_of_alpha_and_is_kept():
    """A hexapod: the plate's normal leans by at most 40° from the vertical, to any side."""
    with pytest.raises(InputError, match="determine X15;"):
        tables_task(keep_out=("alpha:40:320",), admissible="paper")
    symbols = ("X14", "X18")
    with mock.patch.object(positions, "_optima", return_value=(np.array([2.0, 1.0]), np.zeros((0, 2)))):
        plan = common_positions(5, Request(keep_out=("alpha:40:320",), targets=symbols, starts=3, cuts=0))
    at = angles(plan)
    up = nominal_input(at[:, 0], at[:, 1], np.eye(3))
    assert (up[:, 2] >= np.cos(np.radians(40.0)) - 1e-9).all()
    # To more than one side.
    assert np.ptp(np.arctan2(up[:, 0], up[:, 1])) > 1.0


def test_a_search_for_a_level_makes_its_own_error_small_not_the_largest_single_one():
    symbols = LEVEL
    with mock.patch.object(positions, "_optima", return_value=(np.full(len(symbols), 2.05), np.zeros((0, 2)))):
        request = Request(goal="levelling", starts=2, cuts=0)
        own = common_positions(8, request)
        single = common_positions(8, replace(request, goal=None, targets=symbols))
    assert own.levelling_error is not None
    assert own.levelling_error < 0.97 * levelling_error(single.costs)


def test_a_table_with_limited_angles_says_what_it_cannot_determine():
    limits = ("alpha:30:330", "beta:30:330")
    with pytest.raises(InputError, match=r"--keep-out: no positions .* determine X15; ask for others by --target"):
        tables_task(keep_out=limits, admissible="paper")
    # Of one axis alone, the inner one fast.
    with pytest.raises(InputError, match=r"determine X1, X2, X3, .*X16"):
        tables_task(keep_out=("beta:0.01:359.99",), admissible="paper")
    symbols = ("X14", "X18")
    with mock.patch.object(positions, "_optima", return_value=(np.array([2.0, 1.0]), np.zeros((0, 2)))):
        plan = common_positions(4, Request(keep_out=("beta:0.01:359.99",), targets=symbols, starts=2, cuts=0))
    assert plan.worst_ratio < 1.15
    assert np.abs([one.beta_deg for one in plan.positions]).max() <= 0.01 + 1e-9


def test_a_position_in_a_keep_out_is_refused_with_its_row(tmp_path: Path):
    file = tmp_path / "angles.csv"
    header = "planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg"
    file.write_text(f"{header}\n100,0,100,0.01\n90,-90,90,-90\n150,10,150,20\n", encoding="utf-8")
    assert len(read_angles(file, ("alpha:100:150", "beta:271:359"))[0]) == 3
    with pytest.raises(InputError, match=r"row 3.*, column 'planned_beta_deg': -90 is inside --keep-out beta:260:300"):
        read_angles(file, ("beta:260:300",))
    with pytest.raises(InputError, match=r"row 4.*, column 'beta_deg': 20 is inside --keep-out beta:-345:-335"):
        read_angles(file, ("beta:-345:-335",))
