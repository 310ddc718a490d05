"""The kinds of runs: calibrations, simulations of a scenario, attitude runs, cases of hidden effects."""

import contextlib
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...models.attitude_algorithms import ALGORITHMS, Algorithm
from ...models.bench import ELEMENTARY, TARGETS, elementary_reading, target_values
from .. import calibration, diagnosis, motion, papers, trials
from ..compiled import COMPILES
from ..errors import InputError, nearest
from ..files import bytes_of
from ..orchestrator.load import SETTABLE
from ..orchestrator.run import PreparedScenario
from ..orchestrator.scenario import read_scenario
from ..records import PositionRecord, RawRecord
from ..records.rests import position_record_of
from .file import AttitudeSetting, CalibrationSetting, Campaign, HiddenSetting, Reduction, SimulationSetting, Value

if TYPE_CHECKING:
    from ..motion import Samples

Better = Literal["lower", "higher"]


@dataclass(frozen=True)
class Output:
    """A scalar output of a run, a Float64, Int64, String or Boolean.

    A number or a flag may have a better direction; a text has expected values.
    """

    dtype: type[pl.DataType]
    better: Better | None = None
    good: tuple[str, ...] = ()


@dataclass(frozen=True)
class RunOutputs:
    """The outputs of a run: every scalar of the kind by its name; its record and a diagnosis (JSON) on request."""

    scalars: Mapping[str, Value | int | None]
    record: pl.DataFrame | None = None
    diagnosis: str | None = None


class Runner(Protocol):
    """Runs of one kind, prepared once in each process."""

    @property
    def outputs(self) -> Mapping[str, Output]:
        """Return name -> description of every scalar that a run gives."""
        ...

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> RunOutputs:
        """Make a run; after any exception the run counts as failed, and the message is recorded."""
        ...


LOWER = Output(pl.Float64, "lower")
VERDICT = {"verdict": Output(pl.String, good=("consistent",)), "radius": LOWER}
SETTINGS = ("noise_part", "noise_bound", "gravity", "baseline", "convention")
"""Settings that can be swept beside the elementary parameters of the bench."""
SWEPT = tuple(name for name in ELEMENTARY if name not in ("gamma_12", "gamma_13", "gamma_23"))
"""Elementary parameters of case (A1), whose exact targets are known."""
DWELL_S = 30.0
RAW_COLUMNS = ("alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2")
BIASES = tuple(f"bias_{p}_radps" for p in (1, 2, 3))
SCALE_MISALIGNMENTS = tuple(f"scale_misalignment_{element}" for element in (11, 12, 13, 21, 22, 23, 31, 32, 33))
ERRORS = (
    *BIASES,
    *SCALE_MISALIGNMENTS,
    "quantum_rad",
    "noise_bound_radps",
)
"""Errors of the gyros that can be swept."""
MOTIONS = ("amplitude_factor", "frequency_factor", "motion", "rate_hz", "duration_s", "algorithm")
"""Settings that can be swept beside them."""
MOST_SAMPLES = 100_000_000
LARGEST_INCREMENT = 1e300
"""Size from which the gyros refuse an increment [rad]."""
MANY_SAMPLES = 10_000_000
"""Samples of all runs of a campaign from which runs are made together: the code for that takes seconds to compile."""


RunInput = tuple[int, dict[str, Value], np.random.SeedSequence]
"""Number, parameters and seed of a run."""


def short_seed(seed: np.random.SeedSequence) -> int:
    """Return a seed for the components, from 0 to 2**31 - 1."""
    return int(seed.generate_state(1, np.uint32)[0] >> 1)


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, ensure_ascii=False, allow_nan=False)


def _refuse_unknown(parameters: Iterable[str], known: Sequence[str]) -> None:
    for name in parameters:
        if name not in known:
            raise InputError(f"parameters.{name}: is not known; {nearest(name, list(known))}")


