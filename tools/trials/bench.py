"""Benches to hide effects in: truth, mountings, positions in random order, what could be known at best, what they read.

The components are simulated in time, with the effects composed in.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.bench import ELEMENTARY, elementary, elementary_reading
from ...models.effects import POSITION_EFFECTS, Effect
from ..calibration.calibration import Asked, fit_record
from ..calibration.model import PRESETS, Linearisation, Positions, linearise, parametrise
from ..diagnosis.cause import NamedEffect
from ..evidence.bench import Bench as Evidence
from ..evidence.bench_predictions import dense_spaces
from ..evidence.bench_visits import Circumstances, circumstances_of
from ..evidence.fit import Classes, composed
from ..orchestrator import simulate
from ..orchestrator.scenario import Scenario
from ..records import PositionRecord, RawRecord, read_record
from ..records.rests import average_rests, find_rests
from .sizes import RECORD_DECIMALS, Hidden, Secret

NOISE_BOUND = 1e-5
"""σ of the records: bound of the sum of the block's error and the encoders' fluctuation."""
STAND_BOUND, BLOCK_BOUND = 3e-3, 1e-2
"""The paper's bounds of the stand's and the block's errors."""
DWELL_S = 6.0
"""Rest at each position."""
START_APART = 0.3
"""So far [rad] from its first position the table starts."""
SYMMETRIC_SHARE = 0.25
"""Part of the benches whose scale factors do not depend on the sign, and are diagnosed so."""
TWO_MOUNTINGS_SHARE = 0.25
FEWEST_FOR_TWO = 24
"""Positions from which there may be two mountings."""
RATE = ACCELERATION = math.radians(60.0)
"""Limits of the table's moves, as the component has them by default [rad/s], [rad/s²]."""
ENCODER_FLUCTUATION = math.radians(0.4 / 3600.0)
"""Bound of the fluctuation of each encoder [rad]; its effect on a reading stays below it, to 3 %."""
BLOCK_NOISE = NOISE_BOUND - 1.05 * ENCODER_FLUCTUATION
"""Bound of the block's own error [g]."""
STEP_S, FINE_STEP_S = 0.25, 0.05
LONGEST_RUN_S = 4000.0
"""The temperature is laid down for so long."""
HELD = 0.9
"""What remains of an error that wanders, from one position to the next."""
ERRORS = 1
"""Number of the stream of random numbers that errors are drawn from."""


