"""The order in which the positions of a set are measured: the shortest tour, or at random against drift."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.table_commands import move_duration
from .request import Request
from .task import TURN, Places

EXACT = 10
"""Largest number of positions whose tour is found exactly, by dynamic programming; longer ones use exchanges."""
TABLE_RATE, TABLE_ACCELERATION = 1.0, 1.0
"""Default limits [rad/s], [rad/s²] of both axes for the times of tours."""
SAME_PLACE = np.radians(0.02)
"""Distance [rad] within which consecutive positions make one rest: the table hardly moves between them."""
SHORT_PART = 3
"""Largest number of positions in a part of a tour that is moved elsewhere."""


def measuring_order(places: Places, commands: NDArray, request: Request) -> tuple[NDArray, float]:
    """Return the rows of the set in the order of measurement, one mounting after the other, and the time of the moves
    [s].

    The request has tour or random order, its seed, the table's limits, and the number of repeated positions; the
    commands (N, 2) are the angles of the places [rad].
    """
    rng = np.random.default_rng(request.seed)
    whole, duration = [], 0.0
    for mounting in np.unique(places.mounting):
        rows = np.flatnonzero(places.mounting == mounting)
        times = move_times(commands[rows], request)
        order = shortest_tour(times) if request.order == "tour" else rng.permutation(len(rows))
        share = round(request.repeat * len(rows) / len(places))
        order = separated(with_repeats(order, share), commands[rows])
        duration += tour_duration(times, order)
        whole.append(rows[order])
    return np.concatenate(whole), duration


def unwound(angle: NDArray, keep_out: Sequence[Sequence[tuple[float, float]]] = ((), ())) -> NDArray:
    """Return angles (N, 2) [rad] as commands within one turn of each axis, cut away from all positions.

    The cut is in the axis's widest keep-out, which no move then crosses, or else in the widest gap between positions.
    The turn is the one about zero that leaves the commands as small as possible.
    """
    commands = np.mod(angle, TURN)
    for axis, intervals in enumerate(keep_out):
        if intervals:
            low, high = max(intervals, key=lambda interval: interval[1] - interval[0])
            cut = 0.5 * (low + high)
        else:
            ordered = np.sort(commands[:, axis])
            gaps = np.append(np.diff(ordered), ordered[0] + TURN - ordered[-1])
            widest = int(gaps.argmax())
            cut = ordered[widest] + 0.5 * gaps[widest]
        start = cut + 1e-12
        turned = start + np.mod(commands[:, axis] - start, TURN)
        turned -= TURN * np.round(0.5 * (turned.max() + turned.min()) / (TURN))
        commands[:, axis] = turned
    return commands


def move_times(commands: NDArray, request: Request) -> NDArray:
    """Return times [s] of all moves within the table's limits: (N + 1, N), the first row from (0, 0).

    Both axes move at once.
    """
    rate, acceleration = TABLE_RATE, TABLE_ACCELERATION
    if request.rate_dps is not None:
        rate = float(np.radians(request.rate_dps))
    if request.acceleration_dps2 is not None:
        acceleration = float(np.radians(request.acceleration_dps2))
    starts = np.vstack([np.zeros((1, 2)), commands])
    way = np.abs(starts[:, None] - commands[None]).max(axis=2)
    return np.vectorize(lambda distance: move_duration(float(distance), rate, acceleration))(way)


def tour_duration(times: NDArray, order: NDArray) -> float:
    """Return the time [s] of the moves of a programme that begins at (0, 0)."""
    before = np.concatenate([[0], order[:-1] + 1])
    return float(times[before, order].sum())


def shortest_tour(times: NDArray) -> NDArray:
    """Return the order (N,) with the least time of all moves from (0, 0) on, without a return."""
    count = times.shape[1]
    if count <= EXACT:
        return _exact(times)
    best, least = np.arange(count), (np.inf, [0])
    for first in range(count):
        order = _exchanged(times, _nearest_next(times, first))
        duration = round(tour_duration(times, order), 9), order.tolist()
        if duration < least:
            best, least = order, duration
    return best


def _nearest_next(times: NDArray, first: int) -> NDArray:
    """Return the order (N,) that goes to the nearest position each time."""
    order = [first]
    distance = times[1:].copy()
    distance[:, first] = np.inf
    while len(order) < len(distance):
        following = int(distance[order[-1]].argmin())
        distance[:, following] = np.inf
        order.append(following)
    return np.array(order)


def _exact(times: NDArray) -> NDArray:
    """Return the exact shortest tour by Held and Karp's recursion over sets of positions."""
    count = times.shape[1]
    best = np.full((1 << count, count), np.inf)
    before = np.zeros((1 << count, count), dtype=int)
    for last in range(count):
        best[1 << last, last] = times[0, last]
    for members in range(1, 1 << count):
        inside = np.flatnonzero(members >> np.arange(count) & 1)
        for new in np.flatnonzero(~members >> np.arange(count) & 1):
            ways = best[members, inside] + times[inside + 1, new]
            k = int(ways.argmin())
            if ways[k] < best[members | 1 << new, new]:
                best[members | 1 << new, new] = ways[k]
                before[members | 1 << new, new] = inside[k]
    members, last = (1 << count) - 1, int(best[-1].argmin())
    order = [last]
    while members != 1 << last:
        members, last = members ^ 1 << last, int(before[members, last])
        order.append(last)
    return np.array(order[::-1])