class CalibrationRuns:
    """Static calibrations.

    The exact model makes a record of a bench, with errors within σ; `calibrate` gets the record and σ. The scalars are:

    - verdict and radius
    - the number of true values outside their intervals (0 is guaranteed)
    - the largest error of an estimate over its bound
    - for each target: the error, its bound, the width of the interval, and the a-priori guaranteed error
    """

    def __init__(self, campaign: Campaign, setting: CalibrationSetting) -> None:
        self.setting = setting
        self.diagnose = campaign.keep.diagnosis
        self.record = campaign.keep.record
        _refuse_unknown(campaign.parameters, [*SWEPT, *SETTINGS])
        if setting.convention == "A2" or "convention" in campaign.parameters:
            raise InputError("calibration.convention: the true values are those of A1; give A1")
        if setting.positions is None:
            text = resources.files("trihedron.scenarios").joinpath("static-calibration-positions.csv").read_bytes()
        else:
            text = bytes_of(campaign.base_folder / setting.positions)
        self.alpha, self.beta = read_position_angles(text, setting.positions or "static-calibration-positions.csv")
        self.outputs = {**VERDICT, "misses": Output(pl.Int64, "lower"), "worst_error_ratio": LOWER}
        for symbol in TARGETS:
            for what in ("error", "bound", "guaranteed", "width"):
                self.outputs[f"{symbol}_{what}"] = LOWER

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> RunOutputs:
        """Make a record and calibrate it."""
        update = {}
        for name, value in values.items():
            if name in SETTINGS:
                update[name] = value
        chosen = self.setting.model_copy(update=update)
        rng = np.random.default_rng(seed)
        truth = self._truth(rng, values, symmetric=chosen.baseline == "symmetric")
        errors = rng.uniform(-1.0, 1.0, (len(self.alpha), 3))
        if chosen.noise == "edge":
            errors = np.sign(errors)
        reading = elementary_reading(truth, self.alpha, self.beta, np.eye(3))
        reading = reading + chosen.noise_part * chosen.noise_bound * errors
        count = len(self.alpha)
        record = PositionRecord(
            position=np.arange(1, count + 1),
            time_s=DWELL_S * np.arange(count),
            alpha=self.alpha,
            beta=self.beta,
            specific_force=chosen.gravity * reading,
        )
        options = {"noise_bound": chosen.noise_bound, "gravity": chosen.gravity, "baseline": chosen.baseline}
        result = calibration.calibrate(record, **options, bounds=chosen.bounds, convention=chosen.convention)
        scalars: dict[str, Value | int | None] = {"verdict": result.verdict, "radius": result.radius}
        scalars |= self._judged(
            result.parameters, dict(zip(TARGETS, target_values(truth, np.eye(3)).tolist(), strict=True))
        )
        text = None
        if self.diagnose:
            text = _json(diagnosis.diagnose(record, **options, bounds=chosen.bounds, rerun=False).to_json())
        return RunOutputs(scalars, _table(record, keep=self.record), text)

    @staticmethod
    def _judged(estimates: Iterable[Any], true: Mapping[str, float]) -> dict[str, Value | int | None]:
        """Compare estimates with the true values of the targets."""
        scalars: dict[str, Value | int | None] = {}
        misses, ratio = 0, 0.0
        for estimate in estimates:
            symbol, bound = estimate.symbol, estimate.error_bound
            if symbol not in true:
                continue
            scalars[f"{symbol}_guaranteed"] = estimate.guaranteed_error
            if estimate.estimate is not None and bound is not None:
                error = abs(estimate.estimate - true[symbol])
                scalars |= {f"{symbol}_error": error, f"{symbol}_bound": bound}
                if bound > 0.0:
                    ratio = max(ratio, error / bound)
                elif error > 0.0:
                    ratio = math.inf
            if estimate.low is not None and estimate.high is not None:
                scalars[f"{symbol}_width"] = estimate.high - estimate.low
                misses += not estimate.low <= true[symbol] <= estimate.high
        return {**scalars, "misses": misses, "worst_error_ratio": ratio}

    def _truth(self, rng: np.random.Generator, values: Mapping[str, Value], *, symmetric: bool) -> NDArray:
        """Return elementary parameters (24,): swept ones, the others drawn or zero."""
        truth = np.zeros(len(ELEMENTARY))
        # Drawn in any case, so that the errors are the same for every choice of swept parameters.
        drawn = trials.draw_truth(rng, symmetric=symmetric)
        if self.setting.truth == "drawn":
            mounting_error = drawn["TurntableMotion"]["mounting_error"]
            truth = trials.true_elementary(drawn, tuple(mounting_error))
        for name, value in values.items():
            if name in SWEPT:
                truth[ELEMENTARY.index(name)] = float(value)
        return truth


