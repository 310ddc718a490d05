"""A block of small instruments moved by hand: its motion, exact to rounding, its errors, noise and readings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
import polars as pl
import scipy
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats
from ...models.harmonic_motion import HARMONICS
from ..evidence.fit import composed
from ..motion.compare import sample_motion
from ..orchestrator import run_scenario
from ..orchestrator.scenario import Scenario
from ..records import StrapdownRecord
from .sizes import RECORD_DECIMALS, Hidden

UP = np.array([0.0, 0.0, 1.0])
LARGEST_SWING = 1.2
"""Largest angle of a move about its middle [rad]."""
LARGEST_WIGGLE = 0.4
"""Largest angle of the part of a move that returns to its beginning [rad]."""
LARGEST_PUSH = 0.25
"""Linear acceleration of the hand [g]."""
OCTAVES = 4.0
"""Ratio of the time constants of neighbouring processes, whose sum is nearly flicker noise."""
ERRORS = 7
"""Number of the random stream of the errors."""
HELD_RATES, INCREMENTS = 2, 1
"""Kinds of input of the gyro block."""
FURTHEST_STAMP = 0.24
"""Largest jitter of time stamps [periods]."""
UNDERSAMPLING = "undersampling"
"""Effect that belongs to no component: the increments lack the coning within a row."""
STAMPS = "jitter"
"""Effect of the time stamps; its size is the jitter, with regular sampling."""
Reference = Literal["gravity", "truth"]


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """Motion of the block, at N + 1 rows a period apart."""

    period: float
    """period [s]"""
    increment: Floats
    """(N, 3): integrals of the rate between the rows, in block axes [rad]"""
    rate: Floats
    """(N + 1, 3): rates at the rows [rad/s]"""
    attitude: Floats
    """(N + 1, 4) quaternions, scalar first, body to a reference whose third axis is up"""
    force: Floats
    """(N + 1, 3): specific force at the rows, in block axes [g]"""

    def __len__(self) -> int:
        return len(self.rate)


@dataclass(frozen=True)
class Schedule:
    """Ranges of the lengths of rests and moves [s]."""

    moves: tuple[int, int]
    """fewest and most moves"""
    first_rest: tuple[float, float]
    rest: tuple[float, float]
    move: tuple[float, float]


BETWEEN_RESTS = Schedule(moves=(20, 30), first_rest=(20.0, 30.0), rest=(3.0, 6.0), move=(1.2, 3.0))
"""A record made for calibration: gravity is the reference at each rest."""
BEFORE_A_CAMERA = Schedule(moves=(14, 22), first_rest=(20.0, 30.0), rest=(0.5, 2.0), move=(2.5, 6.0))
"""A record with a measured true attitude: mostly in motion."""


@dataclass(frozen=True)
class BlockNoise:
    """Errors of three instruments."""

    white: float
    """one-sided density of the white noise [unit/√Hz]"""
    flicker: float
    """flat part of the Allan deviation [unit]"""

    def bound(self, period: float) -> float:
        """Return the bound of uniform errors of this density, one drawn every period [unit]."""
        return math.sqrt(3.0) * self.white / math.sqrt(2.0 * period)


@dataclass(frozen=True)
class Instruments:
    """Known errors of a block, as components take them, and its noise."""

    gyros: Mapping[str, object]
    accelerometers: Mapping[str, object]
    """parameters of the components"""
    gyro_noise: BlockNoise
    accelerometer_noise: BlockNoise
    """[rad/s], [g]"""
    truth_noise: float
    """bound of each component of the error of the true attitude, a rotation vector [rad]"""
    increments: bool
    """True if the gyros put out increments; else they put out rates, at the rows"""

    @property
    def columns(self) -> tuple[list[str], list[str]]:
        """Names of the gyros' and the accelerometers' columns, with their units."""
        unit = "radps"
        if self.increments:
            unit = "rad"
        return [f"w{p}_{unit}" for p in (1, 2, 3)], [f"f{p}_mps2" for p in (1, 2, 3)]


@dataclass(frozen=True, eq=False)
class Block:
    """A block in the hand, and the references for its record."""

    reference: Reference
    motion: TrueMotion
    instruments: Instruments
    temperature: Floats | None = None
    """(N + 1,) [°C]; None: the record has none, and the block has 20 °C"""
    jitter: float = 0.0
    """bound of the errors of the time stamps, in periods; the sampling stays regular"""

    asked: ClassVar[dict[str, Any]] = {}
    """Facts known beside the record: none."""
    table: ClassVar[None] = None
    """Parameters of a table: there is none."""
    decimals: ClassVar[int] = RECORD_DECIMALS
    """decimals of the numbers of its record"""

    def as_measured(self, record: StrapdownRecord) -> StrapdownRecord:
        """Return the record as a laboratory has it."""
        return record

    def as_recorded(self, hidden: Sequence[Hidden], sources: Any) -> tuple[Hidden, ...]:
        """Return the hidden effects unchanged: the record's clock is that of the run."""
        return tuple(hidden)

    def answer(self, seed: int, index: int | None, hidden: Sequence[Hidden]) -> dict[str, Any]:
        """Return the secret and the facts beside the instrument, for a comparison."""
        hidden_entry, relative_size = None, 0.0
        if hidden:
            hidden_entry, relative_size = hidden[0].entry, hidden[0].relative_size
        return {
            "seed": seed,
            "case": index,
            "reference": self.reference,
            "hidden": hidden_entry,
            "size": relative_size,
            "stamps_jitter_periods": self.jitter,
            "gyros": dict(self.instruments.gyros),
            "accelerometers": dict(self.instruments.accelerometers),
        }

    def told(self, seed: int, index: int, hidden: Sequence[Hidden]) -> dict[str, Any]:
        """Return the case's part of its outcome."""
        return {**self.answer(seed, index, hidden), "rows": len(self.motion) - 1}

    def measured(
        self, seed: int, index: int | None = None, hidden: Sequence[Hidden] = (), *, progress: bool = False
    ) -> StrapdownRecord:
        """Return the simulated readings of the block's motion, with noise and composed effects; arguments as for a
        bench."""
        if not 0.0 <= self.jitter <= FURTHEST_STAMP:
            raise ValueError(f"stamps may jitter by {FURTHEST_STAMP} periods, not {self.jitter}")
        motion, instruments, increments = self.motion, self.instruments, self.instruments.increments
        # Rates do not depend on the time stamps: only combinations of both are wrong.
        effects = []
        for effect in hidden:
            if effect.place.effect != STAMPS or increments:
                effects.append(effect)
        for effect in effects:
            if effect.place.effect == UNDERSAMPLING:
                motion = replace(motion, increment=without_coning(motion.increment, effect.values[0]))
                effects = []
        seed = seed * 100_003 + (index or 0)
        rng = np.random.default_rng([seed, ERRORS])
        rows, period = len(motion), motion.period
        slow_rate = flicker_noise(rng, rows, period, instruments.gyro_noise.flicker)
        slow_force = flicker_noise(rng, rows, period, instruments.accelerometer_noise.flicker)
        if increments:
            true_turns = np.vstack([np.zeros((1, 3)), motion.increment]) + period * slow_rate
        else:
            true_turns = motion.rate + slow_rate
        force = STANDARD_GRAVITY * (motion.force + slow_force)
        if self.temperature is None:
            warm = np.full(rows, 20.0)
        else:
            warm = self.temperature
        stamps = np.round(period * (np.arange(rows) + self.jitter * rng.uniform(-1.0, 1.0, rows)), 9)
        turns, forces = instruments.columns
        table = pl.DataFrame(
            {
                "time_s": period * np.arange(1, rows),
                **dict(zip(turns, true_turns[1:].T, strict=True)),
                **dict(zip(forces, force[1:].T, strict=True)),
                "temperature_degC": warm[1:],
                "interval_s": np.diff(stamps),
            }
        )
        readings = run_scenario(
            reading_scenario(table, period, instruments, effects, seed % 2**31), progress=progress
        ).table[1:]
        gyros = readings.select(turns).to_numpy()
        attitude = None
        if self.reference == "truth":
            wrong = Rotation.from_rotvec(rng.uniform(-1.0, 1.0, (rows, 3)) * instruments.truth_noise)
            observed = Rotation.from_quat(np.roll(motion.attitude, -1, axis=1)) * wrong
            attitude = np.roll(observed.as_quat(), 1, axis=1)[1:]
        rates, increments_read = gyros, None
        if increments:
            rates, increments_read = None, gyros
        temperature = None
        if self.temperature is not None:
            temperature = self.temperature[1:]
        return StrapdownRecord(
            time_s=stamps[1:],
            rate=rates,
            increment=increments_read,
            specific_force=readings.select(forces).to_numpy(),
            attitude=attitude,
            temperature=temperature,
        )


