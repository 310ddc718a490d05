"""Angle increments of the gyros between rows, and the attitude that they carry through a record.

Gyro block and attitude computer, as FMUs, carry it; the orchestrator runs them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...fmus.instruments import HALF_A_TURN, OUT_OF_RANGE
from ...models.arrays import Floats
from ...models.attitude_algorithms import ALGORITHMS, MAX_INCREMENT
from ...models.effects import EffectPlace, MotionRows, parameter_name, place_from_mapping
from ..errors import InputError
from ..orchestrator import run_scenario
from ..orchestrator.scenario import Connection, FmuSetting, RecordSetting, RunSetting, Scenario, Stimulus
from ..records import StrapdownRecord
from ..records.columns import FORCE, INCREMENT, QUATERNION, TEMPERATURE
from ..records.stamps import grid_of
from .rests import RecordSampling, mean_rates
from .turning import rotation_of

ALGORITHM = "one-sample-rodrigues"
"""What carries the attitude: it updates at every sample."""
FALLBACK = "mean-rate"
"""In its place where a turn between two rows is beyond its range."""


class TurnsTooFar(InputError):
    """With such gyros the block would turn farther in one step than the attitude computer takes."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Means over the interval that ends at each row; row 0 has the means of the first interval.

    Attributes
    ----------
    period : float
        median time between rows [s]
    time_s : (N,) array
        [s]
    step : (N,) array
        length of the interval [s]; the period over gaps
    rate : (N, 3) array
        mean reading of the gyros [rad/s]
    specific_force : (N, 3) array
        readings of the accelerometers at the rows [m/s²]
    gravity : float
        model value [m/s²]
    temperature : (N,) array or None
        [°C]
    """

    period: float
    time_s: Floats
    step: Floats
    rate: Floats
    specific_force: Floats
    gravity: float
    temperature: Floats | None

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def increments(self) -> Floats:
        """Integrals (N - 1, 3) of the readings over the intervals [rad]."""
        return self.rate[1:] * self.step[1:, None]

    def part(self, begin: int, end: int) -> "Motion":
        """The rows begin to end."""
        names = ("time_s", "step", "rate", "specific_force", "temperature")
        values = {name: getattr(self, name) for name in names}
        return replace(self, **{name: None if v is None else v[begin:end] for name, v in values.items()})

    def force(self, rows: slice | NDArray) -> Floats:
        """Readings of the accelerometers at some rows [g]."""
        return self.specific_force[rows] / self.gravity

    def rows(self, begin: int, end: int, matrix: NDArray, bias: NDArray) -> MotionRows:
        """Rows begin to end as the effects see them, with (I + Γ)⁻¹ (3, 3) and a bias (3,) [rad/s] taken out."""
        first = max(begin - 1, 0)
        force = 0.5 * (self.force(slice(begin, end)) + self.force(slice(first, first + end - begin)))
        rate = (self.rate[first:end] - bias) @ matrix.T
        if first < begin:
            before = rate[:-1]
        else:
            before = np.vstack([rate[:1], rate[:-1]])
        return MotionRows(
            rate=rate[begin - first :],
            rate_before=before,
            specific_force=force,
            hours=(self.time_s[begin:end] - self.time_s[0]) / 3600.0,
            step=self.step[begin:end],
            temperature=None if self.temperature is None else self.temperature[begin:end],
            period=self.period,
            response=np.linalg.inv(matrix),
        )


def mean_motion(
    record: StrapdownRecord, sampling: RecordSampling, gravity: float, rates: str = "instantaneous"
) -> Motion:
    """The means of a record over its intervals, gravity [m/s²] and rates as of `run_attitude`.

    Turns of more than half a turn between two rows, which cannot be told, count as none: pieces with them are not used.
    """
    step = np.concatenate([[sampling.period], np.diff(record.time_s)])
    if record.increment is not None:
        rate = record.increment / step[:, None]
    else:
        assert record.rate is not None
        rate = np.vstack([record.rate[:1], mean_rates(record, rates)])
    step[1:][grid_of(record.time_s).is_gap] = sampling.period
    rate[~(np.linalg.norm(rate * step[:, None], axis=1) <= MAX_INCREMENT)] = 0.0
    return Motion(sampling.period, record.time_s, step, rate, record.specific_force, gravity, record.temperature)


@dataclass(frozen=True, eq=False)
class GyroModel:
    """The gyros as the compensation assumes them: readings = (I + Γ) ω + b + terms of effects.

    Attributes
    ----------
    bias : (3,) array
        [rad/s]
    scale_misalignment : (9,) array
        Γ, row by row
    effects : mapping
        effect at its place -> values of its parameters
    """

    bias: Floats = field(default_factory=lambda: np.zeros(3))
    scale_misalignment: Floats = field(default_factory=lambda: np.zeros(9))
    effects: Mapping[EffectPlace, tuple[float, ...]] = field(default_factory=dict)

    @property
    def inverse(self) -> Floats:
        """(I + Γ)⁻¹ (3, 3)."""
        return np.asarray(np.linalg.inv(np.eye(3) + self.scale_misalignment.reshape(3, 3)), dtype=np.float64)

    @property
    def parameters(self) -> dict[str, list[float]]:
        """Bias and Γ as parameters of a component."""
        return {"bias": self.bias.tolist(), "scale_misalignment": self.scale_misalignment.tolist()}


Driven: TypeAlias = dict[str, tuple[str, NDArray]]
"""Input of an FMU -> the name of its column, and its value in each interval."""


def inputs(variable: str, names: Sequence[str], values: NDArray) -> Driven:
    """The elements of an input, each driven by a column (N, K) of its own name."""
    return {f"{variable}[{i}]": pair for i, pair in enumerate(zip(names, values.T, strict=True), start=1)}


def carrying(
    title: str,
    fmus: dict[str, FmuSetting],
    driven: Driven,
    time_s: NDArray,
    period: float,
    connections: Sequence[Connection] = (),
) -> Scenario:
    """Return a scenario whose FMU `computer` carries an attitude over equal intervals between times (N + 1,)."""
    attitude = {name: f"computer.attitude[{i}]" for i, name in enumerate(QUATERNION, start=1)}
    table = pl.DataFrame({"time_s": time_s[1:], **dict(driven.values())})
    columns = {}
    for variable, (name, _) in driven.items():
        columns[variable] = name
    return Scenario(
        title=title,
        run=RunSetting(start_s=float(time_s[0]), stop_s=float(time_s[-1]), step_s=period),
        fmus=fmus,
        connections=list(connections),
        stimuli=[Stimulus(table=table, stamp="end", columns=columns)],
        record=RecordSetting(columns={**attitude, "updated": "computer.updated"}),
    )


def carried_attitude(
    motion: Motion, model: GyroModel, gravity: float, fmus: Mapping[str, Path] | None = None
) -> Floats:
    """Attitudes (N, 4), scalar first, at the rows of a record, from the identity at the first; gravity in [m/s²].

    The record's increments go through the compensation of the gyro block to the attitude computer. The run's steps are
    the record's intervals, each as long as the period: the increments hold the logged times. An FMU file may replace
    the one of a component that is built here.

    Raises TurnsTooFar with gyros that turn the block too far in one step, as a search may try.
    """
    fmus = fmus or {}
    block = {"gravity": gravity, **model.parameters}
    settings = {
        "compensation": _setting("GyroCompensation", fmus, block, _effect_entries(model.effects, "GyroBlock")),
        "computer": _setting("AttitudeComputer", fmus, {}, _effect_entries(model.effects, "AttitudeComputer")),
    }
    scenario = carried_scenario(motion, model.effects, settings)
    # Files that are given are components' own, which were built for this run.
    run = scenario.model_copy(update={"run": scenario.run.model_copy(update={"in_process": True})})
    try:
        return run_scenario(run).table.select(QUATERNION).to_numpy()
    except InputError as error:
        if HALF_A_TURN in str(error) or OUT_OF_RANGE in str(error):
            raise TurnsTooFar(str(error)) from error
        raise


def compensated_increments(motion: Motion, effects: Mapping[EffectPlace, tuple[float, ...]], gravity: float) -> Floats:
    """Return a record's increments (N, 3) [rad] without the effects of the gyros; zero in the first row."""
    settings = {
        "compensation": _setting("GyroCompensation", {}, {"gravity": gravity}, _effect_entries(effects, "GyroBlock")),
        "computer": _setting("AttitudeComputer", {}, {}, []),
    }
    columns = {name: f"compensation.increment[{i}]" for i, name in enumerate(INCREMENT, start=1)}
    run = carried_scenario(motion, effects, settings).model_copy(update={"record": RecordSetting(columns=columns)})
    return run_scenario(run).table.select(INCREMENT).to_numpy()


