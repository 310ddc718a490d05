"""Cases, each an instrument with its secret, and what they read: the components simulated in time, effects composed in.

The diagnosis gets the record and nothing else.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import CATALOGUE, EffectPlace
from ..calibration.model import PRESETS
from ..diagnosis.result import NamedEffect
from ..diagnosis.sizes import SureSizes
from ..orchestrator import simulate
from ..orchestrator.scenario import Scenario
from ..records import PositionRecord, RawRecord, StrapdownRecord
from ..records.rests import average_rests, find_rests
from .bench import DWELL_S, NOISE_BOUND, START_APART, Bench, temperature_at
from .block import Instruments, TrueMotion, flicker_noise, without_coning

ENCODER_FLUCTUATION = math.radians(0.4 / 3600.0)
"""Bound of the fluctuation of each encoder [rad]; its effect on a reading stays below it, to 3 %."""
BLOCK_NOISE = NOISE_BOUND - 1.05 * ENCODER_FLUCTUATION
"""Bound of the block's own error [g]."""
STEP_S, FINE_STEP_S = 0.25, 0.05
LONGEST_RUN_S = 4000.0
"""The temperature is laid down for so long."""
RECORD_DECIMALS = 9
"""Decimals of a record's numbers, as laboratories write them."""
HELD = 0.9
"""What remains of an error that wanders, from one position to the next."""
BENCH_STREAM, BLOCK_STREAM = 1, 7
"""Numbers of the streams of random numbers that errors are drawn from."""
HELD_RATES, INCREMENTS = 2, 1
"""Kinds of input of the gyro block."""
FURTHEST_STAMP = 0.24
"""Time stamps jitter by at most so many periods."""
UNDERSAMPLING = "undersampling"
"""Not of a component that reads: the increments lack what the body's turning between two rows adds to them."""
STAMPS = "jitter"
"""The effect of the time stamps; its size is how far they jitter, the sampling being regular."""
UNIT_SIZES = SureSizes(detected=1.0, excluded=1.0, rival=None)
Reference = Literal["gravity", "truth"]


@dataclass(frozen=True)
class Hidden:
    """A hidden effect.

    Attributes
    ----------
    place : EffectPlace
    values : tuple of float
        its parameters
    size : float
        length of the vector of its linear coefficients, or in units of `sizes`; 1 for an effect that is not linear
    sizes : SureSizes
        from which it is surely detected, and every rival excluded, in the same measure
    """

    place: EffectPlace
    values: tuple[float, ...]
    size: float = 1.0
    sizes: SureSizes = UNIT_SIZES

    @property
    def relative_size(self) -> float:
        """Size over that of sure detection."""
        return self.size / self.sizes.detected

    @property
    def parameters(self) -> dict[str, float]:
        """Its parameters by name."""
        names = [parameter.name for parameter in CATALOGUE[self.place.effect].at(self.place).parameters]
        return dict(zip(names, self.values, strict=True))

    def entry(self) -> dict[str, Any]:
        """The effect as a scenario file writes it."""
        return {**NamedEffect.keys(self.place), **self.parameters}


@dataclass(frozen=True, eq=False)
class BenchCase:
    """A record of a table's positions to be made: a bench with its secret.

    Attributes
    ----------
    seed : int
    index : int or None
        of the case in its suite, with the seed it decides everything; None: a record by itself, as a laboratory makes
        it, whose errors vary within a rest and whose rests that drift are left out
    bench : Bench
    hidden : tuple of Hidden
        empty for a clean record
    noise : str
        "uniform", "edge" or "correlated"
    redrawn : int
        effects that were drawn and put aside, as no possible size would do
    """

    seed: int
    index: int | None
    bench: Bench
    hidden: tuple[Hidden, ...]
    noise: str = "uniform"
    redrawn: int = 0

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """What is hidden."""
        return tuple(hidden.place for hidden in self.hidden)

    def answer(self) -> dict[str, Any]:
        """The secret of a single record, for whoever wants to compare."""
        told = [{**NamedEffect.keys(hidden.place), "parameters": hidden.parameters} for hidden in self.hidden]
        return {"hidden": told[0] if told else {"effect": None}, "seed": self.seed, "truth": self.bench.truth}


