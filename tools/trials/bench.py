"""Benches for hidden effects: true parameters, mountings, positions in random order, and simulated readings.

A bench has a table and accelerometers; a whole bench also has gyros, which sense the table's turns. The components are
simulated in time, with composed effects.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.bench import ELEMENTARY
from ..calibration.gyros import BenchOnEarth as Place
from ..calibration.model import PRESETS
from ..diagnosis.cause import NamedEffect
from ..evidence.fit import composed
from ..evidence.observation import OF_GYROS
from ..evidence.of_record import plain
from ..orchestrator import run_scenario
from ..orchestrator.scenario import Scenario
from ..records import PositionRecord, RawRecord, read_record
from ..records.rests import average_rests, find_rests
from .block import UNDERSAMPLING, without_coning
from .sizes import RECORD_DECIMALS, Hidden, Secret

NOISE_BOUND = 1e-5
"""σ of the records: bound of the sum of the block's error and the encoders' fluctuation."""
STAND_BOUND, BLOCK_BOUND = 3e-3, 1e-2
"""The paper's bounds of the bench's and the block's errors."""
DWELL_S = 6.0
"""Rest at each position [s]."""
START_APART = 0.3
"""Distance of the table's start from its first position [rad]."""
SYMMETRIC_SHARE = 0.25
"""Share of the benches whose scale factors do not depend on the sign, and whose diagnosis assumes so."""
TWO_MOUNTINGS_SHARE = 0.25
FEWEST_FOR_TWO = 24
"""Fewest positions with which there may be two mountings."""
RATE = ACCELERATION = math.radians(60.0)
"""Limits of the table's moves, the component's defaults [rad/s], [rad/s²]."""
ENCODER_FLUCTUATION = math.radians(0.4 / 3600.0)
"""Bound of the fluctuation of each encoder [rad]; its effect on a reading stays below it, to 3 %."""
BLOCK_NOISE = NOISE_BOUND - 1.05 * ENCODER_FLUCTUATION
"""Bound of the block's own error [g]."""
STEP_S, FINE_STEP_S = 0.25, 0.05
"""Steps of a run without gyros [s]; the finer one for effects that depend on which axis moved last."""
LONGEST_RUN_S = 4000.0
"""Time for which the temperature is defined [s]."""
HELD = 0.9
"""Part of a wandering error that remains from one position to the next."""
ERRORS = 1
"""Number of the random stream of the errors."""


WHOLE_STEP_S, WHOLE_DWELL_S = 0.02, 4.0
"""Step of a whole bench's record and rest at each position [s]."""
ROW_NOISE, GYRO_NOISE = 8e-6, 4e-6
"""Bounds of a gyro's error in one row and of its mean over one second, six standard deviations [rad/s]: 0.002°/√h."""
POSITIONS = (24, 40)
"""Fewest and most positions between which the table takes the shorter way."""
TURNS = ((720.0, 0.0), (0.0, 90.0), (720.0, 90.0), (0.0, 180.0), (720.0, 270.0), (90.0, 270.0), (90.0, 990.0))
"""Further positions [deg]: whole turns about the outer axis at several inner angles, then about the inner one."""


