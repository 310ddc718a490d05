"""The programme of rests and turns that determines a whole IMU in given time on the table, and what it promises.

Beside it stand the bound, what all of the pool would guarantee, and what usual practice gives in the same time.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from ..calibrated import Number
from ..calibration.calibration import checked_noise_bound
from ..calibration.targets import Target
from ..errors import InputError
from ..progress import progress_bar
from ..result import Result, finite_or_none
from .imu_stops import LONG, POOL_DWELL_S, Place, Planned, Pool, Search, Visit, seconds_of, together
from .positions import checked_dwell
from .targets import Degrees
from .tour import TABLE_ACCELERATION

if TYPE_CHECKING:
    from polars import DataFrame

PRACTICE_DPS = (10.0, 50.0, 100.0)
LEAST_MINUTES, MOST_MINUTES = 5.0, 240.0
HELD_TO = 0.1
"""A record of the programme guarantees what is promised, but for this part of it: what the bench's errors change."""


class ImuVisit(Result):
    """A row of the programme: commands [deg] and rest [s]."""

    alpha_deg: Degrees
    beta_deg: Degrees
    dwell_s: Number


class Promised(Result):
    """The guaranteed error of a target that the programme promises, and what all of the pool would guarantee."""

    symbol: str
    name: str
    unit: str
    promised: float
    bound: float


class Practice(Result):
    """What another programme of the same length gives: the worst ratio to the bound, None where a target stays open."""

    name: str
    worst_ratio: float | None
    worst: str
    minutes: float


class ImuPlan(Result):
    """A programme of turns and rests for the whole IMU.

    Attributes
    ----------
    programme : tuple of ImuVisit
        in order; whole turns more are whole turns of the table
    minutes : float
        how long it takes
    worst_ratio : float
        of a promised error to what all moves of the pool together would guarantee, and `worst` its target
    targets : tuple of Promised
    practices : tuple of Practice
        what is usual, in the same time
    held_to : float
        by what part a record's guaranteed errors may differ from what is promised
    noise_bound, gyro_noise, encoder_bound, rate_dps, acceleration_radps2, latitude_deg, azimuth_deg
        what it is planned for
    pool : int
        how many rests and turns could be chosen
    """

    schema_: Literal["trihedron.imu-plan/1"] = Field(default="trihedron.imu-plan/1", alias="schema")
    programme: Annotated[tuple[ImuVisit, ...], Field(min_length=1)]
    minutes: float
    worst_ratio: float
    worst: str
    targets: tuple[Promised, ...]
    practices: tuple[Practice, ...]
    held_to: float = HELD_TO
    noise_bound: float
    gyro_noise: float
    encoder_bound: float
    rate_dps: float
    acceleration_radps2: float
    latitude_deg: float
    azimuth_deg: float
    pool: int

    def to_polars(self) -> "DataFrame":
        """The programme, a row for each rest: alpha_deg, beta_deg, dwell_s."""
        import polars as pl

        return pl.DataFrame([one.to_json() for one in self.programme]).cast(pl.Float64)


def six_positions(dwell_s: float, rate_dps: float) -> list[Visit]:
    """Six positions, each axis up and down, and a turn to and fro about each axis of the block."""
    rests: list[Place] = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (90.0, 90.0), (90.0, 180.0), (90.0, 270.0)]
    turns: list[Place] = [(0.0, 0.0), (360.0, 0.0), (0.0, 0.0), (0.0, 90.0), (360.0, 90.0), (0.0, 90.0), (0.0, 450.0)]
    return [Visit(alpha, beta, dwell_s, rate_dps) for alpha, beta in [*rests, *turns, (0.0, 90.0)]]


def many_positions(dwell_s: float, rate_dps: float) -> list[Visit]:
    """The 24 positions of the scenarios, and a turn to and fro at each rate about each axis of the block."""
    visits = []
    for beta in (25.0, 145.0, 265.0):
        for k in range(8):
            visits.append(Visit(20.0 + 45.0 * k, beta, dwell_s, rate_dps))
    for begin, turn in (((0.0, 0.0), (360.0, 0.0)), ((0.0, 90.0), (360.0, 90.0)), ((0.0, 0.0), (0.0, 360.0))):
        visits.append(Visit(*begin, dwell_s, rate_dps))
        for rate in PRACTICE_DPS:
            for place in (turn, begin):
                visits.append(Visit(*place, dwell_s, min(rate, rate_dps)))
    return visits


PRACTICES = {
    "six positions and three turns": six_positions,
    "24 positions and rates of 10, 50, 100 deg/s": many_positions,
}


