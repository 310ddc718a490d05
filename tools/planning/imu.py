"""Plan the rests and turns that determine a whole IMU in a given time on the table, with guaranteed errors.

A programme is evaluated like its record: exact angles and readings of a faultless bench pass through
`trihedron calibrate`, so every bound of a turn is that of the evidence.

The pool is a programme of all rests and turns that may be chosen. No choice can beat the guarantee of the whole pool:
with bounded errors a repeated measurement tells nothing new. The programmes of the guaranteed errors choose the stops.
The worst error's vertex is a pair of benches that the chosen stops do not tell apart; it shows which stop separates
them best. The result also has that bound and the guarantee of usual practice in the same time.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import ceil, radians
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats, Ints
from ...models.bench import GYRO_PARAMETERS, TARGETS, earth_in_base, integrated_readings, moments_of, nominal_input
from ...models.table_commands import TICK_TOLERANCE, move_duration
from ..bounded.programmes import Polytope
from ..calibration import BenchOnEarth
from ..calibration.calibration import Asked, checked_noise_bound, fit_record, wanted_targets
from ..calibration.estimates import a_priori_values
from ..calibration.gyros import fit_whole, gyro_targets, widened
from ..calibration.model import mountings_of, parametrise
from ..calibration.targets import Target
from ..calibration.turns import PLAUSIBLE, WithTurns
from ..errors import InputError
from ..fields import Number
from ..progress import progress_bar
from ..records import BenchRecord
from ..records.rests import position_record_of
from ..result import Result, finite_or_none
from .positions import checked_dwell
from .targets import Degrees
from .tour import TABLE_ACCELERATION

if TYPE_CHECKING:
    from polars import DataFrame

STEP_S = 0.01
"""Time between rows of the planned records [s]; finer rows bound the motion between them better."""
LATTICE_DEG, AWAY_DEG = 30.0, 7.5
"""Step of the pool's lattice, and its distance from the multiples of 90° at which the signs of inputs are uncertain."""
WHOLE_TURNS = (1, 4)
LONG = (1.0, 2.0, 3.75)
"""Lengths of the pool's rests [dwells]: long rests determine biases and sensitivities.

A rest four times shorter than most does not count as one.
"""
POOL_DWELL_S = 5.0
"""Length of the rests in the pool's own record [s]: its rows give those of longer rests."""
WAY_S = 3.0
"""Approximate time of the way from one stop to the next [s]."""
PATIENCE = 0.25
"""Power of a stop's time that divides its gain: slow stops tell more than fast ones."""
SHARP = 4
"""Power to which ratios are raised before their use is summed: the worst ones dominate."""
SAME = 1e-6
"""Ratios that differ by less are equal."""
LARGEST = 1e-2
"""Bound of every parameter of bench and accelerometers."""


class TableVisit(NamedTuple):
    """A position of a programme [deg], the table's rest there [s], and its rate of approach [deg/s]."""

    alpha_deg: float
    beta_deg: float
    dwell_s: float
    rate_dps: float

    @property
    def place(self) -> tuple[float, float]:
        """Both angles [deg]."""
        return self.alpha_deg, self.beta_deg

    def way(self, before: "TableVisit") -> float:
        """Return the larger of both axes' moves from the previous visit [deg]."""
        return max(abs(self.alpha_deg - before.alpha_deg), abs(self.beta_deg - before.beta_deg))


def seconds_of(programme: Sequence[TableVisit]) -> float:
    """Return the duration of a programme from its first position on [s], every slot in whole steps."""
    return sum(_steps_of(programme)) * STEP_S


def _steps_of(programme: Sequence[TableVisit]) -> list[int]:
    """Return the number of steps of each move with the rest behind it."""
    steps, before = [], programme[0]
    for visit in programme:
        move = move_duration(radians(visit.way(before)), radians(visit.rate_dps), TABLE_ACCELERATION)
        steps.append(ceil((move + visit.dwell_s) / STEP_S - TICK_TOLERANCE))
        before = visit
    return steps