@dataclass(frozen=True)
class TrialBench:
    """A bench and its programme of positions.

    Attributes
    ----------
    truth : dict
        component -> variable -> value; a whole bench has a "GyroBlock"
    symmetric : bool
        True if the block's scale factors do not depend on the sign
    mountings : tuple of str
        presets, one or two
    mounting_errors : tuple
        rotation vector [rad] of each mounting
    alpha, beta : (N,) array
        commanded angles [rad]; those of a whole bench count whole turns
    mounting : (N,) array
        index of the mounting of each position
    noise : str
        one of "uniform", "edge" and "correlated"
    latitude, azimuth : float
        latitude, and azimuth of the outer axis, of a whole bench [rad]
    step_s : float
        step of a whole bench's record [s]
    """

    truth: dict[str, dict[str, Any]]
    symmetric: bool
    mountings: tuple[str, ...]
    mounting_errors: tuple[tuple[float, ...], ...]
    alpha: NDArray
    beta: NDArray
    mounting: NDArray
    noise: str = "uniform"
    latitude: float = 0.0
    azimuth: float = 0.0
    step_s: float = WHOLE_STEP_S

    reference: ClassVar[None] = None
    """Reference of a record; a bench needs none."""

    @property
    def whole(self) -> bool:
        """True if it has gyros."""
        return "GyroBlock" in self.truth

    @property
    def decimals(self) -> int | None:
        """Decimals of the numbers of its record; None: all digits are written."""
        if self.whole:
            return None
        return RECORD_DECIMALS

    @property
    def baseline(self) -> Literal["asymmetric", "symmetric"]:
        """Model of the bench's diagnosis."""
        if self.symmetric:
            return "symmetric"
        return "asymmetric"

    @property
    def place(self) -> Place:
        """Place and bounds that a laboratory would state for its whole bench."""
        latitude, azimuth = math.degrees(self.latitude), math.degrees(self.azimuth)
        return Place(latitude, azimuth, GYRO_NOISE, encoder_bound=ENCODER_FLUCTUATION)

    @property
    def asked(self) -> dict[str, Any]:
        """Facts known beside the record: σ, the mountings, the kind of block, and the place of a whole bench."""
        options = {"baseline": self.baseline, "mounting": self.matrices, "noise_bound": NOISE_BOUND}
        if self.whole:
            return options | {"bench": self.place}
        return options

    @property
    def matrices(self) -> dict[str, NDArray]:
        """Q by name."""
        return {name: PRESETS[name] for name in self.mountings}

    @property
    def table(self) -> Mapping[str, Any]:
        """The true parameters of the table."""
        return self.truth["TurntableMotion"]

    def as_measured(self, record: PositionRecord) -> PositionRecord | RawRecord:
        """Return the record as a laboratory has it: for a whole bench the series, not its rests."""
        if not self.whole:
            return record
        assert record.raw is not None
        return record.raw

    def as_recorded(self, hidden: Sequence[Hidden], sources: Any) -> tuple[Hidden, ...]:
        """Return the hidden effects on the record's own clock, which begins at its first rest.

        An effect that changes within a rest may make part of it unusable. Effects of gyros count from the record's
        first row, as in the run. By then a mounting that drifts has turned, by a; the record calls the turned one the
        mounting. A later turn x is then x - a × x / 2, the next term of the product of two rotations.
        """
        circumstances = sources.circumstances
        warm, hours = None, circumstances.began / 3600.0
        if circumstances.temperature is not None:
            warm = (float(temperature_at(np.zeros(1))[0]), float(circumstances.temperature[0]))
        turned = np.zeros(3)
        for effect in hidden:
            if effect.place.effect == "mounting-drift":
                turned += hours * np.array(effect.values)
        recorded = []
        for effect in hidden:
            if self.whole and effect.place.definition.component in OF_GYROS:
                recorded.append(effect)
            elif effect.place.effect == "mounting-temperature":
                slopes = np.array(effect.values)
                recorded.append(replace(effect, values=tuple((slopes - 0.5 * np.cross(turned, slopes)).tolist())))
            else:
                recorded.append(effect.since(hours, warm))
        return tuple(recorded)

    def answer(self, seed: int, index: int | None, hidden: Sequence[Hidden]) -> dict[str, Any]:
        """Return the secret and the true parameters, for a comparison."""
        secret: dict[str, Any] = {"effect": None}
        if hidden:
            secret = {**NamedEffect.keys(hidden[0].place), "parameters": hidden[0].parameters}
        return {"hidden": secret, "seed": seed, "truth": self.truth}

    def told(self, seed: int, index: int, hidden: Sequence[Hidden]) -> dict[str, Any]:
        """Return the case's part of its outcome."""
        return {
            "seed": seed,
            "case": index,
            "positions": len(self.alpha),
            "mountings": self.mountings,
            "baseline": self.baseline,
            "noise": self.noise,
            "hidden": tuple(map(Secret.hidden, hidden)),
        }

    def measured(
        self, seed: int, index: int | None = None, hidden: Sequence[Hidden] = (), *, progress: bool = False
    ) -> PositionRecord:
        """Return the simulated readings of the bench with a secret; `progress` shows a bar on standard error, on a
        terminal.

        With the index of the case in its suite the seed decides everything, and the record has nine decimals. Without
        an index it is a single record, as a laboratory makes it: errors vary within rests, and rests that drift are
        left out. For a whole bench these are the rests of the series.

        Slews, dwells and temperature are simulated with the physical components. With two mountings the whole programme
        runs in each, and each gives its own positions: the clock continues. Uniform errors are the components' own;
        errors at ±σ, and wandering ones, are added to the averaged readings.
        """
        if self.whole:
            return self._measured_whole(seed * 100_003 + (index or 0), hidden, progress=progress)
        alone = index is None
        if alone:
            first = seed
        else:
            first = int(np.random.default_rng([seed, index, 0]).integers(2**31))
        runs = []
        for mounting in range(len(self.mountings)):
            scenario = self.scenario(hidden, first + mounting, mounting, alone=alone)
            runs.append(averaged_run(scenario, every=not alone, progress=progress))
        if not alone and any(len(run) != len(self.alpha) for run in runs):
            raise ValueError(f"case {index} of seed {seed}: a rest of the programme was not found")
        record = self._joined(runs)
        error = np.zeros((len(record), 3))
        if self.noise != "uniform":
            rng = np.random.default_rng([seed, index or 0, ERRORS])
            error = NOISE_BOUND * drawn_errors(rng, self.noise, len(error))
        for effect in hidden:
            if effect.place.effect == "outlier":
                row = int(effect.place.where.removeprefix("position-")) - 1
                error[row, effect.place.axes[0] - 1] += effect.values[0]
        force = record.specific_force + STANDARD_GRAVITY * error
        if alone:
            return replace(record, specific_force=force)
        written = np.round(force, RECORD_DECIMALS)
        return replace(record, specific_force=written, resolution=0.5 * 10.0**-RECORD_DECIMALS)

    def _measured_whole(self, seed: int, hidden: Sequence[Hidden], *, progress: bool) -> PositionRecord:
        rests = read_record(run_scenario(self.scenario(hidden, seed), progress=progress).table, PositionRecord)
        raw: Any = rests.raw
        for effect in hidden:
            if effect.place.effect == UNDERSAMPLING and raw.increment is not None:
                raw = replace(raw, increment=without_coning(raw.increment, effect.values[0]))
        about = {name: str(value) for name, value in vars(self.place).items() if value is not None}
        return replace(rests, raw=replace(raw, about=about))

    def scenario(self, hidden: Sequence[Hidden], seed: int, mounting: int = 0, *, alone: bool = True) -> Scenario:
        """Return the scenario in which the table carries the blocks, in this mounting, from position to position.

        `seed` is that of the components' errors; with `alone`, errors vary within rests.
        """
        own_errors = self.noise == "uniform"
        angles_deg = np.degrees([self.alpha, self.beta])
        # Every position has a move before it, whose sense the record shows.
        initial = [float(self.alpha[0]) - START_APART, float(self.beta[0]) - START_APART]
        dwell_s, step_s = DWELL_S, STEP_S
        place, gyros = {}, {}
        if self.whole:
            # Use the first command's own digits: a rounding error would be a move whose sense no record shows.
            initial = np.radians(angles_deg[:, 0]).tolist()
            dwell_s, step_s = WHOLE_DWELL_S, self.step_s
            place = {"latitude": self.latitude, "azimuth": self.azimuth}
            parameters = {**self.truth["GyroBlock"], "noise_bound": ROW_NOISE, "seed": (seed + 2) % 2**31}
            gyros = {"gyros": ("GyroBlock", parameters)}
        elif not alone and any(effect.place.effect == "hysteresis" for effect in hidden):
            # Within a step the order in which the axes changed an input is invisible.
            step_s = FINE_STEP_S
        fluctuation = 0.0
        if own_errors:
            fluctuation = ENCODER_FLUCTUATION
        table = {
            **self.truth["TurntableMotion"],
            "mounting": PRESETS[self.mountings[mounting]].ravel().tolist(),
            "mounting_error": list(self.mounting_errors[mounting]),
            "encoder_fluctuation_bound": fluctuation,
            "initial_angle": initial,
            **place,
            "seed": seed % 2**31,
        }
        noise = 0.0
        if own_errors:
            noise = BLOCK_NOISE
        # An error that is constant over a rest is uniform within its bound; a mean of several would be small.
        held_fraction = 1.0
        if alone:
            held_fraction = 0.8
        block = {
            **self.truth["AccelerometerBlock"],
            "noise_bound": noise,
            "held_fraction": held_fraction,
            "seed": (seed + self.whole) % 2**31,
        }
        seconds = np.arange(0.0, LONGEST_RUN_S, 1.0)
        warmth = {"time_s": seconds.tolist(), "temperature_degC": temperature_at(seconds / 3600.0).tolist()}
        wires = [("table", "block", name, name) for name in ("specific_force", "angle", "dwell")]
        increments = {}
        if self.whole:
            wires.append(("table", "block", "block_rate", "rate"))
            wires += [("table", "gyros", name, name) for name in ("increment", "specific_force")]
            increments = {}
            for p in (1, 2, 3):
                increments[f"dtheta{p}_rad"] = f"gyros.increment_reading[{p}]"
        warmed = [f"{name}.temperature" for name in ("table", "block", *gyros)]
        effect_entries = []
        for effect in hidden:
            if effect.place.effect not in ("outlier", UNDERSAMPLING):
                effect_entries.append(effect.entry)
        return composed(
            "a measured record",
            {"table": ("TurntableMotion", table), "block": ("AccelerometerBlock", block), **gyros},
            effect_entries,
            {
                "alpha_deg": "table.angle_reading[1]",
                "beta_deg": "table.angle_reading[2]",
                **increments,
                **{f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)},
                "temperature_degC": "block.temperature",
            },
            run={"step_s": step_s},
            connections=[{"from": f"{a}.{out}", "to": f"{b}.{into}"} for a, b, out, into in wires],
            stimuli=[
                {
                    "to": "table.command",
                    "table": {"alpha_deg": angles_deg[0].tolist(), "beta_deg": angles_deg[1].tolist()},
                    "dwell_s": dwell_s,
                },
                {"table": warmth, "columns": dict.fromkeys(warmed, "temperature_degC")},
            ],
        )

    def _joined(self, records: Sequence[PositionRecord]) -> PositionRecord:
        """Return each mounting's own rows, in the order of the programme."""
        first = records[0]
        if len(records) == 1:
            return first
        rows = np.arange(len(self.mounting))
        columns: dict[str, Any] = {}
        angles = ("alpha", "beta", "approach_alpha", "approach_beta")
        for name in ("time_s", *angles, "specific_force", "temperature", "scatter"):
            runs = [getattr(record, name) for record in records]
            columns[name] = None
            if not any(run is None for run in runs):
                columns[name] = np.stack(runs)[self.mounting, rows]
        return replace(first, mounting=tuple(self.mountings[k] for k in self.mounting), **columns)


