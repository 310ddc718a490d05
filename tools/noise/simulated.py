"""The noise of a simulation: the processes of the blocks of a scenario, by their parameters."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from ...fmus.parameters import Parameters
from ..errors import InputError
from ..orchestrator import read_scenario, write_scenario
from ..orchestrator.scenario import Scenario
from .processes import Letter, Sensor
from .result import Against

PARAMETERS: dict[Sensor, dict[Letter, str]] = {
    "gyro": {
        "N": "angle_random_walk",
        "B": "bias_instability",
        "K": "rate_random_walk",
        "R": "rate_ramp",
        "Q": "angle_quantisation",
    },
    "accelerometer": {
        "N": "velocity_random_walk",
        "B": "bias_instability",
        "K": "acceleration_random_walk",
        "R": "acceleration_ramp",
        "Q": "velocity_quantisation",
    },
}
"""Parameters of GyroBlock and AccelerometerBlock, by the letters of the processes."""
COMPONENTS: dict[Sensor, str] = {"gyro": "GyroBlock", "accelerometer": "AccelerometerBlock"}
HELD = 0.5
"""Start of the block's `held_fraction`."""
Sizes = dict[Letter, float]


def simulated_noise(scenario: Scenario, gravity: float) -> dict[str, Sizes]:
    """Return the coefficients [SI] of each channel that the scenario simulates, "gyro 1" to "accelerometer 3".

    The white part of a bounded error counts as white noise of the same variance.

    Raises
    ------
    InputError
        for a scenario without a block
    """
    channels: dict[str, Sizes] = {}
    for sensor, component in COMPONENTS.items():
        for setting in scenario.fmus.values():
            if setting.component != component:
                continue
            step = setting.step_s or scenario.run.step_s
            white = _white_part(setting.parameters, sensor, gravity) * math.sqrt(step)
            for axis in range(3):
                sizes: Sizes = {}
                for letter, name in PARAMETERS[sensor].items():
                    sizes[letter] = _element(setting.parameters, name, axis)
                sizes["N"] = math.hypot(sizes["N"], white)
                channels[f"{sensor} {axis + 1}"] = sizes
    if not channels:
        raise InputError(f"--against {scenario.source}: simulates no AccelerometerBlock and no GyroBlock")
    return channels


def _white_part(parameters: Mapping[str, object], sensor: Sensor, gravity: float) -> float:
    """Return the standard deviation of the bounded error of one sample, its held part left out [SI]."""
    bound = _element(parameters, "noise_bound", 0)
    if sensor == "accelerometer":
        bound *= gravity * (1.0 - _element(parameters, "held_fraction", 0, HELD))
    return bound / math.sqrt(3.0)


def _element(parameters: Mapping[str, object], name: str, axis: int, default: float = 0.0) -> float:
    """Return an element of a parameter as a scenario writes it: a list, a number, or `name[1]`."""
    value = parameters.get(f"{name}[{axis + 1}]", parameters.get(name, default))
    if isinstance(value, list | tuple):
        value = value[axis]
    if not isinstance(value, int | float):
        raise InputError(f"{name}: a number is needed, not {value!r}")
    return float(value)


def block_parameters(against: Sequence[Against]) -> dict[str, Parameters]:
    """Return the noise parameters of each component, by its name, in which a simulation's noise changes.

    Correlated noise and warm-up are no parameters of a block.
    """
    blocks: dict[str, Parameters] = {}
    for sensor, component in COMPONENTS.items():
        channels = [one for one in against if one.channel.startswith(sensor)]
        if not any(one.changed.keys() & PARAMETERS[sensor].keys() for one in channels):
            continue
        values: Parameters = {}
        for letter, name in PARAMETERS[sensor].items():
            values[name] = [(one.simulated | one.changed).get(letter, 0.0) for one in channels]
        blocks[component] = values
    return blocks


def extended_scenario(path: Path, changed: Mapping[str, Mapping[Letter, float]], out: Path) -> list[Path]:
    """Write a scenario whose blocks have changed coefficients; return the files.

    Parameters
    ----------
    path : path
        the scenario that is extended
    changed : mapping
        channel -> letter -> coefficient [SI]; correlated noise and warm-up are no parameters of a block
    out : path
        the scenario to write
    """
    scenario = read_scenario(path)
    fmus = dict(scenario.fmus)
    for name, setting in scenario.fmus.items():
        for sensor, component in COMPONENTS.items():
            if setting.component == component:
                parameters = dict(setting.parameters)
                _change(parameters, sensor, changed)
                fmus[name] = setting.model_copy(update={"parameters": parameters})
    extended = scenario.model_copy(update={"fmus": fmus, "title": f"{scenario.title}, noise of a record".lstrip(", ")})
    return write_scenario(extended, out)


def _change(parameters: dict, sensor: Sensor, changed: Mapping[str, Mapping[Letter, float]]) -> None:
    """Set the changed coefficients of one block."""
    bounded = False
    for letter, name in PARAMETERS[sensor].items():
        values = [_element(parameters, name, axis) for axis in range(3)]
        before = list(values)
        for axis in range(3):
            new = changed.get(f"{sensor} {axis + 1}", {}).get(letter)
            if new is not None:
                values[axis] = new
                bounded = bounded or letter == "N"
        if values != before:
            for axis in range(3):
                parameters.pop(f"{name}[{axis + 1}]", None)
            parameters[name] = values
    if bounded and "noise_bound" in parameters and all(parameters.get(PARAMETERS[sensor]["N"], [0.0])):
        # the white noise of all three axes takes the place of the bounded error
        parameters["noise_bound"] = 0.0