def reading_scenario(
    table: pl.DataFrame, period: float, instruments: Instruments, hidden: Sequence[Hidden], seed: int
) -> Scenario:
    """Return the scenario in which both blocks read the values of a table, one row a step."""
    if instruments.increments:
        kind, source, output = INCREMENTS, "increment", "increment_reading"
    else:
        kind, source, output = HELD_RATES, "rate", "rate_reading"
    turns, forces = instruments.columns
    driven = {}
    for p, name in enumerate(turns, start=1):
        driven[f"gyros.{source}[{p}]"] = name
    driven["gyros.interval"] = "interval_s"
    for block in ("gyros", "accelerometers"):
        for p, name in enumerate(forces, start=1):
            driven[f"{block}.specific_force[{p}]"] = name
        driven[f"{block}.temperature"] = "temperature_degC"
    gyros = {"input_kind": kind, "noise_bound": instruments.gyro_noise.bound(period), "seed": seed}
    noise_bound = instruments.accelerometer_noise.bound(period)
    accelerometers = {"noise_bound": noise_bound, "held_fraction": 0.0, "seed": seed}
    gyro_columns = {}
    for p, name in enumerate(turns, start=1):
        gyro_columns[name] = f"gyros.{output}[{p}]"
    force_columns = {}
    for p, name in enumerate(forces, start=1):
        force_columns[name] = f"accelerometers.reading[{p}]"
    return composed(
        "a block that is moved by hand",
        {
            "gyros": ("GyroBlock", {**instruments.gyros, **gyros}),
            "accelerometers": ("AccelerometerBlock", {**instruments.accelerometers, **accelerometers}),
        },
        [effect.entry for effect in hidden],
        gyro_columns | force_columns,
        run={"step_s": period, "stop_s": len(table) * period},
        stimuli=[{"table": table, "stamp": "end", "columns": driven}],
    )


