"""Which single change makes a wrong piece of a series fit: a sign, an exchange, a range, an offset, a copy."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ..evidence.bench import BenchReader
from ..evidence.bench_in_motion import BenchInMotion
from ..evidence.carried_run import Carried
from ..evidence.evidence import Evidence
from ..evidence.references import Gravity, rotation_vectors, turned
from ..evidence.rows import Pieces
from ..motion.carry import TurnsTooFar, carried_attitude
from ..motion.norm import NAMES, inputs_of, norm_block
from ..records import BenchRecord
from ..rounding import digits, exactly
from .change import DISCRETE, READING, ROW, Mending, RowChange
from .table import TableRows

WITHIN = 2.0
"""A piece fits with a change if it then misses the fit of the others by at most this number of bounds."""
LEAST_CHANGE = 0.03
"""A change of the gyros' signs, order or range that turns the block by less [rad] fits by chance."""
OFFSET = 1e-3
"""Offset of a gyro for the derivative of a turn [rad/s]."""
COPIED = 0.5
"""Part of the rows of a copied piece that are those of another stretch."""
ARCMIN = np.pi / 10800.0
KNOCKED = "No single change mends it: a knocked rest."
DISTURBED = "No single change mends it: a disturbed move."

Changed = Callable[[NDArray], NDArray]


class Stretch(Protocol):
    """A piece of a series: its kind, its number from 1, and its first and last rows."""

    @property
    def kind(self) -> str: ...
    @property
    def number(self) -> int: ...
    @property
    def begin(self) -> int: ...
    @property
    def end(self) -> int: ...


@dataclass(frozen=True)
class TriadChange:
    """A change of the three channels of an instrument: in words, as results have it, and as a function of (..., 3)."""

    words: str
    keys: Mapping[str, Any] = field(default_factory=dict)
    changed: Changed = np.asarray


def trials_of(letter: str, unit: str) -> Iterator[TriadChange]:
    """Yield signs, exchanges and ranges of three channels: "w" of gyros, "f" of accelerometers."""
    for k in range(3):
        signs = np.where(np.arange(3) == k, -1.0, 1.0)
        name = f"{letter}{k + 1}"
        yield TriadChange(f"the sign of {name} turned", {f"{name}_{unit}": "sign"}, lambda v, signs=signs: v * signs)
    for i, j in combinations(range(3), 2):
        order = np.arange(3)
        order[[i, j]] = [j, i]
        pair = [f"{letter}{i + 1}_{unit}", f"{letter}{j + 1}_{unit}"]
        words = f"{letter}{i + 1} and {letter}{j + 1} exchanged"
        yield TriadChange(words, {"exchanged": pair}, lambda v, order=order: v[..., order])
    for times, words in ((2.0, "doubled"), (0.5, "halved"), (np.pi / 180.0, "in degrees"), (180.0 / np.pi, "in rad")):
        yield TriadChange(f"{letter}1 to {letter}3 {words}", {"times": times}, lambda v, times=times: v * times)


def change_of(evidence: Evidence, remaining: Evidence, piece: Stretch) -> RowChange:
    """Return the simplest change with which a wrong piece fits the model of the others."""
    if isinstance(evidence.model, BenchInMotion):
        return _of_bench(evidence, remaining.model, piece)
    model: Carried = evidence.model
    return copied(model.found.record, piece, model.motion.time_s) or PieceOfCarried(model, remaining.model, piece).best


def copied(record: Any, piece: Stretch, time_s: NDArray) -> RowChange | None:
    """Return the stretch whose readings a piece repeats, digit by digit; None if it repeats none."""
    turning = record.rate if record.rate is not None else record.increment
    values = record.specific_force if piece.kind == "rest" else turning
    rows = values[piece.begin : piece.end + 1]
    middle = len(rows) // 2
    for row in np.flatnonzero((values == rows[middle]).all(axis=1)).tolist():
        first = row - middle
        if first == piece.begin or first < 0 or first + len(rows) > len(values):
            continue
        if (values[first : first + len(rows)] == rows).all(axis=1).mean() >= COPIED:
            begin = exactly(round(float(time_s[first]), 2))
            return RowChange(DISCRETE, f"Its readings are those from {begin} s on.", {"readings_from_s": float(begin)})
    return None


