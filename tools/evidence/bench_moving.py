"""The readings of a whole bench: at rest and in motion, as one evidence of positions in the order of time."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.bench_turns import rates_of_turning
from ...models.effects import EffectPlace, MotionRows
from ..calibration.in_motion import SLOW, InMotion
from ..calibration.model import Positions, linearise
from ..records import BenchRecord
from .bench import Bench
from .bench_model import Readings
from .bench_visits import Circumstances
from .fit import coefficient_count


@dataclass(frozen=True, eq=False)
class Moving:
    """Readings at rest and in motion, in the order of time, as one evidence `read`; the first are at rest.

    `rate`, `acceleration` (N, 2) are those of both axes [rad/s], [rad/s²]; zeros at rest. `to_block` (3, 3): axes of
    the inner frame in those of the block; `lean` ε [rad]; `at_rest` (N,) which are the rests'.
    """

    read: Bench
    rate: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    at_rest: NDArray[np.bool_]
    to_block: NDArray[np.float64]
    lean: float

    @staticmethod
    def of(rests: Bench, raw: BenchRecord, more: InMotion, to_block: NDArray, lean: float) -> "Moving":
        """The rests of a record, and what it says between them."""
        here, known, rows = rests.here, rests.readings, more.rows
        hours = (raw.time_s[rows] - known.circumstances.began) / 3600.0
        order = np.argsort(np.append(known.circumstances.hours, hours), kind="stable")

        def joined(first: NDArray, second: NDArray) -> NDArray:
            return np.concatenate([first, second])[order]

        alpha, beta = (joined(*pair) for pair in zip((known.at.alpha, known.at.beta), more.angles.T, strict=True))
        positions = Positions(alpha, beta, np.zeros(len(order), dtype=int))
        bounds = joined(here.bound.reshape(-1, 3), more.bound).ravel()
        both = linearise(here.parametrisation, positions, joined(known.reading, more.reading), here.point, bounds)
        readings = Readings.of(both, _circumstances(rests, raw, more, order), known.resolution)
        numbers = joined(rests.numbers, np.zeros(len(rows), dtype=int))
        read, none = replace(rests, here=both, readings=readings, numbers=numbers), np.zeros((len(known), 2))
        rates = joined(none, more.rate), joined(none, more.acceleration)
        return Moving(read, *rates, joined(np.ones(len(known), bool), np.zeros(len(rows), bool)), to_block, lean)

    def about(self, point: NDArray) -> "Moving":
        """The readings linearised at other parameters (P,)."""
        here = self.read.here
        at = {"residual": here.residual_at(point), "jacobian": here.jacobian_at(point)}
        return replace(self, read=replace(self.read, here=replace(here, point=point, **at)))

    @property
    def motion(self) -> MotionRows:
        """The rows as effects in motion see them."""
        beta = self.read.readings.at.beta
        rate, change = rates_of_turning(beta, self.rate, self.acceleration, self.lean) @ self.to_block.T
        rows = self.read.rows
        ones = np.ones(len(beta))
        return MotionRows(rate, rate - change, rows.n, rows.hours, ones, rows.temperature)

    def columns(self, place: EffectPlace) -> NDArray[np.float64]:
        """What effects of accelerometers that only motion shows add to the readings (3 N, K) [g]; zeros of others."""
        effect = place.definition
        if not (effect.in_motion and effect.component == "AccelerometerBlock"):
            return np.zeros((3 * len(self.rate), coefficient_count(place)))
        return effect.signature(place, self.motion).reshape(3 * len(self.rate), -1)

    def lagging(self, lag: float) -> tuple[Readings, NDArray[np.float64]]:
        """The readings as those of moments that lie a lag [s] earlier, and how they change with it (3 N,) [g/s]."""
        readings, rows = self.read.readings, self.read.rows
        moved = -lag * self.rate + 0.5 * lag**2 * self.acceleration
        at = replace(readings.at, alpha=readings.at.alpha + moved[:, 0], beta=readings.at.beta + moved[:, 1])
        slope = -(rows.by_alpha * self.rate[:, :1] + rows.by_beta * self.rate[:, 1:])
        return replace(readings, at=at), slope.ravel()


def _circumstances(rests: Bench, raw: BenchRecord, more: InMotion, order: NDArray) -> Circumstances:
    """Circumstances of rests and of rows in motion, in this order."""
    known, moving = rests.readings.circumstances, np.abs(more.rate) > SLOW
    hours = (raw.time_s[more.rows] - known.began) / 3600.0
    rest = np.clip(np.searchsorted(known.hours, hours), 1, len(known.hours) - 1) - 1
    came = np.stack([known.sense_alpha, known.sense_beta], axis=1)
    senses = np.concatenate([came, np.where(moving, np.sign(more.rate), came[rest])])[order]
    before = None
    if known.before is not None:
        before = np.concatenate([known.before, more.angles - np.where(moving, more.rate, 0.0)])[order]
    warm = None
    if known.temperature is not None and raw.temperature is not None:
        warm = np.append(known.temperature, raw.temperature[more.rows])[order]
    return replace(
        known,
        hours=np.append(known.hours, hours)[order],
        temperature=warm,
        sense_alpha=senses[:, 0],
        sense_beta=senses[:, 1],
        before=before,
        axis_rates=np.concatenate([np.zeros_like(came), more.rate])[order],
    )
