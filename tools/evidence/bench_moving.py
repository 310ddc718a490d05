"""The readings of a whole bench: at rest and in motion, as one evidence of positions in the order of time."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace, MotionRows
from ..calibration.in_motion import CERTAIN, InMotion, slopes_by_angles
from ..calibration.model import linearise
from ..records import BenchRecord, PositionRecord
from .bench import Bench
from .bench_model import Readings
from .bench_travel import FINE, moves_of, senses_of_moves
from .bench_visits import Circumstances
from .fit import coefficient_count


@dataclass(frozen=True, eq=False)
class Moving:
    """Readings at rest and in motion, in the order of time: as one evidence `read`, and as they are `seen` in motion.

    At rest those have no row, and rates of zero. `to_block` (3, 3): axes of the inner frame in those of the block;
    `lean` ε [rad].
    """

    read: Bench
    seen: InMotion
    to_block: NDArray[np.float64]
    lean: float

    @staticmethod
    def of(
        rests: Bench, record: PositionRecord, motion: InMotion, to_block: NDArray, lean: float, encoder_bound: float
    ) -> "Moving":
        """The rests of a record, and what it says between them; more than an encoder's error [rad] is motion."""
        linear_rests, readings_at_rest, raw = rests.here, rests.readings, record.raw
        assert isinstance(raw, BenchRecord)
        hours = (raw.time_s[motion.rows] - readings_at_rest.circumstances.began) / 3600.0
        order = np.argsort(np.append(readings_at_rest.circumstances.hours, hours), kind="stable")
        still = np.zeros((len(readings_at_rest), 2))
        angles = np.stack([readings_at_rest.at.alpha, readings_at_rest.at.beta], axis=1)
        moves = moves_of(raw, encoder_bound)
        spans = [(rest.kept_first - 1, rest.kept_last) for rest in record.rests if rest.refused is None]
        at_rest = InMotion(
            np.full(len(readings_at_rest), -1),
            np.array(spans),
            angles,
            readings_at_rest.reading,
            linear_rests.bound.reshape(-1, 3),
            still,
            still,
            _senses_at(rests, raw, moves),
        )
        fields: dict[str, Any] = {}
        for name, values in vars(at_rest).items():
            fields[name] = np.concatenate([values, getattr(motion, name)])[order]
        in_motion = InMotion(**fields)
        linear = linearise(
            linear_rests.parametrisation,
            in_motion.at(0.0),
            in_motion.reading,
            linear_rests.point,
            in_motion.bound.ravel(),
        )
        readings = Readings.of(linear, _circumstances(rests, raw, in_motion, order, moves), readings_at_rest.resolution)
        numbers = np.append(rests.numbers, np.zeros(len(motion.rows), dtype=int))[order]
        return Moving(replace(rests, here=linear, readings=readings, numbers=numbers), in_motion, to_block, lean)

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """Which readings (N,) are the rests'."""
        return self.seen.rows < 0

    def about(self, point: NDArray) -> "Moving":
        """The readings linearised at other parameters (P,)."""
        linear = self.read.here
        at = {"residual": linear.residual_at(point), "jacobian": linear.jacobian_at(point)}
        return replace(self, read=replace(self.read, here=replace(linear, point=point, **at)))

    @cached_property
    def motion(self) -> MotionRows:
        """The rows as effects in motion see them."""
        motion, rows = self.seen.motion(self.to_block, self.lean, self.read.calibration.gravity), self.read.rows
        return replace(motion, specific_force=rows.n, hours=rows.hours, temperature=rows.temperature)

    def columns(self, place: EffectPlace) -> NDArray[np.float64]:
        """What effects of accelerometers that only motion shows add to the readings (3 N, K) [g]; zeros of others."""
        effect = place.definition
        if not (effect.in_motion and effect.component == "AccelerometerBlock"):
            return np.zeros((self.seen.reading.size, coefficient_count(place)))
        return effect.signature(place, self.motion).reshape(self.seen.reading.size, -1)

    def lagging(self, lag: float) -> tuple[Readings, NDArray[np.float64]]:
        """The readings as those of moments that lie a lag [s] earlier, and how they change with it (3 N,) [g/s]."""
        linear = self.read.here
        slope = self.seen.by_lag(linear.parametrisation, linear.point, lag)
        return replace(self.read.readings, at=self.seen.at(lag)), slope


def _senses_at(rests: Bench, raw: BenchRecord, moves: NDArray) -> NDArray[np.float64]:
    """Senses (N, 3) in which the inputs changed last before rests, 0 where moves (2, T) of both axes do not tell.

    Where both axes came to a rest together both must say so; else it is the one that came later.
    """
    circumstances, at = rests.readings.circumstances, rests.readings.at
    arrived = np.searchsorted(raw.time_s, circumstances.began + 3600.0 * circumstances.hours)
    row, turned = np.arange(moves.shape[1]), np.cumsum(np.abs(moves), axis=1)
    last = np.maximum.accumulate(np.where(moves != 0.0, row, 0), axis=1)[:, arrived]
    later_outer = turned[0, arrived] - turned[0, last[1]] > FINE
    later_inner = turned[1, arrived] - turned[1, last[0]] > FINE
    senses = _senses_of_axes(moves)[:, arrived]
    grown = senses[:, :, None] * np.moveaxis(slopes_by_angles(rests.here.parametrisation, rests.here.point, at), 2, 0)
    ways = np.where(np.abs(grown) > CERTAIN, np.sign(grown), 0.0)
    together = np.where(ways[0] == ways[1], ways[0], 0.0)
    alone = np.where(later_outer[:, None], ways[0], ways[1])
    return np.where((later_outer == later_inner)[:, None], together, alone)


def _senses_of_axes(moves: NDArray) -> NDArray[np.float64]:
    """Senses (2, T) of the last move of both axes, by their moves (2, T)."""
    outer, inner = moves
    return np.stack([senses_of_moves(outer[1:]), senses_of_moves(inner[1:])])


def _circumstances(rests: Bench, raw: BenchRecord, seen: InMotion, order: NDArray, moves: NDArray) -> Circumstances:
    """Circumstances of rests and of rows in motion, in this order; both are `seen`, moves (2, T) are of both axes."""
    at_rest, rows = rests.readings.circumstances, seen.rows[seen.rows >= 0]
    # An axis that came before the other one has the sense of its own last move.
    going = _senses_of_axes(moves)[:, rows].T
    senses = np.concatenate([np.stack([at_rest.sense_alpha, at_rest.sense_beta], axis=1), going])[order]
    warm = None
    if at_rest.temperature is not None and raw.temperature is not None:
        warm = np.append(at_rest.temperature, raw.temperature[rows])[order]
    return replace(
        at_rest,
        hours=np.append(at_rest.hours, (raw.time_s[rows] - at_rest.began) / 3600.0)[order],
        temperature=warm,
        sense_alpha=senses[:, 0],
        sense_beta=senses[:, 1],
        before=None,
        axis_rates=seen.rate,
        input_senses=seen.senses,
    )
