"""Sessions with one change between two rows, unknown to the product."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from generator import SIGMA
from generator.effects import Sized
from generator.positions import Session, errors
from trihedron.tools.records import PositionRecord

GROUPS = (
    "bias",
    "scale factor",
    "mounting angle",
    "outer zero",
    "inner zero",
    "biases",
    "mounting",
    "scale factors",
    "biases and mounting",
    "common scale",
)


@dataclass(frozen=True)
class Broken:
    """A record, the changed quantity, the first row (from 1) after the change, and its size (K,) [g], [rad], [1]."""

    record: PositionRecord
    group: str
    before_row: int
    change: np.ndarray


def sizes(rng: np.random.Generator, count: int, size: float) -> np.ndarray:
    """Draw changes (K,) of about `size` σ, none of them small."""
    return SIGMA * size * rng.choice([-1.0, 1.0], count) * rng.uniform(0.6, 1.4, count)


def changed(stand: Any, group: str, change: np.ndarray, rng: np.random.Generator) -> Any:
    """Return the stand after a change."""
    one = np.zeros(3)
    one[rng.integers(3)] = change[0]
    if group == "bias":
        return replace(stand, bias=stand.bias + one)
    if group == "biases":
        return replace(stand, bias=stand.bias + change[:3])
    if group == "scale factor":
        return replace(stand, plus=stand.plus + one, minus=stand.minus + one)
    if group == "scale factors":
        return replace(stand, plus=stand.plus + change[:3], minus=stand.minus + change[:3])
    if group == "common scale":
        return replace(stand, plus=stand.plus + change[0], minus=stand.minus + change[0])
    if group == "outer zero":
        return replace(stand, alpha_error=stand.alpha_error + change[0])
    if group == "inner zero":
        return replace(stand, beta_error=stand.beta_error + change[0])
    if group == "mounting angle":
        return replace(stand, theta=stand.theta + one)
    if group == "mounting":
        return replace(stand, theta=stand.theta + change[:3])
    return replace(stand, bias=stand.bias + change[:3], theta=stand.theta + change[3:])


NUMBERS = {"biases": 3, "mounting": 3, "scale factors": 3, "biases and mounting": 6}


def joined_readings(
    session: Session, stands: list[Any], rows: list[int], hidden: tuple[Sized, ...] = (), error: Any = 0.0
) -> np.ndarray:
    """Return readings (N, 3) [g] of a session whose stand changes at some rows, with effects and errors (N, 3)."""
    reading = session.read(hidden, error)[1]
    for stand, row in zip(stands, rows, strict=True):
        reading[row:] = replace(session, stand=stand).read(hidden, error)[1][row:]
    return reading


@dataclass(frozen=True)
class TwoThings:
    """A record with a break before a row (from 1), and with another break, a wrong row, or an effect beside it."""

    record: PositionRecord
    before_row: int
    further_row: int


def two_things(
    seed: int,
    groups: tuple[str, ...],
    count: int = 48,
    hidden: tuple[Sized, ...] = (),
    *,
    wrong_row: bool = False,
    at_once: bool = False,
) -> TwoThings:
    """A record of a drawn session with one or two breaks, effects, and a row that was disturbed."""
    rng = np.random.default_rng([seed, count, 50])
    session = Session.drawn(rng, count)
    rows = np.sort(rng.choice(np.arange(count // 6, count - count // 6), 2, replace=False))
    if at_once:
        rows[1] = rows[0]
    stands, stand = [], session.stand
    for group in groups:
        stand = changed(stand, group, sizes(rng, NUMBERS.get(group, 1), 8.0), rng)
        stands.append(stand)
    added = np.zeros((count, 3))
    if wrong_row:
        added[rows[1]] = SIGMA * rng.choice([-1.0, 1.0], 3) * rng.uniform(10.0, 30.0, 3)
    added += 0.9 * errors(rng, count)[0]
    reading = joined_readings(session, stands, rows[: len(groups)].tolist(), hidden, added)
    record = session.recorded(session.read(hidden)[0], reading)
    return TwoThings(record, int(rows[0]) + 1, int(rows[1]) + 1)


def broken_record(seed: int, group: str, count: int = 48, size: float = 6.0, row: int | None = None) -> Broken:
    """Return a record of a drawn session with a break of a group before a row, by default a drawn one."""
    rng = np.random.default_rng([seed, count, GROUPS.index(group)])
    session = Session.drawn(rng, count)
    row = int(rng.integers(count // 5, count - count // 5)) if row is None else row
    change = sizes(rng, NUMBERS.get(group, 1), size)
    reading = joined_readings(session, [changed(session.stand, group, change, rng)], [row])
    angles = np.stack([session.alpha, session.beta], axis=1)
    return Broken(session.recorded(angles, reading + errors(rng, count)[0]), group, row + 1, change)
