"""A programme of rests and moves, and what a record of it guarantees.

A programme is evaluated as its record would be: exact angles and readings of a faultless bench go the way of
`trihedron calibrate`, so that every bound of a turn is that of the evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.bench import TARGETS, nominal_input
from ...models.bench_turns import GYRO_PARAMETERS, earth_in_base, integrated_readings, moments_of
from ...models.table_commands import TICK_TOLERANCE, move_duration
from ..calibration import Bench
from ..calibration.calibration import Asked, fit_record, wanted_targets
from ..calibration.estimates import a_priori_values
from ..calibration.gyros import fit_whole, gyro_targets, widened
from ..calibration.model import mountings_of, parametrise
from ..calibration.targets import Target
from ..calibration.turns import WithTurns
from ..errors import InputError
from ..records import BenchRecord
from ..records.rests import position_record_of
from .tour import TABLE_ACCELERATION

STEP_S = 0.01
"""Between rows of the records that are planned; finer rows bound what both axes do between them better."""


class Visit(NamedTuple):
    """A position of a programme [deg], how long the table rests there [s], and how fast it comes [deg/s]."""

    alpha_deg: float
    beta_deg: float
    dwell_s: float
    rate_dps: float


def seconds_of(programme: Sequence[Visit], step_s: float = STEP_S) -> float:
    """How long a programme takes from its first position on [s], every slot in whole steps."""
    return sum(steps_of(programme, step_s)) * step_s


def steps_of(programme: Sequence[Visit], step_s: float) -> list[int]:
    """How many steps each move with the rest behind it takes."""
    found, before = [], programme[0]
    for one in programme:
        way = radians(max(abs(one.alpha_deg - before.alpha_deg), abs(one.beta_deg - before.beta_deg)))
        move = move_duration(way, radians(one.rate_dps), TABLE_ACCELERATION)
        found.append(ceil((move + one.dwell_s) / step_s - TICK_TOLERANCE))
        before = one
    return found


def _gone(way: float, rate: float, time: NDArray) -> NDArray[np.float64]:
    """How far [rad] a move over `way` from rest to rest has gone at times after its beginning."""
    acceleration, length = TABLE_ACCELERATION, abs(way)
    peak = min(rate, np.sqrt(acceleration * length))
    if length == 0.0:
        return np.zeros(len(time))
    ramp = peak / acceleration
    cruise = length / peak - ramp
    rising, steady = np.clip(time, 0.0, ramp), np.clip(time - ramp, 0.0, cruise)
    braking = np.clip(time - ramp - cruise, 0.0, ramp)
    gone = 0.5 * acceleration * rising**2 + peak * (steady + braking) - 0.5 * acceleration * braking**2
    return np.sign(way) * np.where(time >= 2.0 * ramp + cruise, length, gone)


def record_of(programme: Sequence[Visit], earth: NDArray, step_s: float = STEP_S) -> BenchRecord:
    """What a bench without any fault records of a programme; `earth` (3,) is Earth's rotation in its base [rad/s]."""
    angles = [np.radians([[programme[0].alpha_deg, programme[0].beta_deg]])]
    for one, steps in zip(programme, steps_of(programme, step_s), strict=True):
        here, there = angles[-1][-1], np.radians([one.alpha_deg, one.beta_deg])
        time = step_s * np.arange(1, steps + 1)
        way = zip(here, there - here, strict=True)
        angles.append(np.stack([at + _gone(w, radians(one.rate_dps), time) for at, w in way], axis=1))
    alpha, beta = np.concatenate(angles).T
    time = step_s * np.arange(len(alpha))
    sums = np.diff(moments_of(time, alpha, beta), axis=0)
    zeros = np.zeros(len(TARGETS)), np.zeros(len(GYRO_PARAMETERS))
    turned = integrated_readings(*zeros, sums, np.zeros((2, *sums.shape)), np.eye(3), earth)
    force = STANDARD_GRAVITY * nominal_input(alpha, beta, np.eye(3))
    return BenchRecord(time, alpha, beta, force, increment=np.vstack([np.zeros((1, 3)), turned]))


@dataclass(frozen=True)
class Planned:
    """For which bench is planned, with which bounds: σ as a fraction of g."""

    bench: Bench
    noise_bound: float

    def linearised(self, programme: Sequence[Visit]) -> WithTurns:
        """The rows that a record of the programme gives, as `trihedron calibrate` takes them."""
        raw = record_of(programme, self._earth)
        record = position_record_of(raw)
        if len(record.position) != len(programme):
            raise InputError(f"--dwell: {len(programme) - len(record.position)} rests of the programme are too short")
        alone = fit_record(record, self.noise_bound, Asked(noise_bound=self.noise_bound))
        return fit_whole(alone, record, self.bench, self.noise_bound)

    @cached_property
    def targets(self) -> list[Target]:
        """The 18 targets and the gyros' parameters."""
        own = wanted_targets(parametrise(mountings_of("identity")), Asked(noise_bound=self.noise_bound))
        every = [*own, *gyro_targets(len(own))]
        return [widened(target, len(own) + len(GYRO_PARAMETERS)) for target in every]

    def errors(self, here: WithTurns) -> NDArray[np.float64]:
        """Guaranteed errors (T,) of all targets; infinite where they stay open."""
        found = a_priori_values(here, self.targets)[:, 1]
        return np.where(np.isnan(found), np.inf, found)

    @cached_property
    def _earth(self) -> NDArray[np.float64]:
        return earth_in_base(radians(self.bench.latitude_deg), radians(self.bench.azimuth_deg))