@dataclass(frozen=True)
class Bench:
    """A bench and its programme of positions."""

    truth: dict[str, dict[str, Any]]
    """component -> variable -> value"""
    symmetric: bool
    """the block's scale factors do not depend on the sign"""
    mountings: tuple[str, ...]
    """presets, one or two"""
    mounting_errors: tuple[tuple[float, ...], ...]
    """rotation vector [rad] of each mounting"""
    alpha: NDArray
    beta: NDArray
    """(N,): commanded angles [rad]"""
    mounting: NDArray
    """(N,): which mounting each position is measured in"""
    noise: str = "uniform"
    """one of "uniform", "edge" and "correlated" """

    decimals: ClassVar[int | None] = RECORD_DECIMALS
    """of the numbers of its record"""

    @property
    def baseline(self) -> str:
        """The model that the bench is diagnosed with."""
        return "symmetric" if self.symmetric else "asymmetric"

    @property
    def asked(self) -> dict[str, Any]:
        """What is known beside the record: σ, the mountings and the kind of block."""
        return {"baseline": self.baseline, "mounting": self.matrices, "noise_bound": NOISE_BOUND}

    def as_measured(self, record: PositionRecord) -> PositionRecord | RawRecord:
        """The record as a laboratory has it: of a whole bench the series, not its rests."""
        return record

    @property
    def table(self) -> Mapping[str, Any]:
        """The true parameters of the table."""
        return self.truth["TurntableMotion"]

    def as_recorded(self, hidden: Sequence[Hidden], evidence: Evidence) -> tuple[Hidden, ...]:
        """What is hidden by the clock of the record: only it says when its first rest was.

        What changes within a rest may take a part of it away.
        """
        seen = evidence.readings.circumstances
        warm = None if seen.temperature is None else (float(temperature_at(np.zeros(1))[0]), float(seen.temperature[0]))
        return tuple(one.since(seen.began / 3600.0, warm) for one in hidden)

    def answer(self, seed: int, index: int | None, hidden: Sequence[Hidden]) -> dict[str, Any]:
        """The secret and the true parameters, for whoever wants to compare."""
        told = [{**NamedEffect.keys(one.place), "parameters": one.parameters} for one in hidden]
        return {"hidden": told[0] if told else {"effect": None}, "seed": seed, "truth": self.truth}

    def told(self, seed: int, index: int, hidden: Sequence[Hidden]) -> dict[str, Any]:
        """The case, as its outcome tells it."""
        return {
            "seed": seed,
            "case": index,
            "positions": len(self.alpha),
            "mountings": self.mountings,
            "baseline": self.baseline,
            "noise": self.noise,
            "hidden": tuple(map(Secret.hidden, hidden)),
        }

    def found(self, errors: tuple[float, ...], result: Any) -> dict[str, Any]:
        """What a diagnosis made of it beside verdict and names."""
        return {"errors": errors}

    @property
    def matrices(self) -> dict[str, NDArray]:
        """Q by name."""
        return {name: PRESETS[name] for name in self.mountings}

    def measured(
        self, seed: int, index: int | None = None, hidden: Sequence[Hidden] = (), *, progress: bool = False
    ) -> PositionRecord:
        """What the bench reads with a secret; with `progress` show how far it is on standard error, on a terminal.

        With the index of the case in its suite the seed decides everything, and the record has nine decimals. Without
        one it is a record by itself, as a laboratory makes it: errors vary within rests, those that drift are left out.

        Slews, dwells and temperature are simulated with the physical components. With two mountings the whole programme
        is run in each, and each gives the positions that are its own: the clock goes on. Uniform errors are the
        components' own; errors at ±σ, and those that wander, are added to the averaged readings.
        """
        alone = index is None
        first = seed if alone else int(np.random.default_rng([seed, index, 0]).integers(2**31))
        runs = []
        for k in range(len(self.mountings)):
            scenario = self.scenario(hidden, k, first + k, alone=alone)
            runs.append(record_of(scenario, every=not alone, progress=progress))
        if not alone and any(len(run) != len(self.alpha) for run in runs):
            raise ValueError(f"case {index} of seed {seed}: a rest of the programme was not found")
        record = self._joined(runs)
        error = np.zeros((len(record), 3))
        if self.noise != "uniform":
            rng = np.random.default_rng([seed, index or 0, ERRORS])
            error = NOISE_BOUND * drawn_errors(rng, self.noise, len(error))
        for one in hidden:
            if one.place.effect == "outlier":
                error[int(one.place.where.removeprefix("position-")) - 1, one.place.axes[0] - 1] += one.values[0]
        force = record.specific_force + STANDARD_GRAVITY * error
        if alone:
            return replace(record, specific_force=force)
        written = np.round(force, RECORD_DECIMALS)
        return replace(record, specific_force=written, resolution=0.5 * 10.0**-RECORD_DECIMALS)

    def scenario(self, hidden: Sequence[Hidden], mounting: int, seed: int, *, alone: bool) -> Scenario:
        """The scenario in which the table carries the block, in a mounting of this number, from position to position.

        `seed` is that of the components' errors.
        """
        own_errors = self.noise == "uniform"
        # Within a step it cannot be seen which axis changed an input last.
        fine = not alone and any(one.place.effect == "hysteresis" for one in hidden)
        seconds = np.arange(0.0, LONGEST_RUN_S, 1.0)
        table = {
            **self.truth["TurntableMotion"],
            "mounting": PRESETS[self.mountings[mounting]].ravel().tolist(),
            "mounting_error": list(self.mounting_errors[mounting]),
            "encoder_fluctuation_bound": ENCODER_FLUCTUATION if own_errors else 0.0,
            # Every position has a move before it, whose sense the record can tell.
            "initial_angle": [float(self.alpha[0]) - START_APART, float(self.beta[0]) - START_APART],
            "seed": seed % 2**31,
        }
        block = {
            **self.truth["AccelerometerBlock"],
            "noise_bound": BLOCK_NOISE if own_errors else 0.0,
            # An error that is held over a rest is uniform within its bound; a mean of several would be small.
            "held_fraction": 0.8 if alone else 1.0,
            "seed": seed % 2**31,
        }
        commands = {"alpha_deg": np.degrees(self.alpha).tolist(), "beta_deg": np.degrees(self.beta).tolist()}
        warmth = {"time_s": seconds.tolist(), "temperature_degC": temperature_at(seconds / 3600.0).tolist()}
        return composed(
            "a measured record",
            {"table": ("TurntableMotion", table), "block": ("AccelerometerBlock", block)},
            [one.entry for one in hidden if one.place.effect != "outlier"],
            {
                "alpha_deg": "table.angle_reading[1]",
                "beta_deg": "table.angle_reading[2]",
                **{f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)},
                "temperature_degC": "block.temperature",
            },
            run={"step_s": FINE_STEP_S if fine else STEP_S},
            connections=[
                {"from": "table.specific_force", "to": "block.specific_force"},
                {"from": "table.angle", "to": "block.angle"},
                {"from": "table.dwell", "to": "block.dwell"},
            ],
            stimuli=[
                {"to": "table.command", "table": commands, "dwell_s": DWELL_S},
                {
                    "table": warmth,
                    "columns": dict.fromkeys(("table.temperature", "block.temperature"), "temperature_degC"),
                },
            ],
        )

    def _joined(self, records: Sequence[PositionRecord]) -> PositionRecord:
        """Each mounting's own rows, in the order of the programme."""
        first = records[0]
        if len(records) == 1:
            return first
        rows = np.arange(len(self.mounting))

        def own(name: str) -> NDArray | None:
            columns = [getattr(record, name) for record in records]
            return None if any(column is None for column in columns) else np.stack(columns)[self.mounting, rows]

        angles = ("alpha", "beta", "approach_alpha", "approach_beta")
        names = ("time_s", *angles, "specific_force", "temperature", "scatter")
        columns: dict[str, Any] = {name: own(name) for name in names}
        return replace(first, mounting=tuple(self.mountings[k] for k in self.mounting), **columns)