def carried_scenario(motion: Motion, effects: Iterable[EffectPlace], fmus: Mapping[str, FmuSetting]) -> Scenario:
    """The run of a record's increments through FMUs, of a gyros' compensation and an attitude computer.

    They are named `compensation` and `computer` and have these effects; `accelerometers`, where there is one, is the
    compensation of the accelerometers' block.
    """
    effects, increments = tuple(effects), motion.increments
    driven = inputs("compensation.increment_reading", INCREMENT, increments)
    # Only effects depend on anything but the increments.
    if reads(effects, "INPUT"):
        driven |= inputs("compensation.specific_force", FORCE, motion.specific_force[1:])
    if effects:
        driven |= {"compensation.interval": ("interval_s", motion.step[1:])}
    if motion.temperature is not None and reads(effects, "TEMPERATURE"):
        driven |= {"compensation.temperature": (TEMPERATURE, motion.temperature[1:])}
    if "accelerometers" in fmus:
        driven |= inputs("accelerometers.reading", FORCE, motion.specific_force[1:])
    computer = fmus["computer"]
    parameters = {"algorithm": algorithm_for(increments), "sample_period": motion.period, **computer.parameters}
    fmus = {**fmus, "computer": computer.model_copy(update={"parameters": parameters})}
    title, times = "the attitude of a record, carried by its gyros", motion.period * np.arange(len(motion))
    link = Connection.model_validate({"from": "compensation.increment", "to": "computer.increment"})
    return carrying(title, fmus, driven, times, motion.period, [link])


