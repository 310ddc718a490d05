"""Exchanged channels: every way is spotted, clean and beside an effect, and no right record is advised anything."""

import re

import numpy as np

from exchanged_records import WRONG, right_record, wrong_record
from trihedron.tools.calibration.exchanged import channels_advice
from trihedron.tools.calibration.model import Positions, parametrise
from trihedron.tools.records import PositionRecord
from trihedron.tools.records.channels import Channels

RIGHT = 300
LEAST_HIDDEN = 0.95


def advised(record: PositionRecord) -> str:
    at = Positions(record.alpha, record.beta, np.zeros(len(record), dtype=int))
    return channels_advice(record, record.specific_force / 9.80665, parametrise({"identity": np.eye(3)}), at)


def is_spotted(record: PositionRecord, matrix: np.ndarray) -> bool:
    """Whether the order that reads the record right is among those that are listed."""
    found = re.findall(r'--channels (?:"([^"]*)"|([^\s;)]+))', re.sub(r"--mounting[^;]*", "", advised(record)))
    listed = [Channels.given([quoted or plain]) for quoted, plain in found]
    orders = [one for one in listed if one.alpha == one.beta == 1 and not one.radians]
    return any(np.array_equal(one.of_accelerometers, matrix) for one in orders)


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
