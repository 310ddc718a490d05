"""Wrong pieces of a series: the fewest rests and moves without which the model fits."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats
from ..bounded.programmes import SolverError
from ..errors import InputError
from ..evidence.bench_in_motion import BenchInMotion
from ..evidence.carried_run import LONG, Carried
from ..evidence.evidence import Evidence
from ..evidence.fit import estimated, robust_estimate
from ..evidence.references import Gravity
from ..records import RawRecord
from ..records.rests import position_record_of
from ..rounding import exactly
from .change import ROW
from .mended_piece import change_of
from .removal import Removal, held_by
from .simple import Simple

CERTAIN = 2.0
"""Below this radius a weak effect may show in a few pieces alone. A piece is called wrong there if its error is larger
than this while all others fit."""
MOST_PIECES, MOST_SETS, FREED = 3, 3, 5
"""Most wrong pieces, most sets that are stated, and the inverse part of the errors that may be left out."""
MOST_TRIED = 4
"""Most pieces that are tried where errors are too large for the linear model."""
NEARLY = 1.1
"""A rival of the worst piece leaves robust errors up to this factor larger."""
LEFT = 0.3
"""Errors of a few pieces fall below this part of the radius without them; the rest is of second order."""
SLACK = 0.5
"""Largest error of the linear model about a robust fit [bounds]."""
ROUNDS = 8
"""Rounds of least squares to a robust fit."""
MOVE = 3
"""Numbers that a wrong move needs."""


@dataclass(frozen=True)
class Piece:
    """Rows of a series, from `begin` to `end`, both included: a rest, a move, or a window beside the true attitude."""

    kind: Literal["rest", "move", "window"]
    number: int
    begin: int
    end: int

    def meets(self, first: NDArray, last: NDArray) -> Bools:
        """Mark the stretches from rows (S,) to rows (S,) that need a row of the piece."""
        return (first <= self.end) & (last >= self.begin)

    @property
    def numbers(self) -> int:
        """Count of numbers that an unknown piece needs."""
        return MOVE if self.kind == "move" else ROW


@dataclass(frozen=True, eq=False)
class SeriesPieces:
    """The pieces of a series, and linear errors about a fit that few of them can draw.

    `matrix` (M, P) and `target` (M,) are over the bounds; `belongs` (M, K) marks the pieces that each error needs;
    `single` (M,) marks errors that do not overlap.
    """

    evidence: Evidence
    time_s: Floats
    pieces: tuple[Piece, ...]
    matrix: Floats
    target: Floats
    belongs: Bools
    single: Bools

    @staticmethod
    def of(evidence: Evidence) -> "SeriesPieces | None":
        """Return the pieces of a strapdown or bench record; None of a record that is none, or too long."""
        model = evidence.model
        if evidence.source is None:
            return None
        if isinstance(model, BenchInMotion):
            return _of_bench(evidence, model)
        if isinstance(model, Carried) and len(model.motion) <= LONG and _of_carried(evidence, model).is_of_few:
            robust = evidence.source.again(robust=True)
            return _of_carried(evidence, robust.model) if isinstance(robust.model, Carried) else None
        return None

    @property
    def most(self) -> int:
        """Most pieces that may be left out so that the others still prove something."""
        spare = (int(self.single.sum()) - self.matrix.shape[1]) // FREED
        widest = int((self.belongs & self.single[:, None]).sum(axis=0).max(initial=1))
        return min(MOST_PIECES, spare // max(widest, 1))

    @property
    def excess(self) -> Floats:
        """Return how much each piece (K,) misfits: its least error that other pieces cannot cause."""
        errors = np.abs(self.target)[:, None]
        alone = self.belongs & (self.belongs.sum(axis=1) <= MOST_PIECES)[:, None]
        return np.where(alone, errors, 0.0).max(axis=0, initial=0.0)

    def candidates(self) -> Iterator[tuple[int, ...]]:
        """Yield sets of pieces without which the linear model fits; if there are none, those that do most for it."""
        removal = Removal(self.matrix, self.target, self.belongs, self.excess, self.limit)
        smallest = [tuple(sorted(parts)) for parts in removal.smallest(self.most)]
        yield from sorted(smallest, key=lambda parts: int(self.needing(parts).sum()))
        if smallest:
            return
        # Large errors have drawn even the robust fit.
        for size in range(1, self.most + 1):
            sets = combinations(sorted(self.worst + self.rivals), size)
            standing = [numbers for numbers in sets if self.is_small_without(numbers)]
            yield from sorted(standing, key=lambda parts: int(self.needing(parts).sum()))

    @property
    def limit(self) -> float:
        """Return the largest radius of a linear model that may fit."""
        return self.evidence.model.limit + SLACK

    @cached_property
    def radius(self) -> float:
        """Return the radius of all pieces."""
        return held_by(self.matrix, self.target)[0]

    @cached_property
    def robust_errors(self) -> Floats:
        """Return the sizes of the errors (M,) about a robust fit [bounds]."""
        return np.abs(self.target - self.matrix @ robust_estimate(self.matrix, self.target))

    @cached_property
    def worst(self) -> tuple[int, ...]:
        """Return pieces, each the one without which the robust errors fall most, the former ones left out."""
        errors = self.robust_errors
        worst: list[int] = []
        for _ in range(MOST_TRIED):
            largest = np.where(self.belongs, 0.0, errors[:, None]).max(axis=0, initial=0.0)
            worst.append(int(np.argmin(largest)))
            errors = np.where(self.belongs[:, worst[-1]], 0.0, errors)
        return tuple(dict.fromkeys(worst))

    @cached_property
    def rivals(self) -> tuple[int, ...]:
        """Return the pieces without which the robust errors fall nearly as much as without the worst one."""
        largest = np.where(self.belongs, 0.0, self.robust_errors[:, None]).max(axis=0, initial=0.0)
        numbers = np.flatnonzero(largest <= NEARLY * largest.min(initial=np.inf)).tolist()
        return tuple(number for number in numbers if number not in self.worst)[:MOST_TRIED]

    def is_small_without(self, numbers: Sequence[int]) -> bool:
        """Return true if the errors without some pieces are small, or so much smaller that linearity may fail."""
        kept = ~self.needing(numbers)
        small = max(self.limit, LEFT * self.radius)
        if self.radius < CERTAIN:
            small = LEFT * CERTAIN
        return held_by(self.matrix[kept], self.target[kept])[0] <= small

    @property
    def is_of_few(self) -> bool:
        """Return true if the errors may be those of few pieces: an effect acts on all of them."""
        return self.most > 0 and self.is_small_without(self.worst[: self.most])

    def stand_out(self, numbers: Sequence[int]) -> bool:
        """Return true if errors of these pieces exceed CERTAIN wherever the others fit, which they then do easily."""
        scale = np.where(self.needing(numbers), CERTAIN, 1.0)
        together, _ = held_by(self.matrix / scale[:, None], self.target / scale)
        return together > self.evidence.model.limit and self.is_small_without(numbers)

    def needing(self, numbers: Sequence[int]) -> Bools:
        """Mark the errors (M,) that need any of some pieces."""
        return np.any(self.belongs[:, list(numbers)], axis=1)

    @property
    def noise_bound(self) -> float:
        """Return σ of a bench record."""
        return self.evidence.model.calibration.noise_bound

    def without(self, numbers: Sequence[int]) -> Evidence | None:
        """Return the evidence of the record without some pieces; None if the model does not fit it."""
        source = self.evidence.source
        assert source is not None
        record, options = source.record, {}
        series = record.raw if isinstance(self.evidence.model, BenchInMotion) else record
        aside = np.zeros(len(series), dtype=bool)
        for number in numbers:
            aside[self.pieces[number].begin : self.pieces[number].end + 1] = True
        series = replace(series, aside=aside)
        try:
            if isinstance(series, RawRecord):
                options = {"noise_bound": self.noise_bound}
                series = position_record_of(series)
            remaining = source.again(series, **options)
        except (InputError, SolverError):
            return None
        if remaining.source is None or remaining.model.falsified or remaining.reader.objections():
            return None
        return remaining


def wrong_pieces(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the smallest sets of rests and moves of a series without which the model fits."""
    series = SeriesPieces.of(evidence)
    if series is None or not series.is_of_few:
        return ()
    faults: dict[tuple[int, ...], Simple] = {}
    for numbers in series.candidates():
        if (faults and len(numbers) > len(next(iter(faults)))) or len(faults) == MOST_SETS:
            break
        # A rest takes the moves beside it along: no rival of one of these.
        needing = series.needing(numbers)
        if evidence.model.radius < CERTAIN and not series.stand_out(numbers):
            continue
        if any((needing | ~series.needing(smaller)).all() for smaller in faults):
            continue
        remaining = series.without(numbers)
        if remaining is not None:
            faults[numbers] = _fault(series, numbers, remaining)
    return tuple(faults.values())