def reads(effects: Iterable[EffectPlace], quantity: str) -> bool:
    """Return true if the kernel of some effect reads a quantity of the context."""
    kernels = (place.definition.kernel for place in effects)
    return any(quantity in kernel.__code__.co_names for kernel in kernels if kernel is not None)


def _setting(
    component: str, fmus: Mapping[str, Path], parameters: dict[str, object], effects: list[dict[str, object]]
) -> FmuSetting:
    """Return the settings of a component built with its effects, or of an FMU that includes them."""
    if component not in fmus:
        return FmuSetting(component=component, parameters=parameters, effects=effects)
    for entry in effects:
        place, values = place_from_mapping(entry)
        parameters = parameters | {parameter_name(place, name): value for name, value in values.items()}
    return FmuSetting(fmu=str(fmus[component]), parameters=parameters)


def _effect_entries(effects: Mapping[EffectPlace, tuple[float, ...]], component: str) -> list[dict[str, object]]:
    """Effects on a component, with their sizes, as a scenario writes them."""
    entries: list[dict[str, object]] = []
    for place, values in effects.items():
        effect = place.definition
        if effect.component == component:
            names = []
            for parameter in effect.parameters:
                names.append(parameter.name)
            pairs = zip(names, values, strict=True)
            entries.append({**place.entry, **dict(pairs)})
    return entries


def algorithm_for(increments: NDArray) -> int:
    """Number of the algorithm: the usual one, or the one of any range."""
    by_name = {a.name: a for a in ALGORITHMS}
    longest = float(np.linalg.norm(increments, axis=1).max(initial=0.0))
    return by_name[ALGORITHM if 1.1 * longest < by_name[ALGORITHM].max_increment else FALLBACK].number


def matrices_of(quaternion: NDArray) -> Floats:
    """Rotation matrices (n, 3, 3), body to reference, of quaternions (n, 4), scalar first."""
    return rotation_of(quaternion).as_matrix()
