"""Gyro block and attitude computer, as FMUs, carry the attitude through a record; the orchestrator runs them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...models.attitude_algorithms import ALGORITHMS
from ...models.effects import CATALOGUE, EffectPlace, parameter_name, place_from_mapping
from ..orchestrator import simulate
from ..orchestrator.scenario import FmuSetting, RecordSetting, RunSetting, Scenario, Stimulus
from .motion import Motion

ALGORITHM = "one-sample-rodrigues"
"""What carries the attitude: it updates at every sample."""
FALLBACK = "mean-rate"
"""In its place where a turn between two rows is beyond its range."""
INCREMENTS = tuple(f"dtheta{p}_rad" for p in (1, 2, 3))
QUATERNION = ("q0", "q1", "q2", "q3")


@dataclass(frozen=True, eq=False)
class GyroModel:
    """The gyros as the compensation takes them: readings = (I + Γ) ω + b + what effects add.

    Attributes
    ----------
    bias : (3,) array
        [rad/s]
    scale_misalignment : (9,) array
        Γ, row by row
    effects : mapping
        effect at its place -> values of its parameters
    """

    bias: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    scale_misalignment: NDArray[np.float64] = field(default_factory=lambda: np.zeros(9))
    effects: Mapping[EffectPlace, tuple[float, ...]] = field(default_factory=dict)

    @property
    def inverse(self) -> NDArray[np.float64]:
        """(I + Γ)⁻¹ (3, 3)."""
        return np.asarray(np.linalg.inv(np.eye(3) + self.scale_misalignment.reshape(3, 3)), dtype=np.float64)


def carried_attitude(
    motion: Motion, model: GyroModel, gravity: float, fmus: Mapping[str, Path] | None = None
) -> NDArray[np.float64]:
    """Attitudes (N, 4), scalar first, at the rows of a record, from the identity at the first.

    Parameters
    ----------
    motion : Motion
    model : GyroModel
    gravity : float
        model value [m/s²]
    fmus : mapping or None
        component -> FMU file to take in place of the one that is built here
    """
    table = simulate(carrying_scenario(motion, model, gravity, fmus or {})).table
    return table.select(QUATERNION).to_numpy()


def carrying_scenario(motion: Motion, model: GyroModel, gravity: float, fmus: Mapping[str, Path]) -> Scenario:
    """The scenario: the record's increments through the compensation of the gyro block to the attitude computer.

    The run's steps are the record's intervals, each as long as the period: the increments hold the logged times.
    """
    increments, count = motion.increments, len(motion) - 1
    ends = motion.period * np.arange(1, count + 1)
    columns = {name: increments[:, p] for p, name in enumerate(INCREMENTS)}
    driven = {f"compensation.increment_reading[{p}]": INCREMENTS[p - 1] for p in (1, 2, 3)}
    # Only effects depend on anything but the increments.
    if reads(model.effects, "INPUT"):
        columns |= {f"f{p + 1}_mps2": motion.specific_force[1:, p] for p in range(3)}
        driven |= {f"compensation.specific_force[{p}]": f"f{p}_mps2" for p in (1, 2, 3)}
    if model.effects:
        columns |= {"interval_s": motion.step[1:]}
        driven |= {"compensation.interval": "interval_s"}
    if motion.temperature is not None and reads(model.effects, "TEMPERATURE"):
        columns["temperature_degC"] = motion.temperature[1:]
        driven["compensation.temperature"] = "temperature_degC"
    return Scenario(
        title="the attitude of a record, carried by its gyros",
        run=RunSetting(start_s=0.0, stop_s=count * motion.period, step_s=motion.period),
        fmus={
            "compensation": _setting(
                "GyroCompensation",
                fmus,
                {
                    "gravity": gravity,
                    "bias": model.bias.tolist(),
                    "scale_misalignment": model.scale_misalignment.tolist(),
                },
                effect_entries(model.effects, "GyroBlock"),
            ),
            "computer": _setting(
                "AttitudeComputer",
                fmus,
                {"algorithm": algorithm_for(increments), "sample_period": motion.period},
                effect_entries(model.effects, "AttitudeComputer"),
            ),
        },
        connections=[{"from": "compensation.increment", "to": "computer.increment"}],  # pyright: ignore
        stimuli=[Stimulus(table=pl.DataFrame({"time_s": ends, **columns}), stamp="end", columns=driven)],
        record=RecordSetting(
            columns={name: f"computer.attitude[{i}]" for i, name in enumerate(QUATERNION, start=1)},
        ),
    )


def reads(effects: Iterable[EffectPlace], quantity: str) -> bool:
    """Whether the kernel of some effect reads a place of the context."""
    kernels = (CATALOGUE[place.effect].at(place).kernel for place in effects)
    return any(quantity in kernel.__code__.co_names for kernel in kernels if kernel is not None)


def _setting(
    component: str, fmus: Mapping[str, Path], parameters: dict[str, object], effects: list[dict[str, object]]
) -> FmuSetting:
    """A component built here with its effects, or an FMU that has them, whose parameters they are."""
    if component not in fmus:
        return FmuSetting(component=component, parameters=parameters, effects=effects)
    for entry in effects:
        place, values = place_from_mapping(entry)
        parameters = parameters | {parameter_name(place, name): value for name, value in values.items()}
    return FmuSetting(fmu=str(fmus[component]), parameters=parameters)


def effect_entries(effects: Mapping[EffectPlace, tuple[float, ...]], component: str) -> list[dict[str, object]]:
    """Effects on a component, with their sizes, as a scenario writes them."""
    entries: list[dict[str, object]] = []
    for place, values in effects.items():
        effect = CATALOGUE[place.effect].at(place)
        if effect.component == component:
            named = zip((parameter.name for parameter in effect.parameters), values, strict=True)
            entries.append({"effect": place.effect, "where": place.where, **dict(named)})
    return entries


def algorithm_for(increments: NDArray) -> int:
    """Number of the algorithm: the usual one, or the one of any range."""
    known = {a.name: a for a in ALGORITHMS}
    longest = float(np.linalg.norm(increments, axis=1).max(initial=0.0))
    return known[ALGORITHM if 1.1 * longest < known[ALGORITHM].max_increment else FALLBACK].number


def matrices_of(quaternion: NDArray) -> NDArray[np.float64]:
    """Rotation matrices (n, 3, 3), body to reference, of quaternions (n, 4), scalar first."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=1)).as_matrix()
