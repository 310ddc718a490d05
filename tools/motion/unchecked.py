"""State which of the unit, range setting, order and signs of a record's gyros its turns of gravity do not show."""

from dataclasses import replace

import numpy as np

from ...models.arrays import Floats
from ..memory import once
from ..records import StrapdownRecord
from ..records.channels import PERMUTATIONS, RADIANS, Channels, advice, reading_of
from .between_rests import FEWEST_MOVES, TELLING, moves_between, scales_by_rests
from .rests import FEWEST_ROWS, quiet_rests, rates_of, sampling_of
from .truth import truth_check
from .turning import WINDOW

SIZES = {1.0: "", RADIANS: "unit", 1.0 / RADIANS: "unit", 0.5: "range setting", 2.0: "range setting"}
"""Factors of the rates that are tried, and the fact that each denies."""
AXES = "order and signs"
FEWEST_WINDOWS = 4
LEAST_SHARE, CLEARER = 0.1, 25.0
"""One way of reading is better than another where it explains more of the turns of gravity, squared: at least the first
part of them, and by as many times the squared error of a window as the second."""
SHOWN, ABSURD = 0.5, 4.0
"""Way of reading is named that leaves less than the first part, or another unit where the present one adds more."""
Way = tuple[float, int]
"""A way of reading the gyros: a factor of the rates, and the number of a signed permutation."""


def unchecked_gyros(record: object) -> str:
    """Return a line on what nothing in a record shows of its gyros; "" if all is shown, or there are none."""
    if not isinstance(record, StrapdownRecord) or record.channels == Channels() or _is_checked(record):
        return ""
    shares, windows = _shares(record)
    present = (1.0, 0)

    def is_better(way: Way, other: Way) -> bool:
        gain = shares[other] - shares[way]
        return gain > LEAST_SHARE and 2.0 * windows * gain > CLEARER * shares[way]

    best = min(shares, key=lambda way: shares[way], default=present)
    # of ways that are as good, the one that changes least
    size, axes = min((way for way in shares if not is_better(best, way)), key=_changes, default=present)
    is_shown = bool(shares) and (shares[best] < SHOWN or (SIZES[size] == "unit" and shares[present] > ABSURD))
    if is_shown and is_better(best, present):
        channels = Channels(gyros=reading_of(PERMUTATIONS[axes].T), degrees=SIZES[size] == "unit")
        better = f"as if they were read with {advice([(channels, '')], record.channels)}"
        if SIZES[size] == "range setting":
            better = f"{size:g} times as far"
        return f"gravity turns against the gyros {better}; too little for certainty: check their unit and axes"
    facts = [*dict.fromkeys(filter(None, SIZES.values())), AXES]
    if shares and shares[present] < 1.0 - LEAST_SHARE:
        rivals = [way for way in shares if not is_better(present, way)]
        open_facts = {SIZES[size] for size, axes in rivals if axes == 0} | {AXES for size, axes in rivals if axes}
        facts = [fact for fact in facts if fact in open_facts]
    if not facts:
        return ""
    return f"taken unchecked: {', '.join(facts)} of the gyros; gravity turns too little to show them"


def _changes(way: Way) -> tuple[int, float]:
    """Return the number of axes that a way of reading changes, and the logarithm of its factor."""
    size, axes = way
    return int(np.count_nonzero(np.diag(PERMUTATIONS[axes]) != 1.0)), abs(np.log(size))


def _is_checked(record: StrapdownRecord) -> bool:
    """Return True if a true attitude, or the rests between moves, show how the gyros are read."""
    if len(record) < FEWEST_ROWS:
        return False
    undecided = replace(record, decisions=None)
    sampling = once(sampling_of, undecided)
    rests = quiet_rests(undecided, sampling, bounds=False)
    if truth_check(record, sampling, rests) is not None:
        return True
    moves = moves_between(record, sampling, rests)
    scale = scales_by_rests(moves)
    return scale is not None and int((moves.allowed(float(scale.max())) <= TELLING).sum()) >= FEWEST_MOVES


def _shares(record: StrapdownRecord) -> tuple[dict[Way, float], int]:
    """Return the part of the changes of specific force, squared, that each way of reading leaves, and the windows."""
    period = float(np.median(np.diff(record.time_s)))
    size = max(2, round(WINDOW / period))
    pieces = len(record) // size
    if pieces <= FEWEST_WINDOWS:
        return {}, 0
    rows = slice(0, pieces * size)
    force, rate = (
        values[rows].reshape(pieces, size, 3).mean(axis=1) for values in (record.specific_force, rates_of(record))
    )
    between = np.diff(record.time_s[rows].reshape(pieces, size).mean(axis=1))
    usual = between < 1.5 * size * period
    turn = (0.5 * (rate[1:] + rate[:-1]) * between[:, None])[usual]
    change, level = np.diff(force, axis=0)[usual], 0.5 * (force[1:] + force[:-1])[usual]
    # what a constant bias of the gyros can explain is taken away
    bias = np.linalg.qr(np.cross(level[:, :, None], between[usual][:, None, None] * np.eye(3), axis=1).reshape(-1, 3))[
        0
    ]

    def square(left: Floats) -> float:
        vector = left.ravel()
        return float(np.square(vector - bias @ (bias.T @ vector)).sum())

    total = square(change)
    if len(change) < FEWEST_WINDOWS or total == 0.0:
        return {}, 0
    shares = {
        (factor, number): square(change - np.cross(level, factor * turn @ axes.T)) / total
        for factor in SIZES
        for number, axes in enumerate(np.array(PERMUTATIONS))
    }
    return shares, len(change)