def plain_bench(truth: dict[str, dict[str, Any]], alpha: NDArray, beta: NDArray, *, symmetric: bool) -> Bench:
    """A bench in the mounting `identity`, with the mounting error that stands in its truth."""
    error = tuple(truth["TurntableMotion"]["mounting_error"])
    return Bench(truth, symmetric, ("identity",), (error,), alpha, beta, np.zeros(len(alpha), dtype=int))


def draw_bench(rng: np.random.Generator, positions: tuple[int, int]) -> Bench:
    """Draw a bench within the paper's bounds, its mountings, and positions of which there are so many to so many."""
    symmetric = bool(rng.random() < SYMMETRIC_SHARE)
    truth = draw_truth(rng, symmetric=symmetric)
    count = int(rng.integers(positions[0], positions[1] + 1))
    both = count >= FEWEST_FOR_TWO and rng.random() < TWO_MOUNTINGS_SHARE
    others = [name for name in PRESETS if name != "identity"]
    first = "identity" if rng.random() < 0.5 else others[rng.integers(len(others))]
    names = (first,)
    if both:
        rest = [name for name in PRESETS if name != first]
        names = (first, rest[rng.integers(len(rest))])
    errors = tuple(tuple(rng.uniform(-STAND_BOUND, STAND_BOUND, 3).tolist()) for _ in names)
    alpha, beta = draw_positions(rng, count)
    mounting = (np.arange(count) >= count // 2).astype(int) if both else np.zeros(count, dtype=int)
    return Bench(truth, symmetric, names, errors, alpha, beta, mounting)


def draw_truth(rng: np.random.Generator, *, symmetric: bool) -> dict[str, dict[str, Any]]:
    """Parameters of table and block, uniform within the paper's bounds."""

    def uniform(bound: float, size: int | None = None) -> Any:
        value = rng.uniform(-bound, bound, size)
        return value.tolist() if size else float(value)

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
    """Commanded angles [rad] of 40 positions: 24 with all signs certain, 16 between them.

    The extra ones share no angle: harmonics of the encoders that look alike at equal steps of 45 degrees differ there.
    """
    pairs = [(20 + 45 * k, beta) for k in range(8) for beta in (25, 145, 265)]
    pairs += [((13 + 67 * k) % 360, (33 + 101 * k) % 360) for k in range(16)]
    angles = np.radians(np.array(pairs, dtype=float))
    return angles[:, 0], angles[:, 1]


def draw_positions(rng: np.random.Generator, count: int) -> tuple[NDArray, NDArray]:
    """Commanded angles [rad] of so many different positions, in random order: a lattice, the axes, or anywhere."""
    kind = rng.integers(3)
    if kind == 0:
        offset = rng.integers(5, 40, 2)
        grid = [(a + offset[0], b + offset[1]) for a in range(0, 360, 45) for b in range(0, 360, 45)]
    elif kind == 1:
        offset = rng.integers(2, 13, 2)
        grid = [(a + s * offset[0], b + t * offset[1]) for a in (0, 90, 180, 270) for b in (0, 90, 180, 270)
                for s, t in ((1, 1), (-1, 1))]  # fmt: skip
    else:
        grid = []
    chosen = {grid[k] for k in rng.permutation(len(grid))[: (2 * count) // 3].tolist()}
    while len(chosen) < count:
        chosen.add((round(float(rng.uniform(0, 360)), 1), round(float(rng.uniform(0, 360)), 1)))
    angles = np.radians(np.remainder(np.array(sorted(chosen), dtype=float), 360.0))
    angles = angles[rng.permutation(count)]
    return angles[:, 0], angles[:, 1]


def temperature_at(hours: NDArray) -> NDArray:
    """Temperature of the laboratory [degC]: it swings by 4 K, once in ten minutes, so that it is unlike the time."""
    return 20.0 + 4.0 * np.sin(2.0 * math.pi * 6.0 * hours)


def true_elementary(truth: Mapping[str, Mapping[str, Any]], mounting_error: tuple[float, ...]) -> NDArray:
    """Elementary parameters (24,) of a bench, in one mounting."""
    values: dict[str, float] = {}
    for variables in truth.values():
        for name, value in variables.items():
            if isinstance(value, list):
                values |= {f"{name}_{k}": float(v) for k, v in enumerate(value, start=1)}
            else:
                values[name] = float(value)
    values |= {f"mounting_error_{k}": v for k, v in enumerate(mounting_error, start=1)}
    return elementary(**{name: value for name, value in values.items() if name in ELEMENTARY})


def faultless_record(bench: Bench) -> PositionRecord:
    """What the bench would read without secret and without noise, in about the circumstances of its run."""
    reading = np.zeros((len(bench.alpha), 3))
    for k, name in enumerate(bench.mountings):
        rows = bench.mounting == k
        parameters = true_elementary(bench.truth, bench.mounting_errors[k])
        reading[rows] = elementary_reading(parameters, bench.alpha[rows], bench.beta[rows], PRESETS[name])
    ways = np.stack([np.diff(angle, prepend=angle[0] - START_APART) for angle in (bench.alpha, bench.beta)], axis=1)
    size = np.abs(ways)
    long = RATE**2 / ACCELERATION
    move = np.where(size > long, size / RATE + RATE / ACCELERATION, 2.0 * np.sqrt(size / ACCELERATION)).max(axis=1)
    # A move ends with a step of the run; a row has the time of the middle of its rest.
    time = np.cumsum(np.ceil(move / STEP_S - 1e-6) * STEP_S + DWELL_S) - 0.5 * DWELL_S
    senses = np.sign(ways)
    for row in range(1, len(senses)):
        senses[row] = np.where(senses[row] == 0.0, senses[row - 1], senses[row])
    names = tuple(bench.mountings[k] for k in bench.mounting) if len(bench.mountings) > 1 else None
    return PositionRecord(
        position=np.arange(1, len(reading) + 1),
        time_s=time,
        alpha=bench.alpha,
        beta=bench.beta,
        specific_force=STANDARD_GRAVITY * reading,
        temperature=temperature_at(time / 3600.0),
        approach_alpha=senses[:, 0],
        approach_beta=senses[:, 1],
        mounting=names,
    )


def expected(bench: Bench) -> tuple[Linearisation, Circumstances]:
    """The model at the truth, with the bounds of the readings, and the circumstances of the rows."""
    record = faultless_record(bench)
    here = fit_record(record, NOISE_BOUND, Asked(baseline=bench.baseline, mounting=bench.matrices))
    return here, circumstances_of(record)


def faultless_model(mountings: Mapping[str, NDArray], alpha: NDArray, beta: NDArray, *, symmetric: bool):
    """The model linearised at a faultless bench, at positions in the first mounting.

    Returns
    -------
    Linearisation
    """
    p = parametrise(mountings, symmetric=symmetric)
    count = len(alpha)
    at = Positions(alpha, beta, np.zeros(count, dtype=int))
    return linearise(p, at, np.zeros((count, 3)), np.zeros(len(p.symbols)), np.full(3 * count, NOISE_BOUND))


def classes_with(mountings: tuple[str, ...], *, symmetric: bool) -> Classes:
    """Effects that are linear, sorted into what these mountings can tell apart."""
    return _classes_with(mountings, tuple(POSITION_EFFECTS.values()), symmetric)


@lru_cache(maxsize=64)
def _classes_with(mountings: tuple[str, ...], effects: tuple[Effect, ...], symmetric: bool) -> Classes:
    p = parametrise({name: PRESETS[name] for name in mountings}, symmetric=symmetric)
    baseline = "symmetric" if symmetric else "asymmetric"
    linear = [e for e in effects if e.within != baseline and e.variants is None]
    places = [place for effect in linear for place in effect.places]
    return Classes.of(places, dense_spaces(p, places))


def record_of(scenario: Scenario, *, every: bool = False, progress: bool = False) -> PositionRecord:
    """Run a scenario of `Bench.scenario` and average its rests; with `every` those too whose readings drift."""
    raw = read_record(simulate(scenario, progress=progress).table)
    assert isinstance(raw, RawRecord)
    raw = replace(raw, path=Path("record"), sha256="")
    rests = find_rests(raw)
    return average_rests(raw, [replace(rest, refused=None) for rest in rests] if every else rests)


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