def draw_instruments(rng: np.random.Generator, *, delivered: bool) -> Instruments:
    """Draw a block of small instruments; `delivered` gyros have correct scale factors."""
    scale = rng.uniform(-0.01, 0.01, 3).tolist()
    gyros: dict[str, object] = {"bias": rng.uniform(-0.02, 0.02, 3).tolist()}
    gamma = rng.uniform(-0.01, 0.01, 9).tolist()
    if not delivered:
        gyros["scale_misalignment"] = gamma
    accelerometers: dict[str, object] = {
        "scale_error_plus": scale,
        "scale_error_minus": scale,
        "bias": rng.uniform(-0.02, 0.02, 3).tolist(),
        **{f"gamma_{ij}": float(rng.uniform(-0.01, 0.01)) for ij in ("21", "31", "32")},
    }

    def between(low: float, high: float) -> float:
        """Draw a number between two, uniform in its logarithm."""
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    return Instruments(
        gyros=gyros,
        accelerometers=accelerometers,
        gyro_noise=BlockNoise(math.radians(between(2e-3, 1.5e-2)), math.radians(between(2.0, 20.0) / 3600.0)),
        accelerometer_noise=BlockNoise(between(2e-5, 4e-4), between(4e-6, 6e-5)),
        truth_noise=math.radians(rng.uniform(0.005, 0.02)),
        increments=bool(rng.random() < 0.5),
    )


def draw_motion(rng: np.random.Generator, schedule: Schedule, period: float) -> TrueMotion:
    """Draw rests and moves, one after the other; the motion ends with a rest."""
    increments, rates, attitudes, pushes = [], [], [], []
    attitude = Rotation.from_quat(rng.normal(size=4))
    count = int(rng.integers(schedule.moves[0], schedule.moves[1] + 1))
    for k in range(count + 1):
        if k == 0:
            limits = schedule.first_rest
        else:
            limits = schedule.rest
        still = round(rng.uniform(*limits) / period)
        # The first row is the start; each rest and each move adds the rows after its own beginning.
        increments.append(np.zeros((still, 3)))
        rates.append(np.zeros((still + (k == 0), 3)))
        attitudes.append(np.tile(attitude.as_quat(), (still + (k == 0), 1)))
        pushes.append(np.zeros((still + (k == 0), 3)))
        if k == count:
            break
        rows = round(rng.uniform(*schedule.move) / period)
        harmonics = draw_move(rng, rows * period)
        angles, rate = angles_and_rates(harmonics, period * np.arange(rows + 1))
        turned = Rotation.from_euler("YZX", angles)
        path = attitude * turned[0].inv() * turned[1:]
        increments.append(sample_motion(harmonics.ravel(), period, rows).increments)
        rates.append(rate[1:])
        attitudes.append(path.as_quat())
        s = np.arange(1, rows + 1) / rows
        shape = np.sin(np.pi * s) ** 2 * np.sin(2.0 * np.pi * s + rng.uniform(0.0, 2.0 * math.pi))
        pushes.append(shape[:, None] * rng.uniform(-LARGEST_PUSH, LARGEST_PUSH, 3))
        attitude = path[-1]
    every = Rotation.from_quat(np.vstack(attitudes))
    return TrueMotion(
        period=period,
        increment=np.vstack(increments),
        rate=np.vstack(rates),
        attitude=np.roll(every.as_quat(), 1, axis=1),
        force=every.inv().apply(np.vstack(pushes) + UP),
    )