def read_position_angles(content: bytes, label: str) -> tuple[NDArray, NDArray]:
    """Return the angles [rad] of a list of positions, CSV with alpha_deg and beta_deg."""
    try:
        table = pl.read_csv(io.BytesIO(content), comment_prefix="#")
        angles = table.select("alpha_deg", "beta_deg").cast(pl.Float64).to_numpy()
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{label}: is not a list of positions with alpha_deg and beta_deg ({reason})") from error
    if not np.isfinite(angles).all() or not len(angles):
        raise InputError(f"{label}: holds no positions, or angles that are not finite numbers")
    return np.radians(angles[:, 0]), np.radians(angles[:, 1])


def record_table(record: PositionRecord) -> pl.DataFrame:
    """Return a position record as a table: position, time, readings."""
    return record.to_polars().select("position", "time_s", *RAW_COLUMNS)


def _table(record: PositionRecord, *, keep: bool) -> pl.DataFrame | None:
    """Return the table of a record if it is kept."""
    if not keep:
        return None
    return record_table(record)


class SimulationRuns:
    """Simulations of a scenario, whose FMUs are loaded once.

    A parameter is `fmu.variable`, or `fmu.variable[k]` for an element. The scalars are the campaign file's reductions
    of the record's columns, by default the last value of each. With `calibrate` they include verdict, radius,
    estimates, their bounds and guaranteed errors of the averaged rests.
    """

    def __init__(self, campaign: Campaign, setting: SimulationSetting) -> None:
        self.setting, self.keep = setting, campaign.keep
        self.scenario = PreparedScenario(read_scenario(campaign.base_folder / setting.scenario))
        interfaces = self.scenario.interfaces
        for name in campaign.parameters:
            fmu, _, variable = name.partition(".")
            if fmu not in interfaces or not variable:
                advice = nearest(fmu, list(interfaces))
                raise InputError(f"parameters.{name}: must begin with the name of an FMU and a dot; {advice}")
            try:
                elements = interfaces[fmu].find(variable, SETTABLE)
            except InputError as error:
                raise InputError(f"parameters.{name}: {error}") from error
            if len(elements) != 1:
                raise InputError(f"parameters.{name}: has {len(elements)} elements; sweep one: {name}[1]")
        columns = [column.name for column in self.scenario.columns]
        self.reductions = setting.scalars or {name: Reduction(column=name) for name in columns}
        for name, reduction in self.reductions.items():
            if reduction.column not in columns:
                advice = nearest(reduction.column, columns)
                raise InputError(f"simulation.scalars.{name}: the record has no column '{reduction.column}'; {advice}")
        self.measures = setting.calibrate or campaign.keep.diagnosis
        if self.measures:
            for name in RAW_COLUMNS:
                if name not in columns:
                    raise InputError(f"simulation: to calibrate or diagnose, the record must have a column {name}")
        self.outputs: dict[str, Output] = {name: Output(pl.Float64) for name in self.reductions}
        if setting.calibrate:
            self.outputs |= VERDICT
            for symbol in TARGETS:
                for what in ("estimate", "bound", "guaranteed"):
                    self.outputs[f"{symbol}_{what}"] = Output(pl.Float64)
        swept = campaign.parameters
        self.seeded = []
        for name, interface in interfaces.items():
            if "seed" in interface.variables and f"{name}.seed" not in swept:
                self.seeded.append(name)

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> RunOutputs:
        """Simulate the scenario."""
        table = self.scenario.run(self._parameters(values, seed))
        scalars: dict[str, Value | int | None] = {}
        for name, reduction in self.reductions.items():
            scalars[name] = reduced(table[reduction.column].to_numpy(), reduction.take)
        if not self.measures:
            if not self.keep.record:
                return RunOutputs(scalars)
            return RunOutputs(scalars, table)
        record, sigma, text = positions_of(table), self.setting.noise_bound, None
        if self.setting.calibrate:
            result = calibration.calibrate(record, noise_bound=sigma)
            scalars |= {"verdict": result.verdict, "radius": result.radius}
            for estimate in result.parameters:
                scalars[f"{estimate.symbol}_estimate"] = estimate.estimate
                scalars[f"{estimate.symbol}_bound"] = estimate.error_bound
                scalars[f"{estimate.symbol}_guaranteed"] = estimate.guaranteed_error
        if self.keep.diagnosis:
            text = _json(diagnosis.diagnose(record, noise_bound=sigma, rerun=False).to_json())
        return RunOutputs(scalars, _table(record, keep=self.keep.record), text)

    def _parameters(self, values: Mapping[str, Value], seed: np.random.SeedSequence) -> dict[str, dict[str, Any]]:
        """Return FMU -> variable -> value of a run."""
        parameters: dict[str, dict[str, Any]] = {}
        if self.setting.seeds == "derived":
            for name, seed_of_fmu in zip(self.seeded, seed.spawn(len(self.seeded)), strict=True):
                parameters[name] = {"seed": short_seed(seed_of_fmu)}
        for name, value in values.items():
            fmu, _, variable = name.partition(".")
            kind = self.scenario.interfaces[fmu].find(variable, SETTABLE)[0].kind
            if isinstance(value, float) and kind in ("Integer", "Enumeration"):
                value = int(value)
            parameters.setdefault(fmu, {})[variable] = value
        return parameters


