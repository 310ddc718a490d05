"""What the block reads while it is moved: the components themselves read, with what is hidden composed into them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import CATALOGUE, EffectPlace
from ..orchestrator import simulate
from ..records import StrapdownRecord
from ..scenario import Scenario
from .motion import TrueMotion
from .noise import Noise, flicker_noise

HELD_RATES, INCREMENTS = 2, 1
"""Kinds of input of the gyro block."""
NOISE_STREAM = 7
FURTHEST_STAMP = 0.24
"""Time stamps jitter by at most so many periods."""


@dataclass(frozen=True)
class Instruments:
    """Errors of a block that are no secret, as components take them, and its noise.

    Attributes
    ----------
    gyros, accelerometers : mapping
        parameters of the components
    gyro_noise, accelerometer_noise : Noise
        [rad/s], [g]
    truth_noise : float
        bound of each component of the error of the true attitude, a rotation vector [rad]
    increments : bool
        whether the gyros put out increments; else rates, at the rows
    """

    gyros: Mapping[str, object]
    accelerometers: Mapping[str, object]
    gyro_noise: Noise
    accelerometer_noise: Noise
    truth_noise: float
    increments: bool


@dataclass(frozen=True)
class Secret:
    """What is hidden in a record.

    Attributes
    ----------
    place : EffectPlace
    values : tuple of float
        of its parameters
    """

    place: EffectPlace
    values: tuple[float, ...]

    def entry(self) -> dict[str, object]:
        """The effect as a scenario file writes it."""
        place = self.place
        entry: dict[str, object] = {"effect": place.effect, "where": place.where}
        if place.order is not None:
            entry["order"] = place.order
        if place.axes:
            entry["axes"] = list(place.axes)
        names = [parameter.name for parameter in CATALOGUE[place.effect].at(place).parameters]
        return {**entry, **dict(zip(names, self.values, strict=True))}


def measure(
    motion: TrueMotion,
    instruments: Instruments,
    secrets: Sequence[Secret],
    seed: int,
    *,
    temperature: NDArray | None = None,
    truth: bool = False,
    jitter: float = 0.0,
) -> StrapdownRecord:
    """The record of a motion.

    Parameters
    ----------
    motion : TrueMotion
    instruments : Instruments
    secrets : sequence of Secret
        composed into the components
    seed : int
        of all noise
    temperature : (N + 1,) array or None
        of the block [°C]; None: the record has none, and the block has 20 °C
    truth : bool
        whether the record has the true attitude
    jitter : float
        bound of the errors of the time stamps, in periods; the sampling stays regular
    """
    if not 0.0 <= jitter <= FURTHEST_STAMP:
        raise ValueError(f"stamps may jitter by {FURTHEST_STAMP} periods, not {jitter}")
    rng = np.random.default_rng([seed, NOISE_STREAM])
    rows, period = len(motion), motion.period
    slow_rate = flicker_noise(rng, rows, period, instruments.gyro_noise.flicker)
    slow_force = flicker_noise(rng, rows, period, instruments.accelerometer_noise.flicker)
    if instruments.increments:
        given = np.vstack([np.zeros((1, 3)), motion.increment]) + period * slow_rate
    else:
        given = motion.rate + slow_rate
    force = STANDARD_GRAVITY * (motion.force + slow_force)
    warm = np.full(rows, 20.0) if temperature is None else temperature
    stamps = np.round(period * (np.arange(rows) + jitter * rng.uniform(-1.0, 1.0, rows)), 9)
    table = pl.DataFrame(
        {
            "time_s": period * np.arange(1, rows),
            **dict(zip(columns_of("w", instruments.increments), given[1:].T, strict=True)),
            **dict(zip(columns_of("f"), force[1:].T, strict=True)),
            "temperature_degC": warm[1:],
            "interval_s": np.diff(stamps),
        }
    )
    shown = simulate(reading_scenario(table, period, instruments, secrets, seed)).table[1:]
    gyros = shown.select(columns_of("w", instruments.increments)).to_numpy()
    attitude = None
    if truth:
        wrong = Rotation.from_rotvec(rng.uniform(-1.0, 1.0, (rows, 3)) * instruments.truth_noise)
        seen = Rotation.from_quat(np.roll(motion.attitude, -1, axis=1)) * wrong
        attitude = np.roll(seen.as_quat(), 1, axis=1)[1:]
    return StrapdownRecord(
        time_s=stamps[1:],
        rate=None if instruments.increments else gyros,
        increment=gyros if instruments.increments else None,
        specific_force=shown.select(columns_of("f")).to_numpy(),
        attitude=attitude,
        temperature=None if temperature is None else temperature[1:],
    )


def reading_scenario(
    table: pl.DataFrame, period: float, instruments: Instruments, secrets: Sequence[Secret], seed: int
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

    def own(component: str) -> list[dict[str, object]]:
        return [s.entry() for s in secrets if CATALOGUE[s.place.effect].component == component]

    return Scenario.model_validate(
        {
            "schema": "trihedron.scenario/1",
            "title": "a block that is moved by hand",
            "run": {"step_s": period, "stop_s": len(table) * period},
            "fmus": {
                "gyros": {
                    "component": "GyroBlock",
                    "effects": own("GyroBlock"),
                    "parameters": {
                        **instruments.gyros,
                        "input_kind": kind,
                        "noise_bound": instruments.gyro_noise.bound(period),
                        "seed": seed % 2**31,
                    },
                },
                "accelerometers": {
                    "component": "AccelerometerBlock",
                    "effects": own("AccelerometerBlock"),
                    "parameters": {
                        **instruments.accelerometers,
                        "noise_bound": instruments.accelerometer_noise.bound(period),
                        "held_fraction": 0.0,
                        "seed": seed % 2**31,
                    },
                },
            },
            "stimuli": [{"table": table, "stamp": "end", "columns": driven}],
            "record": {
                "columns": {
                    **{name: f"gyros.{output}[{p}]" for p, name in enumerate(turns, start=1)},
                    **{name: f"accelerometers.reading[{p}]" for p, name in enumerate(forces, start=1)},
                }
            },
        }
    )


def columns_of(letter: str, increments: bool = False) -> list[str]:
    """Names of three columns of a table, with their units."""
    unit = "mps2" if letter == "f" else "rad" if increments else "radps"
    return [f"{letter}{p}_{unit}" for p in (1, 2, 3)]