@dataclass(frozen=True, eq=False)
class PieceOfCarried:
    """A wrong piece of a block that is carried; `others` is the model of the record without it."""

    model: Carried
    others: Carried
    piece: Stretch

    @property
    def best(self) -> RowChange:
        """The simplest change with which the piece fits."""
        if self.piece.kind == "rest":
            return self.of_rest
        without = self.error(np.asarray)
        for trial in trials_of("w", "radps"):
            changed = np.linalg.norm(self.error(trial.changed) - without)
            if changed >= LEAST_CHANGE and self.misfit(trial.changed) <= WITHIN:
                return RowChange(DISCRETE, f"It fits with {trial.words}.", trial.keys)
        offsets = [self.offset(p) for p in range(3)]
        single = [p for p, (_, misfit) in enumerate(offsets) if misfit <= WITHIN]
        if len(single) == 1:
            p, size = single[0], offsets[single[0]][0]
            words = f"It fits with w{p + 1} {'larger' if size > 0.0 else 'smaller'} by {digits(abs(size), 3)} rad/s."
            return RowChange(READING, words, {f"w{p + 1}_radps": size})
        if self.piece.kind == "window":
            apart = self.error(np.asarray) / ARCMIN
            size = digits(float(np.linalg.norm(apart)), 3)
            words = f"In it gyros and true attitude differ by {size} arcmin; no single change of a gyro mends that."
            return RowChange(ROW, words, {"true_attitude_arcmin": apart.tolist()})
        return RowChange(ROW, DISTURBED)

    # Fit of the others

    @cached_property
    def solution(self) -> Floats:
        """Steps (P,) of the parameters of the others."""
        return self.others.baseline.step

    @cached_property
    def accelerometers(self) -> Floats:
        """Nine parameters of the accelerometers; none beside a true attitude."""
        return (self.others.rows.point + self.solution)[: self.others.of_forces]

    @cached_property
    def up(self) -> Floats:
        """Directions (K, 3) at all rests of the record."""
        assert isinstance(self.model.reference, Gravity)
        n = inputs_of(self.accelerometers, self.model.reference.reading)
        return n / np.linalg.norm(n, axis=1)[:, None]

    def rotation(self, first: int, last: int, changed: Changed = np.asarray) -> Floats:
        """Return the rotation (3, 3) from one row to another with changed rates: body at the end to the beginning."""
        motion = self.model.motion.part(first, last + 1)
        gyros = self.others.gyros_with((), self.solution)
        attitude = carried_attitude(replace(motion, rate=changed(motion.rate)), gyros, self.model.found.gravity)
        ends = Pieces("moves", "", np.array([0]), np.array([last - first]))
        return turned(ends, attitude)[0]

    # A move or a window

    @property
    def ends(self) -> tuple[int, int]:
        """The first and the last row of the move, or of the window."""
        return self.piece.begin - 1, self.piece.end + (self.piece.kind == "move")

    def error(self, changed: Changed) -> Floats:
        """Return the error (3,) of the turn [rad] with changed rates; infinite with rates that no turn can have."""
        reference = self.model.reference
        try:
            rotation = self.rotation(*self.ends, changed)
        except TurnsTooFar:
            return np.full(3, np.inf)
        if isinstance(reference, Gravity):
            return rotation @ self.up[self.piece.number] - self.up[self.piece.number - 1]
        ends = Pieces("windows", "", np.array(self.ends[:1]), np.array(self.ends[1:]))
        return rotation_vectors(rotation[None] @ turned(ends, reference.attitude).transpose(0, 2, 1))[0]

    @cached_property
    def bound(self) -> float:
        """Bound of such an error [rad]."""
        part = self.model.rows.parts[self.model.quoted]
        return float(np.median(part.bound))

    def misfit(self, changed: Changed) -> float:
        """Return the error of the turn with changed rates, over its bound."""
        return float(np.linalg.norm(self.error(changed))) / self.bound

    def offset(self, gyro: int) -> tuple[float, float]:
        """Return the offset of a gyro [rad/s] with which the turn misses least, and the misfit with it."""
        unit = np.eye(3)[gyro]
        slope = (self.error(lambda rate: rate + OFFSET * unit) - self.error(np.asarray)) / OFFSET
        size = 0.0
        for _ in range(3):
            error = self.error(lambda rate, size=size: rate + size * unit)
            if not np.isfinite(error).all():
                return size, math.inf
            size -= float(slope @ error / (slope @ slope))
        return size, self.misfit(lambda rate: rate + size * unit)

    # A rest

    @property
    def of_rest(self) -> RowChange:
        """The simplest change with which a rest fits."""
        reference, number = self.model.reference, self.piece.number - 1
        assert isinstance(reference, Gravity)
        rows = self.model.found.rests.rows
        if number:
            rotation = self.rotation(rows[number - 1].stop - 1, self.piece.begin)
            up = rotation.T @ self.up[number - 1]
        else:
            up = self.rotation(self.piece.end, rows[1].start) @ self.up[1]
        block = norm_block(self.accelerometers)[0]
        reading, predicted = reference.reading[number], block @ up + self.accelerometers[len(NAMES) - 3 :]
        error = np.abs(reading - predicted) / (WITHIN * self.bound)
        for trial in trials_of("f", "mps2"):
            if np.abs(trial.changed(reading) - predicted).max() <= WITHIN * self.bound:
                return RowChange(DISCRETE, f"It fits with {trial.words}.", trial.keys)
        for k in range(3):
            if error[k] > 1.0 >= np.delete(error, k).max():
                size = float(reading[k] - predicted[k])
                return RowChange(
                    READING, f"f{k + 1} alone does not fit, by about {digits(size, 3)} g.", {f"f{k + 1}_g": size}
                )
        return RowChange(ROW, KNOCKED)


