"""Motions with the same increments and different attitudes: no algorithm is near both.

An algorithm has one answer for both, so its two errors together are at least the angle between the truths. The true
attitudes here are in closed form or from increments 32 times as fine, by code of this file alone.
"""

import math

import numpy as np
import pytest

from attitude_motions import course_of_harmonics, operations_per_sample
from trihedron.models.attitude_algorithms import ALGORITHMS, Algorithm
from trihedron.tools.motion import algorithm_named, angle_between, run_algorithm
from trihedron.tools.papers import EXACT, paper_motion

FINER = 32
ADAPTIVE = algorithm_named("adaptive-degree")


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the product of quaternions (N, 4), scalar first."""
    scalar = p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(axis=1)
    return np.column_stack([scalar, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])])


def turned(vectors: np.ndarray) -> np.ndarray:
    """Return quaternions of rotation vectors (N, 3)."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.hstack([np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / math.pi) * vectors])


def round_a_cone(rate: float, phase: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return increments and attitudes of ω = rate (cos phase t, sin phase t, 0), t in samples: constant in a turning
    frame."""
    k = np.arange(count + 1.0)
    angle = rate / phase * np.column_stack([np.sin(phase * k), -np.cos(phase * k), 0.0 * k])
    k, none = k[1:], np.zeros(count)
    turned_frame = turned(np.column_stack([rate * k, none, phase * k]))
    return np.diff(angle, axis=0), product(turned_frame, turned(np.column_stack([none, none, -phase * k])))


def below_half_the_rate(increments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return increments and attitudes of the periodic motion with these increments, below half their rate."""
    count = len(increments)
    spectrum = np.fft.rfft(increments, axis=0)
    turn = 2j * math.pi * np.arange(1, len(spectrum)) / count
    spectrum[1:] *= ((np.exp(turn / FINER) - 1.0) / (np.exp(turn) - 1.0))[:, None]
    spectrum[0] /= FINER
    spectrum[-1] *= count % 2
    fine = np.fft.irfft(FINER * spectrum, FINER * count, axis=0)
    before = np.roll(fine, 1, axis=0)
    parts = turned(fine + np.cross(before, fine) / 12.0)
    while len(parts) > count:
        parts = product(parts[::2], parts[1::2])
    attitudes = [np.array([[1.0, 0.0, 0.0, 0.0]])]
    for part in parts:
        attitudes.append(product(attitudes[-1], part[None]))
    return fine.reshape(count, FINER, 3).sum(axis=1), np.vstack(attitudes[1:])


def error(algorithm: Algorithm, increments: np.ndarray, true: np.ndarray) -> float:
    computed = run_algorithm(algorithm, increments, renormalise=True)
    return float(angle_between(computed, true[algorithm.samples - 1 :: algorithm.samples][: len(computed)]).max())


def never_near_both(increments: np.ndarray, first: np.ndarray, second: np.ndarray) -> float:
    """Return the least multiple of the least errors that any algorithm must reach on one of two motions.

    The least errors are those of all algorithms that cost no more than the adaptive one. If an algorithm has at most b
    times the least error on both motions, b times their sum is at least the distance of the truths, at each eighth
    sample.
    """
    most = operations_per_sample(ADAPTIVE, increments)
    able = [algorithm for algorithm in ALGORITHMS if operations_per_sample(algorithm, increments) <= most]
    least = [min(error(algorithm, increments, true) for algorithm in able) for true in (first, second)]
    return float(angle_between(first, second)[7::8].max()) / sum(least)


@pytest.mark.acceptance
def test_no_algorithm_is_on_the_line_of_a_cone_and_of_its_alias() -> None:
    """Compare 420 and 580 Hz at 1 kHz: the same increments, and drifts of opposite sign."""
    phase, rate, count = 2.0 * math.pi * 0.42, 3e-3, 480
    alias = 2.0 * math.pi - phase
    increments, slow = round_a_cone(rate, phase, count)
    same, fast = round_a_cone(-rate * alias / phase, -alias, count)
    assert np.abs(increments - same).max() < 1e-12 * np.abs(increments).max()
    bound = never_near_both(increments, slow, fast)
    assert bound == pytest.approx(1.33, abs=0.02)
    errors = [error(ADAPTIVE, increments, true) for true in (slow, fast)]
    assert errors[0] < 0.12 * errors[1]


@pytest.mark.acceptance
def test_what_the_adaptive_algorithm_loses_on_vibration_above_half_the_rate_no_algorithm_keeps() -> None:
    """Compare the composition of 1 to 420 Hz at 500 Hz with the motion below 250 Hz that has its increments."""
    harmonics = np.array(paper_motion("second", EXACT)).reshape(3, -1, 3)
    harmonics[:, :, 2] += 0.5153 * harmonics[:, :, 1]
    course = course_of_harmonics(harmonics.reshape(-1), 500.0, 3.0)
    same, twin = below_half_the_rate(course.increments)
    assert np.abs(course.increments - same).max() < 1e-12
    bound = never_near_both(course.increments, course.attitudes, twin)
    assert bound > 1.3, bound
    mean_rate = algorithm_named("mean-rate")
    on_both = [
        [error(algorithm, same, true) for true in (course.attitudes, twin)] for algorithm in (ADAPTIVE, mean_rate)
    ]
    # Each is the best for its own motion, and as much worse on the other as it must be.
    assert on_both[0][0] < 1.1 * bound * on_both[1][0]
    assert on_both[1][1] > 20.0 * on_both[0][1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_noise_hides_may_be_a_motion(seed: int) -> None:
    """At rest, with noise, the cheapest formulas are as good; on a motion with the same increments they are not."""
    noise = np.random.default_rng(seed).uniform(-1e-3, 1e-3, (511, 3))
    same, motion = below_half_the_rate(noise)
    assert np.abs(noise - same).max() < 1e-15
    rest = np.tile([1.0, 0.0, 0.0, 0.0], (len(noise), 1))
    cheap = [algorithm_named(f"{number}-sample-coning") for number in ("three", "four", "five")]
    at_rest, moving = (error(ADAPTIVE, noise, true) for true in (rest, motion))
    for algorithm in cheap:
        assert operations_per_sample(algorithm, noise) < 40.0
        assert error(algorithm, noise, rest) < 1.1 * at_rest
        assert error(algorithm, noise, motion) > 2.5 * moving