def _fault(series: SeriesPieces, numbers: Sequence[int], remaining: Evidence) -> Simple:
    """Return the fault of these pieces, with the change that makes each of them fit."""
    pieces = [series.pieces[number] for number in numbers]
    sentences, changes, labels, needed = [], {}, [], 0
    for piece in pieces:
        change = change_of(series.evidence, remaining, piece)
        begin, end = (exactly(round(float(series.time_s[row]), 2)) for row in (piece.begin, piece.end))
        where = f"The {piece.kind} from {begin} s to {end} s"
        if piece.kind == "rest":
            where = f"Rest {piece.number} ({begin} s to {end} s)"
        sentences.append(f"{where} is wrong. {change.words}")
        labels.append(f"{piece.kind}-{piece.number}")
        changes[labels[-1]] = {"from_s": float(begin), "to_s": float(end), **change.keys}
        needed += min(change.numbers, piece.numbers)
    sentence = " ".join([*sentences, "All other rests and moves fit."])
    if pieces[0].kind == "window":
        sentence = " ".join([*sentences, "All other windows fit."])
    return Simple(
        kind="rows",
        numbers=needed,
        where=tuple(labels),
        sentence=sentence,
        radius=remaining.model.radius,
        evidence=remaining,
        change=changes,
        time_s=float(series.time_s[pieces[0].begin]),
        fit=None if isinstance(remaining.model, BenchInMotion) else remaining.model.baseline,
    )