def _of_bench(evidence: Evidence, others: BenchInMotion, piece: Stretch) -> RowChange:
    """Return the change of a wrong piece of a bench in motion; `others` is the model of the record without it."""
    model: BenchInMotion = evidence.model
    repeated = copied(model.raw, piece, model.raw.time_s)
    if repeated is not None:
        return repeated
    if piece.kind == "rest":
        table = TableRows.of(Evidence(model.rests, BenchReader(model.rests), evidence.source))
        assert table is not None
        row = piece.number - 1
        return Mending(table.about(np.array([row])), row, np.array([row])).best
    turns, point, own = model.whole.turns, others.baseline.central, others.whole.own
    covering = np.flatnonzero((turns.first <= piece.begin) & (turns.last >= piece.end))
    if not len(covering):
        return RowChange(ROW, DISTURBED)
    turn = covering[np.argmin((turns.last - turns.first)[covering])]
    targets = others.whole.parametrisation.selection[0] @ point[:own]
    error = turns.residual(targets, point[own : len(others.point) - 1]).reshape(-1, 3)[turn]
    bound = WITHIN * turns.bound(targets, point[own : len(others.point) - 1]).reshape(-1, 3)[turn]
    swept = _swept(model.raw, piece)
    for trial in trials_of("w", "radps"):
        if (np.abs(trial.changed(swept) - swept + error) <= bound).all():
            return RowChange(DISCRETE, f"It fits with {trial.words}.", trial.keys)
    wrong = np.flatnonzero(np.abs(error) > bound)
    if len(wrong) == 1:
        k = int(wrong[0])
        words = f"The integral of w{k + 1} alone does not fit, by {digits(float(error[k]), 3)} rad."
        return RowChange(READING, words, {f"w{k + 1}_rad": float(error[k])})
    return RowChange(ROW, DISTURBED)


def _swept(raw: BenchRecord, piece: Stretch) -> Floats:
    """Return the integrals (3,) [rad] of the gyros over the rows of a piece."""
    rows = slice(piece.begin, piece.end + 1)
    if raw.increment is not None:
        return raw.increment[rows].sum(axis=0)
    assert raw.rate is not None
    return (raw.rate[rows] * np.gradient(raw.time_s)[rows, None]).sum(axis=0)
