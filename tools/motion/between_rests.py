"""The gyros of a record beside gravity at its rests: the attitude that is carried from rest to rest must meet it.

Between two rests the gyros, less their mean at both, turn gravity's direction at the first into that at the second.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..records import StrapdownRecord
from ..records.channels import PERMUTATIONS, Channels
from ..rounding import digits
from .rests import RecordSampling, Rests, rates_of
from .truth import thinned, usable_in
from .turning import said_of_ways, units_tried

ALLOWED, ALLOWED_PART = 0.15, 0.1
"""The carried attitude may miss gravity by so much [rad], and by so much of the way that the block turned."""
TELLING = 1.0
"""A move that may miss by more tells nothing [rad]."""
LONGEST_S = 60.0
"""Longer moves are left out: their rates may have drifted."""
STANDING = 0.2
"""Where gyros read more than this at rest [rad/s], they may turn steadily, as in a centrifuge."""
SAME_FORCE = 0.1
"""Specific forces at two rests that differ by more than this part are not gravity alone."""
FEWEST_MOVES = 3
"""Of fewer moves no way of reading is named."""
LEAST_TURN = 0.3
"""Moves that turn gravity by less tell no way of reading from another [rad]."""
MOST_MOVES = 80
"""So many moves are looked at, spread over the record."""
SCALES = tuple(2.0 ** (k / 4.0) for k in range(-12, 13))
"""Sizes of the gyros' readings that are tried."""


@dataclass(frozen=True, eq=False)
class Turn:
    """A move between two rests: gravity's direction (3,) at both, the turns (n, 3) [rad] between, and its times [s]."""

    before: NDArray[np.float64]
    after: NDArray[np.float64]
    increments: NDArray[np.float64]
    begins: float
    ends: float
    drift: float

    def missed(self, matrix: NDArray[np.float64]) -> float:
        """Angle between gravity as carried by gyros that are read through a matrix (3, 3), and as measured [rad]."""
        carried = total_turn(self.increments @ matrix.T).inv().apply(self.before)
        return angle_of(carried, self.after)

    def allowed(self, size: float = 1.0) -> float:
        """What gyros of usual errors may miss, where they turn so many times as far as they read [rad]."""
        way = size * float(np.linalg.norm(self.increments, axis=1).sum())
        return ALLOWED + ALLOWED_PART * way + self.drift

    def is_missed(self, scale: float = 1.0) -> bool:
        """Whether gyros of that scale miss gravity by more than they may, where the move tells it."""
        return self.allowed(scale) <= TELLING and self.missed(scale * np.eye(3)) > self.allowed(scale)

    @property
    def turned(self) -> float:
        """Angle by which gravity turned [rad]."""
        return angle_of(self.before, self.after)


