"""A stretch of rows that does not belong to the rest: the shortest one without which the model fits."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Positions, predicted_reading, reading_jacobian
from ..errors import InputError
from ..evidence.evidence import Evidence
from .change import NEAR
from .removal import Parts, Removal, TooMany, held_by
from .rows import MOST_ROWS
from .simple import Simple
from .table import SECOND_ORDER, Table

PART = 5
"""A stretch that nothing mends is claimed up to this part of the rows."""
MENDED_PART = 3
"""A stretch that one change mends, up to this part."""
MENDED = 4
"""Numbers of a stretch that one change mends: where it begins and ends, what is changed, and which."""


def wrong_stretches(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the shortest stretch without which the model fits, longer than single wrong rows."""
    table = Table.of(evidence)
    if table is None:
        return ()
    window = shortest_stretch(table.removal(), len(table), MOST_ROWS + 1, len(table) // MENDED_PART)
    if window is None:
        return ()
    about = table.about(window)
    if not about.keeps_rank(window) or about.radius_without(window) > table.limit:
        return ()
    mended = next(Common(about, window).changes(), None)
    if mended is None and len(window) > len(table) // PART:
        return ()
    return _fault(evidence, window, mended)


def shortest_stretch(removal: Removal, count: int, least: int, most: int) -> NDArray[np.int_] | None:
    """Return the rows (from 0) of the shortest stretch without which the model fits; None if there is none."""
    conflicts: list[Parts] = []
    try:
        for length in range(least, most + 1):
            for first in range(count - length + 1):
                window = frozenset(range(first, first + length))
                if all(conflict & window for conflict in conflicts):
                    conflict = removal.conflict(window)
                    if conflict is None:
                        return np.arange(first, first + length)
                    conflicts.append(conflict)
    except TooMany:
        pass
    return None


def _fault(evidence: Evidence, window: NDArray, mended: "Mended | None") -> tuple[Simple, ...]:
    """Return the stretch as a fault, with its remedy."""
    assert evidence.source is not None
    record, sigma = evidence.source.record, evidence.model.calibration.noise_bound
    kept = np.setdiff1d(np.arange(len(record)), window)
    try:
        remaining = evidence.source.again(record.selected(kept), noise_bound=sigma)
    except InputError:
        return ()
    if remaining.model.falsified:
        return ()
    first, last = int(window[0]) + 1, int(window[-1]) + 1
    sentence = f"Rows {first} to {last} do not belong to the rest, which fits."
    if mended is not None:
        sentence += f" {mended.words}"
    fault = Simple(
        kind="stretch",
        numbers=3 * len(window) + 2 if mended is None else MENDED,
        where=(f"rows-{first}-to-{last}",),
        sentence=sentence,
        radius=remaining.model.radius,
        evidence=remaining,
        rows=tuple(range(first, last + 1)),
        change={} if mended is None else mended.keys,
    )
    return (fault,)


@dataclass(frozen=True)
class Mended:
    """A change that makes all rows of a stretch fit, in words and as the result has it."""

    words: str
    keys: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Common:
    """One change of all rows of a stretch; the table is linear about the fit of the others."""

    table: Table
    window: NDArray[np.int_]

    def changes(self) -> Iterator[Mended]:
        """Those with which the whole stretch fits."""
        linear = self.table.linear
        reading, at = linear.reading[self.window], linear.positions
        angles = np.column_stack((at.alpha, at.beta))[self.window]
        for i, j in combinations(range(3), 2):
            order = np.arange(3)
            order[[i, j]] = [j, i]
            if self.fits(angles, reading[:, order]):
                yield Mended(
                    f"In them f{i + 1} and f{j + 1} are exchanged.",
                    {"exchanged": [f"f{i + 1}_mps2", f"f{j + 1}_mps2"]},
                )
        for shift, words in ((1, "f1, f2, f3 are f2, f3, f1"), (2, "f1, f2, f3 are f3, f1, f2")):
            if self.fits(angles, np.roll(reading, shift, axis=1)):
                yield Mended(f"In them {words}.", {"rotated": shift})
        for k in range(3):
            if self.fits(angles, reading * np.where(np.arange(3) == k, -1.0, 1.0)):
                yield Mended(f"In them the sign of f{k + 1} is turned.", {f"f{k + 1}_mps2": "sign"})
        for words, keys, changed in (
            ("α and β are exchanged", {"exchanged": ["alpha_deg", "beta_deg"]}, angles[:, ::-1]),
            ("the sign of α is turned", {"alpha_deg": "sign"}, angles * [-1.0, 1.0]),
            ("the sign of β is turned", {"beta_deg": "sign"}, angles * [1.0, -1.0]),
        ):
            if self.fits(changed, reading):
                yield Mended(f"In them {words}.", keys)

    def fits(self, angles: NDArray, reading: NDArray) -> bool:
        """Return true if the stretch fits with angles (L, 2) and readings (L, 3)."""
        linear = self.table.linear
        at = Positions(angles[:, 0], angles[:, 1], linear.positions.mounting[self.window])
        error = reading - predicted_reading(linear.parametrisation, linear.point, at)
        if np.abs(error).max() > NEAR:
            return False
        bound = linear.bound.reshape(-1, 3)[self.window].ravel()
        jacobian = reading_jacobian(linear.parametrisation, linear.point, at).reshape(len(bound), -1)
        rows = (jacobian @ linear.span) / bound[:, None]
        kept = self.table.readings_without(self.window)
        matrix = np.vstack((self.table.matrix[kept], rows))
        target = np.append(self.table.target[kept], error.ravel() / bound)
        return held_by(matrix, target)[0] <= self.table.limit + SECOND_ORDER