@dataclass(frozen=True, eq=False)
class BlockCase:
    """A record of gyros and accelerometers moved by hand to be made, with its secret.

    Attributes
    ----------
    seed, index : int
    reference : "gravity" or "truth"
        what the record can be held against
    motion : TrueMotion
    instruments : Instruments
    temperature : (N + 1,) array or None
        [°C]; None: the record has none, and the block has 20 °C
    hidden : tuple of Hidden
        sizes relative to that of sure detection; empty for a clean record
    jitter : float
        bound of the errors of the time stamps, in periods; the sampling stays regular
    redrawn : int
        effects that were drawn before and could not be hidden
    """

    seed: int
    index: int
    reference: Reference
    motion: TrueMotion
    instruments: Instruments
    temperature: NDArray[np.float64] | None = None
    hidden: tuple[Hidden, ...] = ()
    jitter: float = 0.0
    redrawn: int = 0

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """What is hidden."""
        return tuple(hidden.place for hidden in self.hidden)

    def answer(self) -> dict[str, Any]:
        """The secret, for a file."""
        return {
            "seed": self.seed,
            "case": self.index,
            "reference": self.reference,
            "hidden": self.hidden[0].entry() if self.hidden else None,
            "size": self.hidden[0].relative_size if self.hidden else 0.0,
            "stamps_jitter_periods": self.jitter,
            "gyros": dict(self.instruments.gyros),
            "accelerometers": dict(self.instruments.accelerometers),
        }


Case = BenchCase | BlockCase


def measure(case: Case) -> PositionRecord | StrapdownRecord:
    """The record of a case: what a laboratory would hand over, and nothing else."""
    return measure_bench(case) if isinstance(case, BenchCase) else measure_block(case)


def measure_bench(case: BenchCase, *, progress: bool = False) -> PositionRecord:
    """Measure a bench; with `progress` show how far it is on standard error, where that is a terminal.

    Slews, dwells and temperature are simulated with the physical components. With two mountings the whole programme is
    run in each, and each gives the positions that are its own: the clock goes on. Uniform errors are the components'
    own; errors at ±σ, and those that wander, are added to the averaged readings. The record of a suite's case has nine
    decimals.
    """
    bench, alone = case.bench, case.index is None
    index = case.index or 0
    seed = case.seed if alone else int(np.random.default_rng([case.seed, index, 0]).integers(2**31))
    runs = [
        record_of(bench_scenario(case, k, seed + k), every=not alone, progress=progress)
        for k in range(len(bench.mountings))
    ]
    if not alone and any(len(run) != len(bench.alpha) for run in runs):
        raise ValueError(f"case {case.index} of seed {case.seed}: a rest of the programme was not found")
    record = _joined(bench, runs)
    error = np.zeros((len(record), 3))
    if case.noise != "uniform":
        rng = np.random.default_rng([case.seed, index, BENCH_STREAM])
        error = NOISE_BOUND * drawn_errors(rng, case.noise, len(bench.alpha))
    for hidden in case.hidden:
        if hidden.place.effect == "outlier":
            error[int(hidden.place.where.removeprefix("position-")) - 1, hidden.place.axes[0] - 1] += hidden.values[0]
    force = record.specific_force + STANDARD_GRAVITY * error
    if alone:
        return replace(record, specific_force=force)
    written = np.round(force, RECORD_DECIMALS)
    return replace(record, specific_force=written, resolution=0.5 * 10.0**-RECORD_DECIMALS)