REDUCTIONS: dict[str, Callable[[np.ndarray], float]] = {
    "last": lambda x: x[-1],
    "first": lambda x: x[0],
    "mean": np.mean,
    "min": np.min,
    "max": np.max,
    "max-abs": lambda x: np.abs(x).max(),
    "rms": lambda x: np.sqrt(np.mean(x * x)),
    "std": np.std,
}


def reduced(values: np.ndarray, take: str) -> float:
    """Return a number from a column."""
    return float(REDUCTIONS[take](np.asarray(values, dtype=float)))


def positions_of(table: pl.DataFrame) -> PositionRecord:
    """Return the position record of a run that was recorded as a raw record."""
    temperature = None
    if "temperature_degC" in table.columns:
        temperature = table["temperature_degC"].to_numpy()
    raw = RawRecord(
        time_s=table["time_s"].to_numpy(),
        alpha=np.radians(table["alpha_deg"].to_numpy()),
        beta=np.radians(table["beta_deg"].to_numpy()),
        specific_force=np.stack([table[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1),
        temperature=temperature,
    )
    return position_record_of(raw)


class AttitudeRuns:
    """Attitude runs.

    Exact increments of a motion pass through the kernels of `GyroBlock`, with the errors of the run, and through an
    algorithm. The scalars are the largest, the last and the rms angle between computed and true attitude, and the last
    angle over the length of the run.
    """

    def __init__(self, campaign: Campaign, setting: AttitudeSetting) -> None:
        self.setting = setting
        self.record = campaign.keep.record
        samples = campaign.runs * setting.rate_hz * setting.duration_s
        self.together = COMPILES and not self.record and samples >= MANY_SAMPLES
        self.ahead: dict[int, dict[str, Value | int | None]] = {}
        _refuse_unknown(campaign.parameters, [*ERRORS, *MOTIONS])
        swept = campaign.parameters.get("algorithm")
        if swept is not None and swept.discrete:
            for value in swept.listed():
                _algorithm(str(value), "parameters.algorithm")
        if campaign.keep.diagnosis:
            raise InputError("keep.diagnosis: an attitude run has no diagnosis")
        _algorithm(setting.algorithm, "attitude.algorithm")
        papers.paper_motion(setting.motion, papers.EXACT)
        self.outputs: Mapping[str, Output] = dict.fromkeys(
            ("largest_error_rad", "last_error_rad", "rms_error_rad", "drift_radps"), LOWER
        )

    def make_ahead(self, runs: Sequence[RunInput]) -> None:
        """Make runs of one motion and algorithm together, with the same bits; `run` returns their outputs."""
        self.ahead.clear()
        if not self.together:
            return
        alike: dict[_Motion, list[tuple[int, motion.GyroErrors]]] = {}
        for number, values, seed in runs:
            # A run that is impossible fails alone.
            with contextlib.suppress(InputError):
                alike.setdefault(self._motion(values), []).append((number, self._gyros(values, seed)))
        for course, members in alike.items():
            samples, attitudes = course.samples()
            if not np.abs(samples.increments).max() < LARGEST_INCREMENT:
                continue
            numbers, gyros = zip(*members, strict=True)
            angles = motion.angles_of_runs(course.algorithm, samples, attitudes, gyros)
            for number, angle in zip(numbers, angles, strict=True):
                self.ahead[number] = _scalars_of(angle, course.duration)

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> RunOutputs:
        """Make a run."""
        if number in self.ahead:
            return RunOutputs(self.ahead[number])
        course, gyros = self._motion(values), self._gyros(values, seed)
        algorithm = course.algorithm
        samples, attitudes = course.samples()
        computed = motion.run_algorithm(algorithm, motion.read_increments(samples, *gyros), renormalise=True)
        every = algorithm.samples
        angle = motion.angle_between(computed, attitudes[every - 1 : len(attitudes) // every * every : every])
        record = None
        if self.record:
            time = np.arange(1, len(angle) + 1) * (every / course.rate)
            columns = {f"q{k}": computed[:, k] for k in range(4)}
            record = pl.DataFrame({"time_s": time, **columns, "error_rad": angle})
        return RunOutputs(_scalars_of(angle, course.duration), record)

    def _motion(self, values: Mapping[str, Value]) -> "_Motion":
        setting = self.setting
        rate = float(values.get("rate_hz", setting.rate_hz))
        duration = float(values.get("duration_s", setting.duration_s))
        if not 8 <= rate * duration <= MOST_SAMPLES:
            raise InputError(
                f"rate_hz {rate:g} times duration_s {duration:g}: a run has from 8 to {MOST_SAMPLES} samples"
            )
        return _Motion(
            _algorithm(str(values.get("algorithm", setting.algorithm)), "algorithm"),
            str(values.get("motion", setting.motion)),
            float(values.get("amplitude_factor", 1.0)),
            float(values.get("frequency_factor", 1.0)),
            rate,
            duration,
        )

    def _gyros(self, values: Mapping[str, Value], seed: np.random.SeedSequence) -> "motion.GyroErrors":
        errors = {"noise_bound_radps": self.setting.noise_bound_radps, **values}
        numbers = [float(errors.get(name, 0.0)) for name in ERRORS]
        bias, gamma = np.array(numbers[:3]), np.array(numbers[3:12])
        quantum, noise_bound = numbers[12:]
        return motion.GyroErrors(gamma, bias, quantum, noise_bound, short_seed(seed))


@dataclass(frozen=True)
class _Motion:
    """The motion of a run, and the algorithm that follows it."""

    algorithm: Algorithm
    name: str
    amplitude: float
    frequency: float
    rate: float
    duration: float

    def samples(self) -> "tuple[Samples, NDArray]":
        """Return its exact increments and true attitudes."""
        count = round(self.rate * self.duration)
        return motion_samples(self.name, self.amplitude, self.frequency, 1.0 / self.rate, count)


def _scalars_of(angle: NDArray, duration: float) -> dict[str, Value | int | None]:
    """Return the scalars of a run from the angles to the true attitudes."""
    last = float(angle[-1])
    return {
        "largest_error_rad": float(angle.max()),
        "last_error_rad": last,
        "rms_error_rad": float(np.sqrt(np.mean(angle * angle))),
        "drift_radps": last / duration,
    }


def _algorithm(name: str, where: str) -> Algorithm:
    algorithms = [algorithm.name for algorithm in ALGORITHMS]
    if name not in algorithms:
        raise InputError(f"{where}: there is no attitude algorithm '{name}'; {nearest(name, algorithms)}")
    return motion.algorithm_named(name)


@lru_cache(maxsize=2)
def motion_samples(
    name: str, amplitude: float, frequency: float, period: float, count: int
) -> "tuple[Samples, NDArray]":
    """Return exact increments of a motion and its true attitudes (N, 4), cached while the motion stays the same."""
    harmonics = papers.paper_motion(name, papers.EXACT).reshape(-1, 3).copy()
    harmonics[:, 0] *= amplitude
    harmonics[:, 1] *= frequency
    samples = motion.sample_motion(harmonics.ravel(), period, count)
    return samples, motion.attitudes_of_angles(samples.angles)


class HiddenRuns:
    """Cases of the suite: run i is case i of the seed."""

    def __init__(self, campaign: Campaign, setting: HiddenSetting) -> None:
        self.keep = campaign.keep
        if setting.suite is not None:
            try:
                suite = trials.named_suite(setting.suite)
            except InputError as error:
                raise InputError(f"hidden.suite: {str(error).removeprefix('--suite ')}") from error
            self.options, self.seed = suite.options, suite.seed
            if suite.options.records > 1 and self.keep.record:
                raise InputError(f"keep.record: is of one record a run; suite {setting.suite} has several")
        else:
            size = setting.size
            self.options = trials.Options(setting.mode, tuple(setting.effects), setting.positions, setting.noise, size)
            self.seed = campaign.seed
        self.outputs = {
            "hidden": Output(pl.String),
            "named": Output(pl.String),
            "verdict": Output(pl.String),
            "outcome": Output(pl.String, good=("right", "candidate")),
            "relative_size": Output(pl.Float64),
            "radius": Output(pl.Float64),
            "inside": Output(pl.Boolean, "higher"),
            "size_error": Output(pl.Float64),
            "positions": Output(pl.Int64),
            "redrawn": Output(pl.Int64),
        }

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> RunOutputs:
        """Draw, measure and diagnose a case; the campaign's own seeds have no effect on it."""
        case = trials.draw_case(self.options, self.seed, number)
        record = case.measured()
        result = trials.diagnosed_case(case, record)
        outcome = trials.judged_case(case, result)
        scalars: dict[str, Value | int | None] = {
            "hidden": outcome.hidden_words,
            "named": outcome.named_words,
            "verdict": outcome.verdict,
            "outcome": outcome.outcome,
            "relative_size": case.hidden[0].relative_size if len(case.hidden) == 1 else None,
            "radius": outcome.radius,
            "inside": outcome.inside,
            "size_error": outcome.size_errors[0] if len(outcome.size_errors) == 1 else None,
            "positions": outcome.positions,
            "redrawn": case.redrawn,
        }
        text = None
        if self.keep.diagnosis:
            text = _json({**outcome.to_json(), "diagnosis": result.to_json()})
        return RunOutputs(scalars, _table(record, keep=self.keep.record), text)


RUNNERS: dict[str, Callable[[Campaign, Any], Runner]] = {
    "calibration": CalibrationRuns,
    "attitude": AttitudeRuns,
    "simulation": SimulationRuns,
    "hidden": HiddenRuns,
}
"""Maker of the runs of each kind, from the campaign and its section."""