def imu_programme(
    minutes: float, planned: Planned, *, dwell_s: float, rate_dps: float, exchanges: int, progress: bool = False
) -> ImuPlan:
    """The programme for so many minutes; arguments as of `library.plan_imu`.

    An InputError for options that cannot be used, and for a time in which nothing determines every target.
    """
    if not LEAST_MINUTES <= minutes <= MOST_MINUTES:
        raise InputError(f"--minutes {minutes:g}: must be from {LEAST_MINUTES:g} to {MOST_MINUTES:g}")
    if not 1.0 <= rate_dps <= 360.0:
        raise InputError(f"--rate-dps {rate_dps:g}: must be from 1 to 360 deg/s")
    checked_dwell(dwell_s)
    bench, seconds = planned.bench, 60.0 * minutes
    if bench.gyro_noise is None:
        raise InputError("--gyro-noise: is needed, the bound of a gyro's mean over one second [rad/s]")
    checked_noise_bound(planned.noise_bound)
    practices = {name: _in_time(practice, seconds, dwell_s, rate_dps) for name, practice in PRACTICES.items()}
    records = {name: planned.linearised(practice) for name, practice in practices.items()}
    pool = Pool.of(planned, dwell_s, rate_dps, records.values())
    programme = _stretched(_chosen(pool, planned.targets, seconds, exchanges, progress=progress), seconds)
    if len(programme) < 2:
        raise InputError(
            f"--minutes {minutes:g}: is too little for rests of {dwell_s:g} s; give more, or a shorter --dwell"
        )
    record = planned.linearised(programme)
    errors, bound = planned.errors(record), together(pool, record, planned.targets)
    if not np.isfinite(errors).all():
        missing = planned.targets[int(np.isinf(errors).argmax())].symbol
        raise InputError(f"--minutes {minutes:g}: no programme was found that determines {missing}; give more")
    compared = []
    for name, practice in practices.items():
        ratios = planned.errors(records[name]) / bound
        worst = int(ratios.argmax())
        compared.append(
            Practice(
                name=name,
                worst_ratio=finite_or_none(float(ratios[worst])),
                worst=planned.targets[worst].symbol,
                minutes=seconds_of(practice) / 60.0,
            )
        )
    promises = []
    for k, target in enumerate(planned.targets):
        promises.append(
            Promised(
                symbol=target.symbol,
                name=target.name,
                unit=target.unit,
                promised=float(errors[k]),
                bound=float(bound[k]),
            )
        )
    worst = int((errors / bound).argmax())
    return ImuPlan(
        programme=tuple(ImuVisit(alpha_deg=v.alpha_deg, beta_deg=v.beta_deg, dwell_s=v.dwell_s) for v in programme),
        minutes=seconds_of(programme) / 60.0,
        worst_ratio=float(errors[worst] / bound[worst]),
        worst=planned.targets[worst].symbol,
        targets=tuple(promises),
        practices=tuple(compared),
        noise_bound=planned.noise_bound,
        gyro_noise=bench.gyro_noise,
        encoder_bound=bench.encoder_within(planned.noise_bound),
        rate_dps=rate_dps,
        acceleration_radps2=TABLE_ACCELERATION,
        latitude_deg=bench.latitude_deg,
        azimuth_deg=bench.azimuth_deg,
        pool=len(pool.stops),
    )


def _chosen(pool: Pool, targets: Sequence[Target], seconds: float, exchanges: int, *, progress: bool) -> list[Visit]:
    """The programme of stops that the search chooses in so many seconds; none where they are too few for two."""
    search = Search(pool, targets, seconds)
    search.fill()
    with progress_bar("exchanges", exchanges, show=progress) as advance:
        for _ in range(exchanges):
            if not search.exchange():
                break
            advance(1, None)
    return search.programme(search.chosen) if len(search.chosen) >= 2 else []


def _stretched(programme: list[Visit], seconds: float) -> list[Visit]:
    """The programme with the time that is left given to its longest rests."""
    if not programme:
        return []
    dwells = [visit.dwell_s for visit in programme]
    longest = max(dwells)
    more = np.floor((seconds - seconds_of(programme)) / dwells.count(longest))
    longer = float(min(longest + more, LONG[-1] * min(dwells)))
    return [visit._replace(dwell_s=longer) if visit.dwell_s == longest else visit for visit in programme]


def _in_time(
    practice: Callable[[float, float], list[Visit]], seconds: float, dwell_s: float, rate: float
) -> list[Visit]:
    """A practice with rests as long as its time allows."""
    visits = practice(dwell_s, rate)
    return practice(max(dwell_s + (seconds - seconds_of(visits)) / len(visits), POOL_DWELL_S), rate)