def _covered(way: float, rate: float, time: NDArray) -> Floats:
    """Return the angle [rad] that a move over `way` from rest to rest has covered at times after its beginning."""
    acceleration, length = TABLE_ACCELERATION, abs(way)
    if length == 0.0:
        return np.zeros(len(time))
    peak = min(rate, np.sqrt(acceleration * length))
    ramp = peak / acceleration
    cruise = length / peak - ramp
    rising, steady = np.clip(time, 0.0, ramp), np.clip(time - ramp, 0.0, cruise)
    braking = np.clip(time - ramp - cruise, 0.0, ramp)
    covered = 0.5 * acceleration * rising**2 + peak * (steady + braking) - 0.5 * acceleration * braking**2
    return np.sign(way) * np.where(time >= 2.0 * ramp + cruise, length, covered)


def programme_record(programme: Sequence[TableVisit], earth: NDArray) -> BenchRecord:
    """Return a faultless bench's record of a programme; `earth` (3,) is Earth's rotation in its base [rad/s]."""
    start = np.radians(programme[0].place)
    angles = [start[None]]
    for visit, steps in zip(programme, _steps_of(programme), strict=True):
        end, rate = np.radians(visit.place), radians(visit.rate_dps)
        time = STEP_S * np.arange(1, steps + 1)
        way = end - start
        alpha, beta = start[0] + _covered(way[0], rate, time), start[1] + _covered(way[1], rate, time)
        angles.append(np.column_stack([alpha, beta]))
        start = angles[-1][-1]
    alpha, beta = np.concatenate(angles).T
    time = STEP_S * np.arange(len(alpha))
    sums = np.diff(moments_of(time, alpha, beta), axis=0)
    bench, gyros, still = np.zeros(len(TARGETS)), np.zeros(len(GYRO_PARAMETERS)), np.zeros((2, *sums.shape))
    turned = integrated_readings(bench, gyros, sums, still, np.eye(3), earth)
    force = STANDARD_GRAVITY * nominal_input(alpha, beta, np.eye(3))
    return BenchRecord(time, alpha, beta, force, increment=np.vstack([np.zeros((1, 3)), turned]))


@dataclass(frozen=True)
class Planned:
    """The bench for which a programme is planned, and σ as a fraction of g."""

    bench: BenchOnEarth
    noise_bound: float

    def linearised(self, programme: Sequence[TableVisit]) -> WithTurns:
        """Return the rows of the programme's record, as `trihedron calibrate` takes them."""
        earth = earth_in_base(radians(self.bench.latitude_deg), radians(self.bench.azimuth_deg))
        record = position_record_of(programme_record(programme, earth))
        if len(record.position) != len(programme):
            raise InputError(f"--dwell: {len(programme) - len(record.position)} rests of the programme are too short")
        alone = fit_record(record, self.noise_bound, Asked(noise_bound=self.noise_bound))
        return fit_whole(alone, record, self.bench, self.noise_bound)

    @cached_property
    def targets(self) -> list[Target]:
        """Return the 18 targets and the gyros' parameters."""
        bench = wanted_targets(parametrise(mountings_of("identity")), Asked(noise_bound=self.noise_bound))
        size = len(bench) + len(GYRO_PARAMETERS)
        return [widened(target, size) for target in (*bench, *gyro_targets(len(bench)))]

    def errors(self, rows: WithTurns) -> Floats:
        """Return the guaranteed errors (T,) of all targets; infinite for undetermined ones."""
        errors = a_priori_values(rows, self.targets)[:, 1]
        return np.where(np.isnan(errors), np.inf, errors)


class Stop(NamedTuple):
    """A rest, or whole turns to and fro with rests at both ends: its visits, and its rows (K,) of the pool."""

    visits: tuple[TableVisit, ...]
    rows: Ints