def _exchanged(times: NDArray, order: NDArray) -> NDArray:
    """Reverse parts of a tour, and move short parts, while that shortens it."""
    best, count = tour_duration(times, order), len(order)
    improved = True
    while improved:
        improved = False
        for i in range(count):
            for j in range(i + 1, count + 1):
                for trial in _exchanges(order, i, j):
                    duration = tour_duration(times, trial)
                    if duration < best - 1e-9:
                        order, best, improved = trial, duration, True
    return order


def _exchanges(order: NDArray, i: int, j: int) -> list[NDArray]:
    """Return the order with its part from i to j reversed, and with a short part at every other place."""
    part = order[i:j]
    trials = [np.concatenate([order[:i], part[::-1], order[j:]])]
    if j - i <= SHORT_PART:
        rest = np.concatenate([order[:i], order[j:]])
        for k in range(len(rest) + 1):
            if k != i:
                trials.append(np.concatenate([rest[:k], part, rest[k:]]))
    return trials


def with_repeats(order: NDArray, count: int) -> NDArray:
    """Return the order with `count` of its positions measured again, spread over it, half a programme after the first
    time.

    Half a programme apart, the two readings of a position show drift and repeatability best.
    """
    if not count:
        return order
    size = len(order)
    after: dict[int, list[int]] = {}
    for row in np.unique(np.linspace(0, size - 1, count).round().astype(int)).tolist():
        after.setdefault((row + size // 2) % size, []).append(int(order[row]))
    programme: list[int] = []
    for row, position in enumerate(order.tolist()):
        programme.append(position)
        programme += after.get(row, [])
    return np.array(programme)


def separated(order: NDArray, commands: NDArray) -> NDArray:
    """Return the order with no position right after one in the same place, if others can come between.

    A position that a plan has twice, for its weight, would make one long rest. The second one moves as near as possible
    to half a programme after the first. The order (M,) holds rows of the commands (N, 2) [rad].
    """
    programme = order.tolist()
    near = np.abs(commands[:, None] - commands[None]).max(axis=2) < SAME_PLACE
    for _ in order:
        twice = np.flatnonzero(near[programme[:-1], programme[1:]])
        if not len(twice):
            break
        at = int(twice[0]) + 1
        row = programme.pop(at)
        beside = np.concatenate([[False], near[programme, row], [False]])
        free = np.flatnonzero(~(beside[:-1] | beside[1:]))
        if not len(free):
            free = np.array([at])
        distance = np.abs(free - (at + len(order) // 2) % len(order))
        programme.insert(int(free[distance.argmin()]), row)
    return np.array(programme, dtype=int)
