"""Exchanged channels: every way is detected, clean and beside an effect; correct records get no advice."""

import re
from dataclasses import replace

import numpy as np
import pytest

from generator.channels import GYRO_EFFECTS, WRONG, filmed_record, right_record, wrong_record
from trihedron.tools.calibration import Positions, channels_advice, parametrise
from trihedron.tools.motion import trust_of
from trihedron.tools.records import PERMUTATIONS, Channels, PositionRecord, StrapdownRecord, reading_of

pytestmark = pytest.mark.acceptance

RIGHT = 300
LEAST_HIDDEN = 0.95


def advised(record: PositionRecord) -> str:
    at = Positions(record.alpha, record.beta, np.zeros(len(record), dtype=int))
    return channels_advice(record, record.specific_force / 9.80665, parametrise({"identity": np.eye(3)}), at)


def is_spotted(record: PositionRecord, matrix: np.ndarray) -> bool:
    """Return True if the order that reads the record correctly is among the listed ones."""
    result = re.findall(r'--channels (?:"([^"]*)"|([^\s;)]+))', re.sub(r"--mounting[^;]*", "", advised(record)))
    listed = [Channels.given([quoted or plain]) for quoted, plain in result]
    orders = [entry for entry in listed if entry.alpha == entry.beta == 1 and not entry.radians]
    return any(np.array_equal(entry.of_accelerometers, matrix) for entry in orders)


def test_all_47_ways_are_spotted_twice_on_clean_records() -> None:
    cases = [(way, seed) for way in range(len(WRONG)) for seed in (0, 1)]
    assert [case for case in cases if not is_spotted(*wrong_record(*case, hidden=False))] == []


def test_nearly_all_ways_are_spotted_beside_an_effect() -> None:
    cases = [(way, seed) for way in range(len(WRONG)) for seed in range(4)]
    missed = [case for case in cases if not is_spotted(*wrong_record(*case, hidden=True))]
    print(f"missed beside an effect: {len(missed)} of {len(cases)}")
    assert len(missed) <= (1.0 - LEAST_HIDDEN) * len(cases)


def test_no_right_record_is_advised_anything() -> None:
    assert [seed for seed in range(RIGHT) if advised(right_record(seed))] == []


def is_mended(record: StrapdownRecord, matrix: np.ndarray) -> bool:
    """Return True if the first advice on gyros exchanged by a signed permutation is the order that reads them
    correctly."""
    assert record.rate is not None
    output = " ".join(trust_of(replace(record, rate=record.rate @ matrix.T)).faults)
    return f"read it with --channels w={','.join(map(str, reading_of(matrix)))}" in output


def test_all_47_ways_of_gyros_are_spotted_twice_beside_a_true_attitude() -> None:
    records = [filmed_record(seed) for seed in (0, 1)]
    ways = range(1, len(PERMUTATIONS))
    assert [
        (way, k) for k, record in enumerate(records) for way in ways if not is_mended(record, PERMUTATIONS[way])
    ] == []


def test_nearly_all_ways_of_gyros_are_spotted_beside_an_effect() -> None:
    """Test each of the 47 ways with two effects, which change from way to way."""
    records = [filmed_record(2 + k, effect) for k, effect in enumerate(GYRO_EFFECTS)]
    cases = [(way, (way + 3 * turn) % len(records)) for way in range(1, len(PERMUTATIONS)) for turn in (0, 1)]
    missed = [case for case in cases if not is_mended(records[case[1]], PERMUTATIONS[case[0]])]
    print(f"gyros missed beside an effect: {len(missed)} of {len(cases)}")
    assert len(missed) <= (1.0 - LEAST_HIDDEN) * len(cases)


def test_no_right_gyros_are_advised_anything() -> None:
    effects = ("", "", *GYRO_EFFECTS)
    observed = [(seed, trust_of(filmed_record(100 + seed, effects[seed % 10])).faults) for seed in range(RIGHT)]
    assert [(seed, output) for seed, output in observed if output] == []