@dataclass(frozen=True, eq=False)
class StopPool:
    """The reference for all choices: rows (M, P) over their bounds, and the stops to choose from."""

    rows: Floats
    stops: tuple[Stop, ...]

    @staticmethod
    def of(planned: Planned, dwell_s: float, rate_dps: float, practices: Iterable[WithTurns]) -> "StopPool":
        """Return rests on the lattice, turns about either axis at its angles of the other, and the rows of practices.

        Every rest is short in the pool's own record: its rows give the rows of a longer one.
        """
        places, turns = _lattice_places(), _lattice_turns()
        path, ends = _joined([(place,) for place in places] + turns)
        record = planned.linearised([TableVisit(*place, POOL_DWELL_S, rate_dps) for place in path])
        count, behind = len(path), 3 * len(path)
        # Pieces are the rests, then the ways between two rests.
        between = np.searchsorted(record.turns.last[:count], record.turns.first[count:], side="right") - 1
        stops = []
        for (begin, end), turn in zip(ends[len(places) :], turns, strict=True):
            moves = count + np.flatnonzero((between >= begin) & (between < end))
            rows = np.append(_three(begin), (behind + _three(moves)).ravel())
            stops.append(Stop(tuple(TableVisit(*place, dwell_s, rate_dps) for place in turn), rows))
        blocks = [record.jacobian / record.bound[:, None]]
        size = len(record.bound)
        for (rest, _), place in zip(ends, places, strict=False):
            for factor in LONG:
                dwell = factor * dwell_s
                stops.append(Stop((TableVisit(*place, dwell, rate_dps),), np.append(_three(rest), size + np.arange(3))))
                blocks.append(_longer_rest(record, rest, behind, dwell))
                size += 3
        # Rests as short as those of the pool's own record are not part of it.
        blocks[0][behind : behind + 3 * count] = 0.0
        for practice in practices:
            blocks.append(practice.jacobian / practice.bound[:, None])
        return StopPool(np.vstack(blocks), tuple(stops))


Place = tuple[float, float]


def _three(piece: int | NDArray) -> Ints:
    """Return rows (..., 3) of pieces: one for each accelerometer or gyro."""
    return 3 * np.asarray(piece)[..., None] + np.arange(3)


def _lattice_places() -> list[Place]:
    """Return the places (α, β) [deg] of the lattice, β to and fro."""
    lattice = np.arange(AWAY_DEG, 360.0, LATTICE_DEG).tolist()
    places = []
    for k, alpha in enumerate(lattice):
        places += [(alpha, beta) for beta in (lattice if k % 2 == 0 else lattice[::-1])]
    return places