def _between(rests: Sequence[tuple[int, int]]) -> tuple[Piece, ...]:
    """Return rests, by their first and last rows, and the moves between them."""
    pieces = []
    for number, (begin, end) in enumerate(rests, start=1):
        pieces.append(Piece("rest", number, begin, end))
    for number, ((_, before), (after, _)) in enumerate(pairwise(rests), start=1):
        if after - before > 1:
            pieces.append(Piece("move", number, before + 1, after - 1))
    return tuple(pieces)


def _marks(pieces: Sequence[Piece], first: NDArray, last: NDArray, repeats: int) -> Bools:
    """Mark the pieces (S · repeats, K) that stretches from rows (S,) to rows (S,) need."""
    marks = np.array([piece.meets(first, last) for piece in pieces]).reshape(len(pieces), -1).T
    return np.repeat(marks, repeats, axis=0)


def _of_carried(evidence: Evidence, robust: Carried) -> SeriesPieces:
    """Return the pieces of a block that is carried, about a robust fit."""
    parts = robust.rows.parts
    if isinstance(robust.reference, Gravity):
        pieces = _between([(rows.start, rows.stop - 1) for rows in robust.found.rests.rows])
        overlapping = [part.label for part in parts[len(parts) - len(robust.reference.scored) + 1 :]]
    else:
        windows = parts[robust.quoted].pieces
        ends = enumerate(zip(windows.first.tolist(), windows.last.tolist(), strict=True), start=1)
        pieces = tuple(Piece("window", number, first + 1, last) for number, (first, last) in ends)
        overlapping = [part.label for part in parts if part is not parts[robust.quoted]]
    belongs, single = [], []
    for part in parts:
        belongs.append(_marks(pieces, part.pieces.first, part.pieces.last, part.error.shape[1]))
        single.append(np.full(part.error.size, part.label not in overlapping))
    return SeriesPieces(
        evidence,
        robust.motion.time_s,
        pieces,
        robust.rows.nominal,
        robust.rows.residual,
        np.concatenate(belongs),
        np.concatenate(single),
    )


def _of_bench(evidence: Evidence, model: BenchInMotion) -> SeriesPieces:
    """Return the pieces of a bench in motion, about a robust fit."""
    point, nothing = model.point, np.zeros(0)
    for _ in range(ROUNDS):
        at = model.about((), point, nothing)
        misfit = np.linalg.norm(at.residual.reshape(-1, 3), axis=1)
        weight = np.repeat(1.0 / np.sqrt(np.maximum(misfit, 1.0)), 3)
        point = point + estimated(at.jacobian * weight[:, None], at.residual * weight)
    at = model.about((), point, nothing)
    record: Any = evidence.source.record if evidence.source is not None else None
    usable = [rest for rest in record.rests if rest.refused is None]
    pieces = _between([(rest.first, rest.last) for rest in usable])
    seen, turns = model.moving.seen, model.whole.turns
    first = np.concatenate([seen.span[:, 0] + 1, turns.first + 1])
    last = np.concatenate([seen.span[:, 1], turns.last])
    single = np.ones(len(at.residual), dtype=bool)
    return SeriesPieces(
        evidence, model.raw.time_s, pieces, at.jacobian, at.residual, _marks(pieces, first, last, 3), single
    )
