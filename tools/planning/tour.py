"""The order in which the positions of a set are measured: the shortest tour, or at random against drift."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.table_commands import move_duration
from .positions import TURN, Places
from .request import Request

EXACT = 10
"""Tours of so many positions are found exactly, by dynamic programming; longer ones by exchanges from every start."""
TABLE_RATE, TABLE_ACCELERATION = 1.0, 1.0
"""Limits [rad/s], [rad/s²] of both axes by which tours are timed, where none are given."""
SAME_PLACE = np.radians(0.02)
"""Positions as near as this [rad] make one rest where one follows the other: the table hardly moves between them."""


def measuring_order(places: Places, commands: NDArray, request: Request) -> tuple[NDArray, float]:
    """The rows of the set in the order of measurement, one mounting after the other, and the time of the moves [s].

    Tour or random order, its seed, the table's limits, and how many positions are measured twice are of the request;
    the commands (N, 2) are the angles of the places [rad].
    """
    rng = np.random.default_rng(request.seed)
    whole, duration = [], 0.0
    limits = limits_of(request)
    for mounting in np.unique(places.mounting):
        rows = np.flatnonzero(places.mounting == mounting)
        times = move_times(commands[rows], limits)
        order = shortest_tour(times) if request.order == "tour" else rng.permutation(len(rows))
        share = round(request.repeat * len(rows) / len(places))
        order = apart(repeated(order, share), commands[rows])
        duration += tour_duration(times, order)
        whole.append(rows[order])
    return np.concatenate(whole), duration


def limits_of(request: Request) -> tuple[float, float]:
    """How fast the table turns [rad/s], [rad/s²]."""
    rate, acceleration = request.rate_dps, request.acceleration_dps2
    return (
        TABLE_RATE if rate is None else float(np.radians(rate)),
        TABLE_ACCELERATION if acceleration is None else float(np.radians(acceleration)),
    )


def unwound(angle: NDArray, keep_out: Sequence[Sequence[tuple[float, float]]] = ((), ())) -> NDArray:
    """Angles (N, 2) [rad] as commands within one turn of each axis, cut where no position lies.

    The cut is in the axis's widest keep-out, which no move then crosses, or else in the widest gap between positions.
    The turn is the one about zero that leaves the commands as small as possible.
    """
    commands = np.mod(angle, TURN)
    for axis in (0, 1):
        own = np.sort(commands[:, axis])
        gaps = np.append(np.diff(own), own[0] + TURN - own[-1])
        widest = int(gaps.argmax())
        cut = own[widest] + 0.5 * gaps[widest]
        if keep_out[axis]:
            low, high = max(keep_out[axis], key=lambda interval: interval[1] - interval[0])
            cut = 0.5 * (low + high)
        start = cut + 1e-12
        turned = start + np.mod(commands[:, axis] - start, TURN)
        turned -= TURN * np.round(0.5 * (turned.max() + turned.min()) / (TURN))
        commands[:, axis] = turned
    return commands


def move_times(commands: NDArray, limits: tuple[float, float] = (TABLE_RATE, TABLE_ACCELERATION)) -> NDArray:
    """Times [s] of all moves within the limits [rad/s], [rad/s²]: (N + 1, N), the first row from (0, 0).

    Both axes move at once.
    """
    starts = np.vstack([np.zeros((1, 2)), commands])
    way = np.abs(starts[:, None] - commands[None]).max(axis=2)
    return np.vectorize(lambda distance: move_duration(float(distance), *limits))(way)


def tour_duration(times: NDArray, order: NDArray) -> float:
    """Time [s] of the moves of a programme that begins at (0, 0)."""
    before = np.concatenate([[0], order[:-1] + 1])
    return float(times[before, order].sum())


def shortest_tour(times: NDArray) -> NDArray:
    """The order (N,) with the least time of all moves from (0, 0) on, not back."""
    count = times.shape[1]
    if count <= EXACT:
        return _exact(times)
    tours = []
    for first in range(count):
        order, left = [first], set(range(count)) - {first}
        while left:
            order.append(min(left, key=lambda k, last=order[-1]: (times[last + 1, k], k)))
            left.remove(order[-1])
        tours.append(_exchanged(times, np.array(order)))
    return min(tours, key=lambda order: (round(tour_duration(times, order), 9), order.tolist()))


def _exact(times: NDArray) -> NDArray:
    """Held and Karp's recursion over sets of positions."""
    count = times.shape[1]
    best = np.full((1 << count, count), np.inf)
    came = np.zeros((1 << count, count), dtype=int)
    for last in range(count):
        best[1 << last, last] = times[0, last]
    for members in range(1, 1 << count):
        inside = [k for k in range(count) if members >> k & 1]
        for new in range(count):
            if members >> new & 1:
                continue
            ways = best[members, inside] + times[np.array(inside) + 1, new]
            k = int(ways.argmin())
            if ways[k] < best[members | 1 << new, new]:
                best[members | 1 << new, new] = ways[k]
                came[members | 1 << new, new] = inside[k]
    members, last = (1 << count) - 1, int(best[-1].argmin())
    order = [last]
    while members != 1 << last:
        members, last = members ^ 1 << last, int(came[members, last])
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
                reversed_part = np.concatenate([order[:i], order[i:j][::-1], order[j:]])
                trials = [reversed_part]
                if j - i <= 3:
                    rest, part = np.concatenate([order[:i], order[j:]]), order[i:j]
                    trials += [np.concatenate([rest[:k], part, rest[k:]]) for k in range(len(rest) + 1) if k != i]
                for trial in trials:
                    duration = tour_duration(times, trial)
                    if duration < best - 1e-9:
                        order, best, improved = trial, duration, True
    return order


def repeated(order: NDArray, count: int) -> NDArray:
    """The order with `count` of its positions measured again, spread over it, half the programme after the first time.

    Half a programme apart, the two readings of a position tell drift and repeatability as well as any can.
    """
    if not count:
        return order
    size = len(order)
    chosen = np.unique(np.linspace(0, size - 1, count).round().astype(int))
    after: dict[int, list[int]] = {}
    for row in chosen:
        after.setdefault((int(row) + size // 2) % size, []).append(int(order[row]))
    programme: list[int] = []
    for row, position in enumerate(order):
        programme.append(int(position))
        programme += after.get(row, [])
    return np.array(programme)


def apart(order: NDArray, commands: NDArray) -> NDArray:
    """The order with no position right after one in the same place, where others can come between.

    A position that a plan has twice, for its weight, would make one long rest. The second one goes to where the first
    is half a programme away, or as near to that as it can. The order (M,) holds rows of the commands (N, 2) [rad].
    """
    programme = [int(row) for row in order]

    def same(a: int, b: int) -> bool:
        return bool(np.abs(commands[a] - commands[b]).max() < SAME_PLACE)

    def places_for(row: int) -> list[int]:
        around = (programme[max(k - 1, 0) : k + 1] for k in range(len(programme) + 1))
        return [k for k, neighbours in enumerate(around) if not any(same(row, other) for other in neighbours)]

    half = len(order) // 2
    for _ in order:
        twice = [at for at in range(1, len(programme)) if same(programme[at - 1], programme[at])]
        if not twice:
            break
        row = programme.pop(twice[0])
        free = places_for(row) or [twice[0]]
        wanted = (twice[0] + half) % len(order)
        programme.insert(min(free, key=lambda k, wanted=wanted: (abs(k - wanted), k)), row)
    return np.array(programme, dtype=int)
