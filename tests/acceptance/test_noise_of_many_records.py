# pyright: reportOptionalMemberAccess=false, reportOptionalOperand=false, reportOptionalSubscript=false
# pyright: reportOptionalIterable=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportReturnType=false
# None where a value must be fails the test.
"""Noise of many drawn records of an hour: right processes, coverage of the intervals, no process in white noise."""

import math

import numpy as np
import pytest

import trihedron as th
from generator.noise import static_record

pytestmark = pytest.mark.acceptance
STEP, ROWS, RECORDS = 0.02, 180_000, 35
DURATION = STEP * ROWS


def channels_of(sizes, seed: int):
    """Return the channels of a record whose six axes have the same processes, of size one."""
    return th.noise(static_record(ROWS, STEP, sizes, sizes | {}, seed)).channels


def right_and_inside(sizes, name: str) -> tuple[float, float, float]:
    """Return the parts of right sets, of sets with a process that is not there, and of intervals with the truth."""
    right, wrong, inside = [], [], []
    for seed in range(RECORDS):
        for channel in channels_of(sizes, 100 + seed):
            letters = channel.admissible[0].split(" + ")
            right.append(any(set(one.split(" + ")) == set(name.split(" + ")) for one in channel.admissible))
            wrong.append(not set(letters) <= set(sizes) and not right[-1])
            if channel.admissible[0] != name:
                continue
            for letter, size in sizes.items():
                one = channel.coefficient(letter)
                inside.append(one.low <= size <= one.high)
    return float(np.mean(right)), float(np.mean(wrong)), float(np.mean(inside))


@pytest.mark.parametrize(
    ("sizes", "name", "least"),
    [
        ({"N": 1.0, "B": 0.2}, "N + B", 0.95),
        ({"N": 1.0, "K": 0.03}, "N + K", 0.95),
        ({"N": 1.0, "Q": 0.18}, "N + Q", 0.95),
        ({"N": 1.0, "M": 0.46}, "N + M", 0.90),
    ],
)
def test_a_single_process_is_named_and_its_interval_holds_the_truth(sizes, name, least):
    right, wrong, inside = right_and_inside(sizes, name)
    print(name, right, wrong, inside)
    assert right >= least
    assert wrong <= 0.02
    assert 0.92 <= inside <= 0.98


def test_white_noise_has_no_other_process():
    named = 0
    for seed in range(RECORDS):
        named += sum(channel.admissible[0] != "N" for channel in channels_of({"N": 1.0}, 900 + seed))
    assert named <= 3


def test_coefficients_of_a_long_record_are_within_a_tenth():
    """The record is 100 times as long as the time at which the curve is flat."""
    errors = {"N": [], "K": []}
    walk = math.sqrt(3.0) * 100.0 / DURATION
    for seed in range(10):
        for channel in channels_of({"N": 1.0, "K": walk}, 500 + seed):
            for letter, truth in (("N", 1.0), ("K", walk)):
                one = channel.coefficient(letter)
                errors[letter].append((one.estimate or 0.0) / truth - 1.0)
    for letter, of_letter in errors.items():
        assert math.sqrt(np.mean(np.square(of_letter))) < 0.1, letter
