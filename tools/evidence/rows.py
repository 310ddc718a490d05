"""Rows of evidence: errors with their bounds, of pieces of a record, of one component, or about a point."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of a record of one kind, each from one of its rows `first` (S,) to another, `last` (S,).

    `kind`: "moves": between rests, the direction of gravity is known at both ends; "rests": the block does not turn;
    "norms": the size of gravity at rest; "windows": the true attitude is known at both ends. `label` is in words: "0.5
    s", "2 moves".
    """

    kind: str
    label: str
    first: NDArray[np.int_]
    last: NDArray[np.int_]

    def __len__(self) -> int:
        return len(self.first)

    def selected(self, index: NDArray | slice) -> "Pieces":
        """Some of the pieces: mask or numbers."""
        return Pieces(self.kind, self.label, self.first[index], self.last[index])

    def durations(self, time_s: NDArray) -> NDArray[np.float64]:
        """Length of each piece (S,) [s]."""
        return time_s[self.last] - time_s[self.first]


@dataclass(frozen=True, eq=False)
class Part:
    """Errors of S pieces of one kind, with d components each.

    `error`, `bound` (S, d) are in the part's unit: [rad] of turns and directions, [g] of norms; `nominal` (S, d, P) are
    by the parameters of the model, `columns` (S, d, K) by the coefficients of the effects. By the errors that are
    `scored` the model is judged; what is known beside them stands in the other parts.
    """

    pieces: Pieces
    error: NDArray[np.float64]
    bound: NDArray[np.float64]
    nominal: NDArray[np.float64]
    columns: NDArray[np.float64]
    scored: bool

    def __len__(self) -> int:
        return len(self.error)

    @property
    def label(self) -> str:
        """In words."""
        return self.pieces.label

    def selected(self, index: NDArray) -> "Part":
        """Some of the pieces: mask or numbers."""
        names = ("error", "bound", "nominal", "columns")
        return replace(self, pieces=self.pieces.selected(index), **{name: getattr(self, name)[index] for name in names})


@dataclass(frozen=True, eq=False)
class Channel:
    """Errors (S,) of one component, `label`: ``{"axis": 1}``, and what they may depend on, by name.

    `quantities` are coordinates (S, k) of one variable each, `joint` of several together; `angles` (S,) [rad] are tried
    each, and all together.
    """

    label: Mapping[str, int]
    error: NDArray[np.float64]
    bound: NDArray[np.float64]
    quantities: Mapping[str, NDArray[np.float64]]
    joint: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    angles: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class About:
    """Rows about parameters and coefficients: errors (M,), derivatives (M, P + K), bounds (M,) of the errors.

    By `rate` (M, P + K) the bounds grow per unit of a coefficient's size, where the record leaves open what it does.
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    bound: NDArray[np.float64]
    rate: NDArray[np.float64]