def angle_of(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Angle between two vectors (3,) [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def total_turn(increments: NDArray[np.float64]) -> Rotation:
    """The turn that rotation vectors (n, 3) [rad] make one after the other, n at least one."""
    turns = Rotation.from_rotvec(increments)
    while len(turns) > 1:
        if len(turns) % 2:
            turns = Rotation.concatenate([turns, Rotation.identity(1)])
        turns = turns[0::2] * turns[1::2]
    return turns[0]


def turns_between_rests(record: StrapdownRecord, sampling: RecordSampling, rests: Rests) -> tuple[Turn, ...]:
    """The moves between neighbouring rests at which gravity alone acts, without a gap, a knock or a saturated gyro."""
    usable, rates, moves = usable_in(record, sampling), rates_of(record), []
    sizes = np.linalg.norm(rests.force, axis=1)
    standing = np.linalg.norm(rests.rate, axis=1) < STANDING
    step = np.diff(record.time_s)
    for number in range(len(rests) - 1):
        first, last = rests.rows[number].stop - 1, rests.rows[number + 1].start
        size, next_size = sizes[number : number + 2]
        is_gravity = abs(next_size - size) <= SAME_FORCE * size and standing[number : number + 2].all()
        short = record.time_s[last] - record.time_s[first] <= LONGEST_S
        if is_gravity and short and usable(np.array([first]), np.array([last]))[0]:
            moves.append((number, first, last))
    turns = []
    for k in thinned(np.arange(len(moves)), MOST_MOVES):
        number, first, last = moves[k]
        rate = rates[first + 1 : last + 1]
        if record.rate is not None:
            rate = 0.5 * (rate + rates[first:last])
        level = rests.rate[number : number + 2]
        begins, ends = float(record.time_s[first]), float(record.time_s[last])
        turns.append(
            Turn(
                before=rests.force[number] / sizes[number],
                after=rests.force[number + 1] / sizes[number + 1],
                increments=(rate - level.mean(axis=0)) * step[first:last, None],
                begins=begins,
                ends=ends,
                drift=(ends - begins) * float(np.linalg.norm(level[1] - level[0])),
            )
        )
    return tuple(turns)


def ways_beside_gravity(turns: Sequence[Turn], before: Channels | None) -> tuple[str, str] | None:
    """What is wrong with order, signs or unit of gyros that miss gravity over most moves, as of `said_of_ways`."""
    telling = [turn for turn in turns if turn.turned > LEAST_TURN]
    missed = [turn for turn in telling if turn.is_missed()]
    unknown = not any(turn.allowed() <= TELLING for turn in telling)
    if before == Channels() or not (unknown or 2 * len(missed) > len(telling)):
        return None
    return said_of_ways(ways_that_fit(telling, before), before)


def missed_gravity(turns: Sequence[Turn], scale: float = 1.0) -> tuple[str, ...]:
    """A line where gyros of that scale and usual errors miss gravity over some move; nothing where none does."""
    missed = [turn for turn in turns if turn.is_missed(scale)]
    if not missed:
        return ()
    worst = max(missed, key=lambda turn: turn.missed(scale * np.eye(3)))
    angle = digits(np.degrees(worst.missed(scale * np.eye(3))), 3)
    begins, ends = digits(worst.begins, 6), digits(worst.ends, 6)
    return (
        f"the gyros miss gravity after {len(missed)} of {len(turns)} moves, by {angle} degrees at the rest from "
        f"{ends} s on: look at their rows between {begins} and {ends} s",
    )


def ways_that_fit(turns: Sequence[Turn], before: Channels | None) -> list[tuple[int, int]]:
    """Other ways of reading, by unit and signed permutation, that carry gravity over every move; the best first."""
    fits: dict[tuple[int, int], float] = {}
    if len(turns) < FEWEST_MOVES:
        return []
    for unit, size in enumerate(units_tried(before)):
        if not any(turn.allowed(size) <= TELLING for turn in turns):
            continue
        for number, axes in enumerate(PERMUTATIONS):
            total = 0.0
            for turn in turns:
                # a way of reading turns readings about the axes that a permutation maps them to
                missed = turn.missed(size * axes.T)
                if missed > turn.allowed(size):
                    break
                total += missed**2
            else:
                fits[unit, number] = total
    if (0, 0) in fits:
        return []
    return sorted(fits, key=lambda way: fits[way])


def scale_by_rests(turns: Sequence[Turn]) -> float | None:
    """How many times as far as they read the gyros turn, by gravity at the rests; None where moves do not tell it."""
    telling = [turn for turn in turns if turn.turned > LEAST_TURN and turn.allowed(1.0) - ALLOWED <= 4.0 * TELLING]
    if len(telling) < FEWEST_MOVES:
        return None
    costs = []
    for scale in SCALES:
        costs.append(_missed_square(telling, scale))
    best = float(SCALES[int(np.argmin(costs))])
    for width in (2.0**0.125, 2.0**0.03125, 2.0**0.0078125):
        tried = [best / width, best, best * width]
        values = [_missed_square(telling, scale) for scale in tried]
        bend = values[0] - 2.0 * values[1] + values[2]
        if not bend > 0.0:
            return None
        best *= width ** float(np.clip(0.5 * (values[0] - values[2]) / bend, -1.0, 1.0))
    if any(turn.missed(best * np.eye(3)) > turn.allowed(best) for turn in telling):
        return None
    return best


def _missed_square(turns: Sequence[Turn], scale: float) -> float:
    """Sum of the squares of what gyros of another size miss [rad²]."""
    total = 0.0
    for turn in turns:
        total += turn.missed(scale * np.eye(3)) ** 2
    return total