def _lattice_turns() -> list[tuple[Place, ...]]:
    """Return whole turns to and fro: about α from two opposite angles at each β, then about β likewise."""
    lattice = np.arange(AWAY_DEG, 360.0, LATTICE_DEG).tolist()
    opposite = lattice[:: len(lattice) // 2]
    about_alpha, about_beta = [], []
    for fixed, start, count in product(lattice, opposite, WHOLE_TURNS):
        end = start + 360.0 * count
        about_alpha.append(((start, fixed), (end, fixed), (start, fixed)))
        about_beta.append(((fixed, start), (fixed, end), (fixed, start)))
    return about_alpha + about_beta


def _joined(stops: Sequence[Sequence[Place]]) -> tuple[list[Place], list[tuple[int, int]]]:
    """Return places one after the other, none right after itself, and the first and last place of each stop."""
    path: list[Place] = []
    ends = []
    for stop in stops:
        if not path or path[-1] != stop[0]:
            path.append(stop[0])
        first = len(path) - 1
        path += stop[1:]
        ends.append((first, len(path) - 1))
    return path, ends


def _longer_rest(record: WithTurns, rest: int, behind: int, dwell_s: float) -> Floats:
    """Return the gyros' rows (3, P) over their bounds of a rest that is longer than in the pool's record."""
    turns, rows = record.turns, behind + _three(rest)
    seconds = (turns.last[rest] - turns.first[rest]) * STEP_S
    longer = 1.0 + (dwell_s - POOL_DWELL_S) / seconds
    noise = turns.noise[rest]
    bound = record.bound[rows] - noise + noise * np.sqrt(longer)
    return longer * record.jacobian[rows] / bound[:, None]


def confined(rows: NDArray) -> tuple[NDArray, Polytope]:
    """Return rows (M, P) over their bounds, then the bounds of all parameters, and the polytope that starts from
    these."""
    known = np.diag(1.0 / np.append(np.full(len(TARGETS), LARGEST), PLAUSIBLE))
    stacked = np.vstack([rows, known])
    return stacked, Polytope(stacked, np.ones(len(stacked)), np.arange(len(rows), len(stacked)))


def joint_errors(pool: StopPool, rows: WithTurns, targets: Sequence[Target]) -> Floats:
    """Return the guaranteed errors (T,) of the pool and a programme's own rows together."""
    stacked, polytope = confined(np.vstack([pool.rows, rows.jacobian / rows.bound[:, None]]))
    polytope.confine(-np.ones(len(stacked)), np.ones(len(stacked)))
    return np.array([polytope.maximise(target.weights)[0] for target in targets])


class StopSearch:
    """The chosen stops of a pool, and the guaranteed errors with them, each by its programme."""

    def __init__(self, pool: StopPool, targets: Sequence[Target], seconds: float):
        self._pool, self._targets, self._seconds = pool, targets, seconds
        self._rows, self._polytope = confined(pool.rows)
        self.chosen: list[int] = list(range(len(pool.stops)))
        self._vertex = np.zeros((len(targets), self._rows.shape[1]))
        self._share = np.zeros((len(targets), len(self._rows)))
        self._error = np.zeros(len(targets))
        self._solve(range(len(targets)))
        self._best = self._error.copy()
        self.choose([])

    def _solve(self, which: Iterable[int]) -> None:
        upper = np.full(len(self._rows), np.inf)
        upper[len(self._pool.rows) :] = 1.0
        for stop in self.chosen:
            upper[self._pool.stops[stop].rows] = 1.0
        self._polytope.confine(-upper, upper)
        for k in which:
            self._error[k], self._vertex[k], duals = self._polytope.maximise(self._targets[k].weights)
            self._share[k] = np.abs(duals) / self._error[k]

    @property
    def ratio(self) -> Floats:
        """Return the guaranteed errors (T,) over those of the whole pool."""
        return self._error / self._best

    def choose(self, stops: Sequence[int]) -> None:
        """Choose exactly these stops."""
        self.chosen = list(stops)
        self._solve(range(len(self._targets)))

    def fill(self) -> None:
        """Choose for the worst target, while time lasts, the stop that its vertex contradicts most for its time."""
        open_targets = np.ones(len(self._targets), dtype=bool)
        passed = np.zeros(len(self._pool.stops), dtype=bool)
        passed[self.chosen] = True
        while open_targets.any() and not passed.all():
            worst = int(np.where(open_targets, self.ratio, 0.0).argmax())
            violation = np.abs(self._rows @ self._vertex[worst])
            gain = np.array([violation[stop.rows].max() for stop in self._pool.stops])
            worth = np.where(passed, 0.0, np.log(np.maximum(gain, 1.0)) / self._costs**PATIENCE)
            if worth.max() <= 1e-9:
                open_targets[worst] = False
                continue
            stop = int(worth.argmax())
            passed[stop] = True
            if seconds_of(self.programme([*self.chosen, stop])) > self._seconds:
                continue
            self.chosen.append(stop)
            rows = self._rows[self._pool.stops[stop].rows]
            self._solve(np.flatnonzero(np.abs(rows @ self._vertex.T).max(axis=0) > 1.0 + 1e-9))
            open_targets[:] = True

    @cached_property
    def _costs(self) -> Floats:
        """Return the approximate time (E,) of each stop, with the way to it [s]."""
        return np.array([WAY_S + seconds_of(stop.visits) for stop in self._pool.stops])

    def exchange(self) -> bool:
        """Leave out stops that the worst ratio does not need, and fill the time again; return True if the ratio
        fell."""
        before, ratio = list(self.chosen), float(self.ratio.max())
        use = (self.ratio[:, None] ** SHARP * self._share).sum(axis=0)
        uses = {stop: round(float(use[self._pool.stops[stop].rows].sum()), 9) for stop in before}
        for stop in sorted(before, key=lambda stop: (uses[stop], stop)):
            state = list(self.chosen), self._error.copy(), self._vertex.copy(), self._share.copy()
            self.chosen.remove(stop)
            self._solve(np.flatnonzero(self._share[:, self._pool.stops[stop].rows].sum(axis=1) > 0.0))
            if self.ratio.max() > ratio * (1.0 + SAME):
                self.chosen, self._error, self._vertex, self._share = state
        self.fill()
        if self.ratio.max() > ratio * (1.0 + SAME):
            self.choose(before)
            return False
        return True

    def programme(self, stops: Iterable[int]) -> list[TableVisit]:
        """Return the stops one after the other, each time the nearest one; rests at one place are joined."""
        longest: dict[Place, TableVisit] = {}
        turns: list[tuple[TableVisit, ...]] = []
        for stop in sorted(stops):
            first, *turn = self._pool.stops[stop].visits
            if turn:
                turns.append((first, *turn))
            elif first.place not in longest or longest[first.place].dwell_s < first.dwell_s:
                longest[first.place] = first
        parts: list[tuple[TableVisit, ...]] = []
        for first, *turn in turns:
            parts.append((longest.pop(first.place, first), *turn))
        for visit in longest.values():
            parts.append((visit,))
        path = list(parts.pop(0))
        while parts:
            last = path[-1]
            ways = [(part[0].way(last), part) for part in parts]
            following = parts.pop(ways.index(min(ways)))
            path += following[1:] if following[0].place == last.place else following
        return path


PRACTICE_DPS = (10.0, 50.0, 100.0)
LEAST_MINUTES, MOST_MINUTES = 5.0, 240.0
HELD_TO = 0.1
"""Relative tolerance to which a record of the programme keeps the promised errors: the effect of the bench's errors."""


class ImuVisit(Result):
    """A row of the programme: commands [deg] and rest [s]."""

    alpha_deg: Degrees
    beta_deg: Degrees
    dwell_s: Number


class Promised(Result):
    """The guaranteed error of a target that the programme promises, and that of the whole pool."""

    symbol: str
    name: str
    unit: str
    promised: float
    bound: float


class Practice(Result):
    """Result of another programme of the same length: the worst ratio to the bound, None if a target stays
    undetermined."""

    name: str
    worst_ratio: float | None
    worst: str
    minutes: float


class ImuPlan(Result):
    """A programme of turns and rests for the whole IMU.

    Attributes
    ----------
    programme : tuple of ImuVisit
        visits in order; further whole turns are whole turns of the table
    minutes : float
        duration [min]
    worst_ratio : float
        largest ratio of a promised error to the guarantee of all moves of the pool together; `worst` is its target
    targets : tuple of Promised
        promised error of each target
    practices : tuple of Practice
        usual programmes, in the same time
    held_to : float
        relative tolerance between a record's guaranteed errors and the promised ones
    noise_bound, gyro_noise, encoder_bound, rate_dps, acceleration_radps2, latitude_deg, azimuth_deg
        assumptions of the plan
    pool : int
        number of rests and turns to choose from
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
        """Return the programme, a row for each rest: alpha_deg, beta_deg, dwell_s."""
        import polars as pl

        return pl.DataFrame([one.to_json() for one in self.programme]).cast(pl.Float64)


def six_positions(dwell_s: float, rate_dps: float) -> list[TableVisit]:
    """Return six positions, each axis up and down, and a turn to and fro about each axis of the block."""
    rests: list[Place] = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (90.0, 90.0), (90.0, 180.0), (90.0, 270.0)]
    turns: list[Place] = [(0.0, 0.0), (360.0, 0.0), (0.0, 0.0), (0.0, 90.0), (360.0, 90.0), (0.0, 90.0), (0.0, 450.0)]
    return [TableVisit(alpha, beta, dwell_s, rate_dps) for alpha, beta in [*rests, *turns, (0.0, 90.0)]]


def many_positions(dwell_s: float, rate_dps: float) -> list[TableVisit]:
    """Return the 24 positions of the scenarios, and a turn to and fro at each rate about each axis of the block."""
    visits = []
    for beta in (25.0, 145.0, 265.0):
        for k in range(8):
            visits.append(TableVisit(20.0 + 45.0 * k, beta, dwell_s, rate_dps))
    for begin, turn in (((0.0, 0.0), (360.0, 0.0)), ((0.0, 90.0), (360.0, 90.0)), ((0.0, 0.0), (0.0, 360.0))):
        visits.append(TableVisit(*begin, dwell_s, rate_dps))
        for rate in PRACTICE_DPS:
            for place in (turn, begin):
                visits.append(TableVisit(*place, dwell_s, min(rate, rate_dps)))
    return visits


PRACTICES = {
    "six positions and three turns": six_positions,
    "24 positions and rates of 10, 50, 100 deg/s": many_positions,
}


def imu_programme(
    minutes: float, planned: Planned, *, dwell_s: float, rate_dps: float, exchanges: int, progress: bool = False
) -> ImuPlan:
    """Return the programme for this time [min]; arguments are those of `library.plan_imu`.

    Raises InputError for invalid options, and for a time in which no programme determines every target.
    """
    if not LEAST_MINUTES <= minutes <= MOST_MINUTES:
        raise InputError(f"--minutes {minutes:g}: must be from {LEAST_MINUTES:g} to {MOST_MINUTES:g}")
    if not 1.0 <= rate_dps <= 360.0:
        raise InputError(f"--rate-dps {rate_dps:g}: must be from 1 to 360 deg/s")
    checked_dwell(dwell_s)
    bench, seconds = planned.bench, 60.0 * minutes
    assert bench.gyro_noise is not None
    checked_noise_bound(planned.noise_bound)
    practices = {name: _in_time(practice, seconds, dwell_s, rate_dps) for name, practice in PRACTICES.items()}
    records = {name: planned.linearised(practice) for name, practice in practices.items()}
    pool = StopPool.of(planned, dwell_s, rate_dps, records.values())
    programme = _stretched(_chosen(pool, planned.targets, seconds, exchanges, progress=progress), seconds)
    if len(programme) < 2:
        raise InputError(
            f"--minutes {minutes:g}: is too little for rests of {dwell_s:g} s; give more, or a shorter --dwell"
        )
    record = planned.linearised(programme)
    errors, bound = planned.errors(record), joint_errors(pool, record, planned.targets)
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


def _chosen(
    pool: StopPool, targets: Sequence[Target], seconds: float, exchanges: int, *, progress: bool
) -> list[TableVisit]:
    """Return the programme of stops that the search chooses in this time [s]; empty if it is too short for two."""
    search = StopSearch(pool, targets, seconds)
    search.fill()
    with progress_bar("exchanges", exchanges, show=progress) as advance:
        for _ in range(exchanges):
            if not search.exchange():
                break
            advance(1, None)
    return search.programme(search.chosen) if len(search.chosen) >= 2 else []


def _stretched(programme: list[TableVisit], seconds: float) -> list[TableVisit]:
    """Return the programme with the remaining time given to its longest rests."""
    if not programme:
        return []
    dwells = [visit.dwell_s for visit in programme]
    longest = max(dwells)
    more = np.floor((seconds - seconds_of(programme)) / dwells.count(longest))
    longer = float(min(longest + more, LONG[-1] * min(dwells)))
    return [visit._replace(dwell_s=longer) if visit.dwell_s == longest else visit for visit in programme]


def _in_time(
    practice: Callable[[float, float], list[TableVisit]], seconds: float, dwell_s: float, rate: float
) -> list[TableVisit]:
    """Return a practice with rests as long as its time allows."""
    visits = practice(dwell_s, rate)
    return practice(max(dwell_s + (seconds - seconds_of(visits)) / len(visits), POOL_DWELL_S), rate)
