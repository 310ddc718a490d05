"""The choice of an attitude algorithm: the motions it is made on, and who stands on the line."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from trihedron.tools.errors import InputError
from trihedron.tools.motion.attitude import algorithm_named, angle_between
from trihedron.tools.motion.choice import (
    Candidate,
    Choice,
    Course,
    choose_algorithm,
    cone,
    course_of_harmonics,
    course_of_record,
    harmonics_of,
    operations_on,
)
from trihedron.tools.motion.compare import Samples, read_increments, run_algorithm, sample_motion
from trihedron.tools.records import StrapdownRecord
from trihedron.tools.reports.choice import chart, lines

FEW = ("mean-rate", "two-sample-quaternion", "functional-iteration-4", "adaptive-degree")
SWING = {
    "psi_amplitude": [0.2, 0.001],
    "psi_frequency": [0.5, 11.0],
    "psi_phase": [0.3],
    "theta_amplitude": 0.1,
    "gamma_phase": [1.0],
}


@pytest.fixture(autouse=True)
def _few_algorithms(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trihedron.tools.motion.choice.ALGORITHMS", tuple(map(algorithm_named, FEW)))


def read_increments_of(course: Course, noise: float) -> np.ndarray:
    begun = Samples(course.period, course.increments, np.zeros((0, 3)))
    return read_increments(begun, np.zeros(9), np.zeros(3), 0.0, noise, 1)


def errors(found: Choice) -> dict[str, float]:
    return {one.algorithm: one.error or 0.0 for one in found.algorithms}


def test_a_motion_that_begins_turned_and_the_same_as_a_record_give_the_same_errors() -> None:
    rate, length = 200.0, 2.0
    known = errors(choose_algorithm(course_of_harmonics(harmonics_of(SWING), rate, length), "swing"))
    # The error of order four falls to a sixteenth at half the period; the attitude at the start is not one.
    finer = errors(choose_algorithm(course_of_harmonics(harmonics_of(SWING), 2.0 * rate, length), "finer"))
    assert known["two-sample-quaternion"] / finer["two-sample-quaternion"] == pytest.approx(16.0, rel=0.2)
    own = sample_motion(harmonics_of(SWING), 1.0 / (4.0 * rate), round(4.0 * rate * length))
    increments = np.vstack([np.zeros((1, 3)), own.increments])
    time = own.period * np.arange(len(increments))
    record = StrapdownRecord(time, None, increments, np.tile([0.0, 0.0, 9.8], (len(time), 1)))
    measured = errors(choose_algorithm(course_of_record(record, 4), "record"))
    for name in ("mean-rate", "two-sample-quaternion"):
        assert measured[name] == pytest.approx(known[name], rel=0.02)
    with pytest.raises(InputError, match="--rate-divisor 1: must be 2 or more"):
        course_of_record(record, 1)
    with pytest.raises(InputError, match="must have 6400 rows, 64 samples of --rate-divisor 100"):
        course_of_record(record, 100)


def test_quanta_and_noise_limit_all_alike() -> None:
    course = course_of_harmonics(cone(math.radians(1.0), 5.0), 200.0, 0.5)
    exact, noisy = (choose_algorithm(course, "cone", noise_bound=noise) for noise in (0.0, 1e-3))
    assert (exact.draws, noisy.draws) == (1, 16)
    assert min(errors(noisy).values()) > 100.0 * errors(exact)["adaptive-degree"]
    # The noise of a sample is within 1e-3 rad/s · 5 ms, one by one at random.
    assert errors(noisy)["two-sample-quaternion"] < 5.0 * 1e-3 / 200.0 * math.sqrt(200.0)


def test_the_adaptive_algorithm_is_cheap_where_noise_hides_what_cheap_ones_leave_out() -> None:
    course = course_of_harmonics(harmonics_of(SWING | {"psi_amplitude": 0.2}), 400.0, 2.0)
    adaptive, best = map(algorithm_named, ("adaptive-degree", "functional-iteration-8"))
    exact, noisy = (read_increments_of(course, noise) for noise in (0.0, 1e-4))
    assert operations_on(adaptive, exact) > 1500.0
    assert operations_on(adaptive, noisy) < 250.0
    # What it leaves out is a small part of the random walk of the noise, within 1e-4 rad/s at each sample; exact it is
    # the best one.
    walk = 1e-4 / 400.0 * math.sqrt(len(exact) / 3.0)
    for increments, close in ((exact, 1e-14), (noisy, 0.05 * walk)):
        own, other = (run_algorithm(one, increments) for one in (adaptive, best))
        assert angle_between(own, other).max() < close


def test_the_line_holds_those_that_no_cheaper_one_betters() -> None:
    costs = {
        "dear": (90.0, 1.0),
        "cheap": (10.0, 5.0),
        "beaten": (20.0, 6.0),
        "good": (50.0, 1.1),
        "adaptive-degree": (60, 2.2),
    }
    rows = [Candidate(algorithm=name, order=4, samples=2, operations=o, error_rad=e) for name, (o, e) in costs.items()]
    rows.append(Candidate(algorithm="unable", order=4, samples=2, operations=1.0, error_rad=None))
    found = Choice(
        title="a, b", rate_hz=100.0, duration_s=1.0, quantum_rad=0.0, noise_radps=0.0, draws=1, algorithms=tuple(rows)
    )
    assert [one.algorithm for one in found.frontier] == ["cheap", "good", "dear"]
    assert found.enough.algorithm == "good"
    assert found.adaptive[1] == pytest.approx(2.0)
    assert found.to_polars()["on_frontier"].to_list() == [True, True, False, True, False, False]
    assert lines(found)[-1].endswith("for unable")
    assert chart([found]) == chart([found])


@pytest.mark.parametrize(
    ("motion", "options", "said"),
    [
        ("none", {}, "motion none: must be coning, slow, vibration, strong-vibration, a scenario"),
        ("coning", {"rate_hz": 1.0}, "must be 64 to 1000000 samples"),
        ("coning", {"noise_radps": math.nan}, "noise.radps nan: must be from 0 to 1"),
        ("scenarios/table-attitude.toml", {}, "must have one HarmonicMotion"),
        ("wrong.toml", {}, "psi_amplitud: must be up to 4 numbers of psi_amplitude"),
    ],
)
def test_what_is_no_motion_is_refused(motion: str, options: Any, said: str, tmp_path: Path) -> None:
    scenario = """schema = "trihedron.scenario/1"
[run]
stop_s = 1.0
step_s = 0.01
[fmus.motion]
component = "HarmonicMotion"
[fmus.motion.parameters]
psi_amplitud = [0.1]
"""
    (tmp_path / "wrong.toml").write_text(scenario, encoding="utf-8")
    file = tmp_path / motion if motion == "wrong.toml" else Path(__file__).parents[3] / motion
    with pytest.raises(InputError, match=said):
        th.choose(str(file) if motion.endswith(".toml") else motion, **options)