def bench_scenario(case: BenchCase, mounting: int, seed: int) -> Scenario:
    """The scenario in which the table carries the block, in one of its mountings, from position to position.

    Parameters
    ----------
    case : BenchCase
    mounting : int
        number of the mounting
    seed : int
        of the components' errors
    """
    bench = case.bench
    own_errors = case.noise == "uniform"
    # Within a step it cannot be seen which axis changed an input last.
    fine = case.index is not None and any(place.effect == "hysteresis" for place in case.places)
    seconds = np.arange(0.0, LONGEST_RUN_S, 1.0)
    table = {
        **bench.truth["TurntableMotion"],
        "mounting": PRESETS[bench.mountings[mounting]].ravel().tolist(),
        "mounting_error": list(bench.mounting_errors[mounting]),
        "encoder_fluctuation_bound": ENCODER_FLUCTUATION if own_errors else 0.0,
        # Every position has a move before it, whose sense the record can tell.
        "initial_angle": [float(bench.alpha[0]) - START_APART, float(bench.beta[0]) - START_APART],
        "seed": seed % 2**31,
    }
    block = {
        **bench.truth["AccelerometerBlock"],
        "noise_bound": BLOCK_NOISE if own_errors else 0.0,
        # An error that is held over a rest is uniform within its bound; a mean of several would be small.
        "held_fraction": 0.8 if case.index is None else 1.0,
        "seed": seed % 2**31,
    }
    return _scenario(
        "a measured record",
        {"step_s": FINE_STEP_S if fine else STEP_S},
        {"table": ("TurntableMotion", table), "block": ("AccelerometerBlock", block)},
        case.hidden,
        connections=[
            {"from": "table.specific_force", "to": "block.specific_force"},
            {"from": "table.dwell", "to": "block.dwell"},
        ],
        stimuli=[
            {
                "to": "table.command",
                "table": {"alpha_deg": np.degrees(bench.alpha).tolist(), "beta_deg": np.degrees(bench.beta).tolist()},
                "dwell_s": DWELL_S,
            },
            {
                "table": {
                    "time_s": seconds.tolist(),
                    "temperature_degC": temperature_at(seconds / 3600.0).tolist(),
                },
                "columns": dict.fromkeys(("table.temperature", "block.temperature"), "temperature_degC"),
            },
        ],
        columns={
            "alpha_deg": "table.angle_reading[1]",
            "beta_deg": "table.angle_reading[2]",
            **{f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)},
            "temperature_degC": "block.temperature",
        },
    )


def _scenario(
    title: str,
    run: Mapping[str, float],
    fmus: Mapping[str, tuple[str, Mapping[str, Any]]],
    hidden: Sequence[Hidden],
    columns: Mapping[str, str],
    **parts: Any,
) -> Scenario:
    """A scenario of components (name -> component and parameters), each with the effects that extend it composed in."""
    effects = [(CATALOGUE[h.place.effect].component, h.entry()) for h in hidden if h.place.effect != "outlier"]
    return Scenario.model_validate(
        {
            "schema": "trihedron.scenario/1",
            "title": title,
            "run": run,
            "fmus": {
                name: {
                    "component": component,
                    "effects": [entry for extended, entry in effects if extended == component],
                    "parameters": parameters,
                }
                for name, (component, parameters) in fmus.items()
            },
            "record": {"columns": columns},
            **parts,
        }
    )


def record_of(scenario: Scenario, *, every: bool = False, progress: bool = False) -> PositionRecord:
    """Run a scenario of `bench_scenario` and average its rests; with `every` those too whose readings drift."""
    run = simulate(scenario, progress=progress).table
    raw = RawRecord(
        time_s=run["time_s"].to_numpy(),
        alpha=np.radians(run["alpha_deg"].to_numpy()),
        beta=np.radians(run["beta_deg"].to_numpy()),
        # Row by row in memory: means of columns would have other last bits.
        specific_force=np.stack([run[name].to_numpy() for name in columns_of("f")], axis=1),
        temperature=run["temperature_degC"].to_numpy(),
    )
    rests = find_rests(raw)
    return average_rests(raw, [replace(rest, refused=None) for rest in rests] if every else rests)


def _joined(bench: Bench, records: Sequence[PositionRecord]) -> PositionRecord:
    """Each mounting's own rows, in the order of the programme."""
    first = records[0]
    if len(records) == 1:
        return first
    rows = np.arange(len(bench.mounting))

    def own(name: str) -> NDArray | None:
        columns = [getattr(record, name) for record in records]
        return None if any(column is None for column in columns) else np.stack(columns)[bench.mounting, rows]

    names = ("time_s", "alpha", "beta", "specific_force", "temperature", "approach_alpha", "approach_beta", "scatter")
    columns: dict[str, Any] = {name: own(name) for name in names}
    return replace(first, mounting=tuple(bench.mountings[k] for k in bench.mounting), **columns)


def drawn_errors(rng: np.random.Generator, noise: str, count: int) -> NDArray:
    """Errors (count, 3) in units of σ: at ±1, or wandering within; more of them leave the first as they were."""
    signs = rng.choice([-1.0, 1.0], size=(count, 3))
    if noise == "edge":
        return signs
    errors, state = np.zeros_like(signs), np.zeros(3)
    for row, sign in enumerate(signs):
        state = HELD * state + (1.0 - HELD) * sign
        errors[row] = state
    return errors


