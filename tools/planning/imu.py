"""The programme of rests and turns that determines a whole IMU in given time on the table, and what it promises.

Beside it stand the bound, what all of the pool would guarantee, and what usual practice gives in the same time.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..calibrated import Number
from ..calibration import Bench
from ..calibration.calibration import checked_noise_bound
from ..errors import InputError
from ..progress import progress_bar
from ..result import Result, finite_or_none
from .common import DWELL_S, checked_dwell
from .imu_programme import Planned, Visit, seconds_of
from .imu_stops import LONG, POOL_DWELL_S, Pool, Search, together
from .plan import Degrees
from .tour import TABLE_ACCELERATION

if TYPE_CHECKING:
    from polars import DataFrame

RATE_DPS = 100.0
"""Of the table, where none is given."""
PRACTICE_DPS = (10.0, 50.0, 100.0)
EXCHANGES = 4
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
    places = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (90.0, 90.0), (90.0, 180.0), (90.0, 270.0)]
    places += [(0.0, 0.0), (360.0, 0.0), (0.0, 0.0), (0.0, 90.0), (360.0, 90.0), (0.0, 90.0), (0.0, 450.0), (0.0, 90.0)]
    return [Visit(*place, dwell_s, rate_dps) for place in places]


def many_positions(dwell_s: float, rate_dps: float) -> list[Visit]:
    """The 24 positions of the scenarios, and a turn to and fro at each rate about each axis of the block."""
    found = [Visit(20.0 + 45.0 * k, b, dwell_s, rate_dps) for b in (25.0, 145.0, 265.0) for k in range(8)]
    for begin, turn in (((0.0, 0.0), (360.0, 0.0)), ((0.0, 90.0), (360.0, 90.0)), ((0.0, 0.0), (0.0, 360.0))):
        found.append(Visit(*begin, dwell_s, rate_dps))
        for rate in (min(rate, rate_dps) for rate in PRACTICE_DPS):
            found += [Visit(*turn, dwell_s, rate), Visit(*begin, dwell_s, rate)]
    return found


PRACTICES = {
    "six positions and three turns": six_positions,
    "24 positions and rates of 10, 50, 100 deg/s": many_positions,
}


def imu_programme(
    minutes: float,
    bench: Bench,
    *,
    noise_bound: float = 1e-5,
    dwell_s: float = DWELL_S,
    rate_dps: float = RATE_DPS,
    exchanges: int = EXCHANGES,
    progress: bool = False,
) -> ImuPlan:
    """The programme for so many minutes; arguments as of `library.plan_imu`.

    An InputError for options that cannot be used, and for a time in which nothing determines every target.
    """
    if not LEAST_MINUTES <= minutes <= MOST_MINUTES:
        raise InputError(f"--minutes {minutes:g}: must be from {LEAST_MINUTES:g} to {MOST_MINUTES:g}")
    if not 1.0 <= rate_dps <= 360.0:
        raise InputError(f"--rate-dps {rate_dps:g}: must be from 1 to 360 deg/s")
    checked_dwell(dwell_s)
    if bench.gyro_noise is None:
        raise InputError("--gyro-noise: is needed, the bound of a gyro's mean over one second [rad/s]")
    planned, seconds = Planned(bench, checked_noise_bound(noise_bound)), 60.0 * minutes
    theirs = {name: _in_time(practice, seconds, dwell_s, rate_dps) for name, practice in PRACTICES.items()}
    given = {name: planned.linearised(practice) for name, practice in theirs.items()}
    pool = Pool.of(planned, dwell_s, rate_dps, list(given.values()))
    search = Search(pool, planned.targets, seconds)
    search.fill()
    with progress_bar("exchanges", exchanges, show=progress) as advance:
        for _ in range(exchanges):
            if not search.exchange():
                break
            advance(1, None)
    if len(search.taken) < 2:
        raise InputError(
            f"--minutes {minutes:g}: is too little for rests of {dwell_s:g} s; give more, or a shorter --dwell"
        )
    programme = _stretched(search.programme(search.taken), seconds)
    here = planned.linearised(programme)
    errors, bound = planned.errors(here), together(pool, here, planned.targets)
    if not np.isfinite(errors).all():
        missing = planned.targets[int(np.isinf(errors).argmax())].symbol
        raise InputError(f"--minutes {minutes:g}: no programme was found that determines {missing}; give more")

    def worst(found: NDArray) -> tuple[float, str]:
        k = int((found / bound).argmax())
        return float(found[k] / bound[k]), planned.targets[k].symbol

    practices = []
    for name, system in given.items():
        ratio, symbol = worst(planned.errors(system))
        practices.append(
            Practice(
                name=name, worst_ratio=finite_or_none(ratio), worst=symbol, minutes=seconds_of(theirs[name]) / 60.0
            )
        )
    ratio, symbol = worst(errors)
    return ImuPlan(
        programme=tuple(
            ImuVisit(alpha_deg=one.alpha_deg, beta_deg=one.beta_deg, dwell_s=one.dwell_s) for one in programme
        ),
        minutes=seconds_of(programme) / 60.0,
        worst_ratio=ratio,
        worst=symbol,
        targets=tuple(
            Promised(symbol=t.symbol, name=t.name, unit=t.unit, promised=float(e), bound=float(b))
            for t, e, b in zip(planned.targets, errors, bound, strict=True)
        ),
        practices=tuple(practices),
        noise_bound=planned.noise_bound,
        gyro_noise=bench.gyro_noise,
        encoder_bound=bench.encoder_within(noise_bound),
        rate_dps=rate_dps,
        acceleration_radps2=TABLE_ACCELERATION,
        latitude_deg=bench.latitude_deg,
        azimuth_deg=bench.azimuth_deg,
        pool=len(pool.stops),
    )


def _stretched(programme: list[Visit], seconds: float) -> list[Visit]:
    """The programme with the time that is left given to its longest rests."""
    most = max(one.dwell_s for one in programme)
    long = sum(one.dwell_s == most for one in programme)
    least = min(one.dwell_s for one in programme)
    more = min(most + np.floor((seconds - seconds_of(programme)) / long), LONG[-1] * least)
    return [one._replace(dwell_s=float(more)) if one.dwell_s == most else one for one in programme]


def _in_time(
    practice: Callable[[float, float], list[Visit]], seconds: float, dwell_s: float, rate: float
) -> list[Visit]:
    """A practice with rests as long as its time allows."""
    own = practice(dwell_s, rate)
    return practice(max(dwell_s + (seconds - seconds_of(own)) / len(own), POOL_DWELL_S), rate)