def draw_move(rng: np.random.Generator, seconds: float) -> Floats:
    """Draw harmonics (3, 4, 3) of a move as `HarmonicMotion` takes them: amplitude, circular frequency, phase of each.

    Angles are cosines of half a turn, a turn, a turn and a half and two turns over the move, so their rates vanish at
    both ends. The accelerations vanish too, with a third harmonic of -1/9 of the first and a fourth of -1/4 of the
    second.
    """
    harmonics = np.zeros((3, HARMONICS, 3))
    harmonics[:, :, 1] = math.pi / seconds * np.arange(1, HARMONICS + 1)
    harmonics[:, :, 2] = 0.5 * math.pi
    swing, wiggle = rng.uniform(-LARGEST_SWING, LARGEST_SWING, 3), rng.uniform(-LARGEST_WIGGLE, LARGEST_WIGGLE, 3)
    harmonics[:, :, 0] = np.stack([swing, wiggle, -swing / 9.0, -wiggle / 4.0], axis=1)
    return harmonics


def angles_and_rates(harmonics: NDArray, time: NDArray) -> tuple[NDArray, NDArray]:
    """Return angles ψ, ϑ, γ (N, 3) and body rates (N, 3) of a harmonic motion at times (N,)."""
    amplitude, frequency, phase = np.moveaxis(harmonics, 2, 0)
    argument = frequency * time[:, None, None] + phase
    angles = (amplitude * np.sin(argument)).sum(axis=2)
    turning = (amplitude * frequency * np.cos(argument)).sum(axis=2)
    sines, cosines = np.sin(angles), np.cos(angles)
    across = turning[:, 0] * cosines[:, 1]
    return angles, np.stack(
        [
            turning[:, 2] + turning[:, 0] * sines[:, 1],
            across * cosines[:, 2] + turning[:, 1] * sines[:, 2],
            turning[:, 1] * cosines[:, 2] - across * sines[:, 2],
        ],
        axis=1,
    )


def without_coning(increment: NDArray, coefficient: float) -> Floats:
    """Return increments (N, 3) that lack c γ' × γ, with γ' the previous increment: those of a unit that sums rates."""
    before = np.vstack([increment[:1], increment[:-1]])
    return increment - coefficient * np.cross(before, increment)


def flicker_noise(rng: np.random.Generator, rows: int, period: float, coefficient: float) -> Floats:
    """Draw flicker noise (rows, 3): a sum of bounded processes of the first order, time constants from rows to record.

    The period is in s; the coefficient is the flat part of the noise's Allan deviation, in its unit.
    """
    total = np.zeros((rows, 3))
    # Flicker noise has equal mean square in each octave of time; its Allan variance is 2 ln 2 of that in e-folds.
    amplitude = coefficient * math.sqrt(math.log(OCTAVES) / (2.0 * math.log(2.0)))
    time = 2.0 * period
    while time < 2.0 * rows * period:
        decay = math.exp(-period / time)
        drive = rng.uniform(-1.0, 1.0, (rows, 3)) * math.sqrt(3.0 * (1.0 - decay**2))
        # Draw the initial state from the process's stationary distribution.
        drive[0] = rng.uniform(-math.sqrt(3.0), math.sqrt(3.0), 3)
        total += amplitude * np.asarray(scipy.signal.lfilter([1.0], [1.0, -decay], drive, axis=0))
        time *= OCTAVES
    return total