def measure_block(case: BlockCase) -> StrapdownRecord:
    """Read the motion of a block with noise, its effects composed into the components."""
    if not 0.0 <= case.jitter <= FURTHEST_STAMP:
        raise ValueError(f"stamps may jitter by {FURTHEST_STAMP} periods, not {case.jitter}")
    motion, instruments, increments = case.motion, case.instruments, case.instruments.increments
    # Rates know nothing of the time stamps: only what is made of both is wrong.
    composed = [h for h in case.hidden if h.place.effect != STAMPS or increments]
    for hidden in composed:
        if hidden.place.effect == UNDERSAMPLING:
            motion, composed = without_coning(motion, hidden.values[0]), []
    seed = case.seed * 100_003 + case.index
    rng = np.random.default_rng([seed, BLOCK_STREAM])
    rows, period = len(motion), motion.period
    slow_rate = flicker_noise(rng, rows, period, instruments.gyro_noise.flicker)
    slow_force = flicker_noise(rng, rows, period, instruments.accelerometer_noise.flicker)
    if increments:
        given = np.vstack([np.zeros((1, 3)), motion.increment]) + period * slow_rate
    else:
        given = motion.rate + slow_rate
    force = STANDARD_GRAVITY * (motion.force + slow_force)
    warm = np.full(rows, 20.0) if case.temperature is None else case.temperature
    stamps = np.round(period * (np.arange(rows) + case.jitter * rng.uniform(-1.0, 1.0, rows)), 9)
    turns, forces = columns_of("w", increments), columns_of("f")
    table = pl.DataFrame(
        {
            "time_s": period * np.arange(1, rows),
            **dict(zip(turns, given[1:].T, strict=True)),
            **dict(zip(forces, force[1:].T, strict=True)),
            "temperature_degC": warm[1:],
            "interval_s": np.diff(stamps),
        }
    )
    shown = simulate(reading_scenario(table, period, instruments, composed, seed % 2**31)).table[1:]
    gyros = shown.select(turns).to_numpy()
    attitude = None
    if case.reference == "truth":
        wrong = Rotation.from_rotvec(rng.uniform(-1.0, 1.0, (rows, 3)) * instruments.truth_noise)
        seen = Rotation.from_quat(np.roll(motion.attitude, -1, axis=1)) * wrong
        attitude = np.roll(seen.as_quat(), 1, axis=1)[1:]
    return StrapdownRecord(
        time_s=stamps[1:],
        rate=None if increments else gyros,
        increment=gyros if increments else None,
        specific_force=shown.select(forces).to_numpy(),
        attitude=attitude,
        temperature=None if case.temperature is None else case.temperature[1:],
    )


def reading_scenario(
    table: pl.DataFrame, period: float, instruments: Instruments, hidden: Sequence[Hidden], seed: int
) -> Scenario:
    """The scenario in which both blocks read what a table gives them, one row a step."""
    kind = INCREMENTS if instruments.increments else HELD_RATES
    source, output = ("increment", "increment_reading") if instruments.increments else ("rate", "rate_reading")
    turns, forces = columns_of("w", instruments.increments), columns_of("f")
    driven = {f"gyros.{source}[{p}]": name for p, name in enumerate(turns, start=1)}
    driven["gyros.interval"] = "interval_s"
    for block in ("gyros", "accelerometers"):
        driven |= {f"{block}.specific_force[{p}]": name for p, name in enumerate(forces, start=1)}
        driven[f"{block}.temperature"] = "temperature_degC"
    gyros = {
        **instruments.gyros,
        "input_kind": kind,
        "noise_bound": instruments.gyro_noise.bound(period),
        "seed": seed,
    }
    accelerometers = {
        **instruments.accelerometers,
        "noise_bound": instruments.accelerometer_noise.bound(period),
        "held_fraction": 0.0,
        "seed": seed,
    }
    return _scenario(
        "a block that is moved by hand",
        {"step_s": period, "stop_s": len(table) * period},
        {"gyros": ("GyroBlock", gyros), "accelerometers": ("AccelerometerBlock", accelerometers)},
        hidden,
        stimuli=[{"table": table, "stamp": "end", "columns": driven}],
        columns={
            **{name: f"gyros.{output}[{p}]" for p, name in enumerate(turns, start=1)},
            **{name: f"accelerometers.reading[{p}]" for p, name in enumerate(forces, start=1)},
        },
    )


def columns_of(letter: str, increments: bool = False) -> list[str]:
    """Names of three columns of a table, with their units."""
    unit = "mps2" if letter == "f" else "rad" if increments else "radps"
    return [f"{letter}{p}_{unit}" for p in (1, 2, 3)]
