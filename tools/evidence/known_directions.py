"""Rests of accelerometers whose direction of gravity is known, from any source: no table, no gyros."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...models.arrays import Floats
from ...models.effects import POSITION_EFFECTS, EffectPlace
from ...models.effects import Rows as Contexts
from ...models.effects.definition import ACCELEROMETERS
from ..calibrated import Calibration, Sigma
from ..errors import InputError
from .bench_left_out import FOLDS, by_position, trials_of_each
from .bench_visits import signature_columns
from .dependences import inputs_and_products
from .evidence import Evidence, Linear, Reader, Trial, parameters_with
from .fit import Fit
from .pairs import Pair
from .power import powers_of_record
from .rows import Rows

UNIT = 1e-6
"""Largest difference of the norm of a direction from 1."""


@dataclass(frozen=True, eq=False)
class KnownDirections:
    """Readings (N, 3) of three accelerometers [g], at unit vectors (N, 3) of the specific force in the block's axes.

    `noise_bound` [g] is the largest error of a reading.
    """

    direction: Floats
    reading: Floats
    noise_bound: float
    path: Path = Path("known directions")

    def __post_init__(self) -> None:
        if self.direction.shape != self.reading.shape or self.direction.ndim != 2 or self.direction.shape[1] != 3:
            raise InputError(f"{self.path}: directions and readings are N x 3 each")
        sizes = np.linalg.norm(self.direction, axis=1)
        if not (np.isfinite(self.reading).all() and np.abs(sizes - 1.0).max(initial=0.0) <= UNIT):
            raise InputError(f"{self.path}: a reading is not a number, or a direction is not a unit vector")
        if not self.noise_bound > 0.0:
            raise InputError(f"{self.path}: the noise bound is {self.noise_bound:g}; it is above zero")


@dataclass(frozen=True, eq=False)
class DirectionsReader(Reader):
    """The reader of rests with known directions."""

    record: KnownDirections

    @property
    def stated_bound(self) -> float:
        """The noise bound [g]."""
        return self.record.noise_bound

    def head(self) -> Mapping[str, Any]:
        """The model without effects: each accelerometer has a bias and feels three inputs."""
        return {"baseline_model": "known directions"}

    def missing(self) -> Mapping[str, Any]:
        """Return a warning: too few rests, or directions of one plane, prove nothing."""
        if np.linalg.matrix_rank(self.rows.nominal) == len(self.rows.names) < len(self.rows.residual):
            return {}
        return {"missing": ("at least five rests whose directions do not lie in one plane",)}

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Return biases, scale factors and misalignments of a consistent model; none of a falsified one."""
        names, stands = self.rows.names, fit is not None
        return Calibration(
            verdict="falsified" if self.model.falsified and not (fit and fit.places) else "consistent",
            sigma=Sigma.of(self.record.noise_bound, "given"),
            radius=fit.radius if fit else self.model.radius,
            estimator="analytic centre" if stands else None,
            parameters=parameters_with(names, fit.estimate[: len(names)], fit.ends(), inside=True) if fit else [],
        )

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Each effect of a fit: every fifth rest left out without it, with it, and with it shuffled."""
        folds = self.rows.fold_of_rows
        yield from trials_of_each(fit, [np.flatnonzero(folds == fold) for fold in range(FOLDS)], by_position)

    @cached_property
    def pairs(self) -> Sequence[Pair]:
        """Each accelerometer with each input and each product of two."""
        inputs, products = inputs_and_products(self.record.direction)
        pairs = []
        for place, of_reading in zip(ACCELEROMETERS, np.eye(3), strict=True):
            # The changes of the readings by a function at each rest, over their bounds.
            matrix = np.kron(np.eye(len(self.record.reading)), of_reading[:, None]) / self.record.noise_bound
            for name, values in (inputs | products).items():
                pairs.append(Pair(place, name, values, matrix.__matmul__, place))
        return tuple(pairs)

    def power(self) -> Sequence[Mapping[str, Any]]:
        """The power of the rests against the model without effects."""
        room = self.rows.bound * (1.0 + self.model.limit)
        return [power.entry for power in powers_of_record(self.pairs, self.rows.nominal, room)]


def directions_evidence(record: KnownDirections) -> Evidence:
    """The evidence of rests with known directions: the model is linear in all that it has."""
    n, sigma = record.direction, record.noise_bound
    still, nothing = np.zeros(len(n)), np.zeros_like(n)
    contexts = Contexts(still, still, still, n, by_alpha=nothing, by_beta=nothing)

    def columns_of(places: Sequence[EffectPlace]) -> Floats:
        return signature_columns(places, contexts) / sigma

    names, places = [], []
    for row in ("1", "2", "3"):
        names += [(f"accelerometer gamma_{row}{column}", "1") for column in ("1", "2", "3")]
        names.append((f"accelerometer bias_{row}", "g"))
    for effect in POSITION_EFFECTS.values():
        if effect.component == "AccelerometerBlock" and effect.linear and not effect.needs and effect.untold is None:
            places += effect.places
    slopes = np.einsum("nj,pq->npqj", np.hstack([n, np.ones((len(n), 1))]), np.eye(3))
    rows = Rows(
        tuple(names),
        np.zeros(len(names)),
        tuple(places),
        (record.reading - n).ravel() / sigma,
        slopes.reshape(n.size, len(names)) / sigma,
        np.ones(n.size),
        columns_of,
        fold_numbers=np.repeat(np.arange(len(n)) % FOLDS, 3),
    )
    return Evidence.of(DirectionsReader(Linear(rows), record))