def plain_bench(truth: dict[str, dict[str, Any]], alpha: NDArray, beta: NDArray, *, symmetric: bool) -> TrialBench:
    """Return a bench in the mounting `identity`, with the mounting error of its true parameters."""
    error = tuple(truth["TurntableMotion"]["mounting_error"])
    return TrialBench(truth, symmetric, ("identity",), (error,), alpha, beta, np.zeros(len(alpha), dtype=int))


def draw_bench(rng: np.random.Generator, positions: tuple[int, int]) -> TrialBench:
    """Draw a bench within the paper's bounds, its mountings, and a number of positions in this range."""
    symmetric = bool(rng.random() < SYMMETRIC_SHARE)
    truth = draw_truth(rng, symmetric=symmetric)
    count = int(rng.integers(positions[0], positions[1] + 1))
    two = count >= FEWEST_FOR_TWO and rng.random() < TWO_MOUNTINGS_SHARE
    rotated = [name for name in PRESETS if name != "identity"]
    if rng.random() < 0.5:
        first = "identity"
    else:
        first = rotated[rng.integers(len(rotated))]
    names = (first,)
    if two:
        rest = [name for name in PRESETS if name != first]
        names = (first, rest[rng.integers(len(rest))])
    errors = tuple(tuple(rng.uniform(-STAND_BOUND, STAND_BOUND, 3).tolist()) for _ in names)
    alpha, beta = draw_positions(rng, count)
    if two:
        mounting = (np.arange(count) >= count // 2).astype(int)
    else:
        mounting = np.zeros(count, dtype=int)
    return TrialBench(truth, symmetric, names, errors, alpha, beta, mounting)


def draw_truth(rng: np.random.Generator, *, symmetric: bool) -> dict[str, dict[str, Any]]:
    """Draw parameters of table and block, uniform within the paper's bounds."""

    def uniform(bound: float, size: int | None = None) -> Any:
        value = rng.uniform(-bound, bound, size)
        if size:
            return value.tolist()
        return float(value)

    plus = uniform(BLOCK_BOUND / 2, 3)
    return {
        "TurntableMotion": {
            "kappa": uniform(STAND_BOUND),
            "epsilon": uniform(STAND_BOUND),
            "alpha_offset": uniform(STAND_BOUND / 2),
            "alpha_star": uniform(STAND_BOUND / 2),
            "beta_offset": uniform(STAND_BOUND / 2),
            "gravity_error": uniform(BLOCK_BOUND / 10),
            "mounting_error": uniform(STAND_BOUND, 3),
        },
        "AccelerometerBlock": {
            "scale_error_plus": plus,
            "scale_error_minus": plus if symmetric else uniform(BLOCK_BOUND / 2, 3),
            "gamma_21": uniform(BLOCK_BOUND / 2),
            "gamma_31": uniform(BLOCK_BOUND / 2),
            "gamma_32": uniform(BLOCK_BOUND / 2),
            "bias": uniform(BLOCK_BOUND, 3),
        },
    }


def bench_positions() -> tuple[NDArray, NDArray]:
    """Return commanded angles [rad] of 40 positions: 24 with all signs certain, 16 between them.

    The extra ones share no angle: harmonics of the encoders that agree at equal steps of 45 degrees differ there.
    """
    pairs: list[tuple[int, int]] = list(product(range(20, 380, 45), (25, 145, 265)))
    for k in range(16):
        pairs.append(((13 + 67 * k) % 360, (33 + 101 * k) % 360))
    angles = np.radians(np.array(pairs, dtype=float))
    return angles[:, 0], angles[:, 1]


def draw_positions(rng: np.random.Generator, count: int) -> tuple[NDArray, NDArray]:
    """Draw commanded angles [rad] of different positions, in random order: a lattice, the axes, or anywhere."""
    kind = rng.integers(3)
    if kind == 0:
        offset = rng.integers(5, 40, 2)
        grid = [(a + offset[0], b + offset[1]) for a, b in product(range(0, 360, 45), repeat=2)]
    elif kind == 1:
        offset = rng.integers(2, 13, 2)
        grid = []
        for a, b in product((0, 90, 180, 270), repeat=2):
            grid += [(a + offset[0], b + offset[1]), (a - offset[0], b + offset[1])]
    else:
        grid = []
    chosen = set()
    for k in rng.permutation(len(grid))[: (2 * count) // 3].tolist():
        chosen.add(grid[k])
    while len(chosen) < count:
        chosen.add((round(float(rng.uniform(0, 360)), 1), round(float(rng.uniform(0, 360)), 1)))
    angles = np.radians(np.remainder(np.array(sorted(chosen), dtype=float), 360.0))
    angles = angles[rng.permutation(count)]
    return angles[:, 0], angles[:, 1]


def temperature_at(hours: NDArray) -> NDArray:
    """Return the laboratory's temperature [degC]: it swings by 4 K in ten minutes, so it is unlike the time."""
    return 20.0 + 4.0 * np.sin(2.0 * math.pi * 6.0 * hours)


def true_elementary(truth: Mapping[str, Mapping[str, Any]], mounting_error: tuple[float, ...]) -> NDArray:
    """Return elementary parameters (24,) of a bench, in one mounting."""
    vector = np.zeros(len(ELEMENTARY))
    for variables in (*truth.values(), {"mounting_error": list(mounting_error)}):
        for name, value in variables.items():
            elements = {name: value}
            if isinstance(value, list):
                elements = {f"{name}_{k}": scalar for k, scalar in enumerate(value, start=1)}
            for element, scalar in elements.items():
                if element in ELEMENTARY:
                    vector[ELEMENTARY.index(element)] = scalar
    return vector


def draw_whole(rng: np.random.Generator) -> TrialBench:
    """Draw a bench, accelerometers and gyros within usual bounds, positions, and whole turns after them."""
    truth = draw_truth(rng, symmetric=False)
    truth["GyroBlock"] = {
        "bias": rng.uniform(-2e-3, 2e-3, 3).tolist(),
        "scale_misalignment": rng.uniform(-8e-3, 8e-3, 9).tolist(),
    }
    count = int(rng.integers(POSITIONS[0], POSITIONS[1] + 1))
    drawn = rng.uniform(-math.pi, math.pi, (count, 2))
    angles = np.vstack([drawn, [[0.0, 0.0]], np.radians(TURNS)])
    error = tuple(truth["TurntableMotion"]["mounting_error"])
    latitude, azimuth = float(rng.uniform(-1.2, 1.2)), float(rng.uniform(-math.pi, math.pi))
    alpha, beta = angles.T
    return TrialBench(
        truth,
        False,
        ("identity",),
        (error,),
        alpha,
        beta,
        np.zeros(len(alpha), dtype=int),
        "uniform",
        latitude,
        azimuth,
    )


def draw_days(
    rng: np.random.Generator, count: int, positions: tuple[int, int], noise: str = "uniform"
) -> list[TrialBench]:
    """Draw the benches of one block on several days, with sign-dependent scale factors, in one mounting.

    Each day has its own bias, mounting, table and positions.
    """
    truth, days = draw_truth(rng, symmetric=False), []
    for _ in range(count):
        bench, of_day = draw_bench(rng, positions), draw_truth(rng, symmetric=False)
        # An effect of the inner axis has one phase on all days only if the zero of its encoder is the same.
        shared = {}
        for name in ("gravity_error", "beta_offset"):
            shared[name] = truth["TurntableMotion"][name]
        table = {**of_day["TurntableMotion"], **shared}
        block = {**truth["AccelerometerBlock"], "bias": of_day["AccelerometerBlock"]["bias"]}
        day = replace(
            bench,
            truth={"TurntableMotion": table, "AccelerometerBlock": block},
            symmetric=False,
            mountings=("identity",),
            mounting_errors=bench.mounting_errors[:1],
            mounting=np.zeros(len(bench.alpha), dtype=int),
            noise=noise,
        )
        days.append(day)
    return days


def measured_on_days(
    days: Sequence[TrialBench], seed: int, index: int | None, hidden: Sequence[Hidden], *, progress: bool = False
) -> dict[str, PositionRecord]:
    """Return the records of one block on several days, by label; an effect `in_record` acts only in that one."""
    if index is not None:
        seed = int(np.random.default_rng([seed, index, 0]).integers(2**31))
    records = {}
    for number, bench in enumerate(days):
        label = f"record-{number + 1}"
        acting = []
        for effect in hidden:
            if getattr(effect.place, "record", label) == label:
                acting.append(replace(effect, place=plain(effect.place)))
        records[label] = bench.measured(seed, number, acting, progress=progress)
    return records


def averaged_run(scenario: Scenario, *, every: bool = False, progress: bool = False) -> PositionRecord:
    """Run a scenario of `TrialBench.scenario` and average its rests; with `every`, keep rests whose readings drift."""
    raw = read_record(run_scenario(scenario, progress=progress).table)
    assert isinstance(raw, RawRecord)
    raw = replace(raw, path=Path("record"), sha256="")
    rests = find_rests(raw)
    if every:
        rests = [replace(rest, refused=None) for rest in rests]
    return average_rests(raw, rests)


def drawn_errors(rng: np.random.Generator, noise: str, count: int) -> NDArray:
    """Draw errors (count, 3) in units of σ: at ±1, or wandering within; a larger count keeps the first ones."""
    signs = rng.choice([-1.0, 1.0], size=(count, 3))
    if noise == "edge":
        return signs
    errors, state = np.zeros_like(signs), np.zeros(3)
    for row, sign in enumerate(signs):
        state = HELD * state + (1.0 - HELD) * sign
        errors[row] = state
    return errors
