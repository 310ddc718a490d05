"""Calibrated block and gyros as components: parameter sets of SSP (.ssv), and FMUs that start with their values."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...fmus import build, components
from ...fmus.component import Component, extend, started
from ...fmus.parameters import (
    Interval,
    Parameters,
    calibrated_block,
    calibrated_gyros,
    calibrated_intervals,
    of_one_record,
    parameter_set,
)
from ...models.effects import EffectPlace, parameter_name
from ..errors import InputError
from ..files import whole_file, whole_folder
from ..result import Result
from ..rounding import exactly, upwards

BLOCKS = {"": ("AccelerometerBlock", "AccelerometerCompensation"), "-gyros": ("GyroBlock", "GyroCompensation")}
"""Ending of a parameter set's name -> the components that it fits: the instruments, and their compensation."""


BY_HAND = {
    EffectPlace("gyro-g-sensitivity", "gyro-block"): tuple(f"S{row}{axis}" for row in (1, 2, 3) for axis in (1, 2, 3)),
    EffectPlace("latency", "gyro-block"): ("L",),
}
"""Effects of gyros that calibrations by hand fit, and the symbols of their parameters."""


@dataclass(frozen=True)
class CalibratedBlock:
    """Values and intervals of the parameters of a block, the description of their set, and the effects among them."""

    values: Parameters
    intervals: Mapping[str, Interval]
    text: str
    effects: tuple[EffectPlace, ...] = ()

    def component(self, name: str) -> Component:
        """Return a component with the effects."""
        return extend(components()[name], self.effects)


def calibrated_blocks(result: Result, option: str) -> dict[str, CalibratedBlock]:
    """Return accelerometers and gyros by their endings in `BLOCKS`; a calibration of several has the last's biases.

    Raises an InputError, which begins with the option, if the calibration lacks an estimate, or the components do not
    accept a value.
    """
    try:
        content = of_one_record(result.to_json())
        block, intervals = calibrated_block(content), calibrated_intervals(content)
    except ValueError as error:
        raise InputError(f"{option}: {error}") from error
    about, source = "an accelerometer block", content.get("provenance")
    if source is not None:
        about = f"{source['record']} (SHA-256 {source['record_sha256'] or 'none'})"
    sigma = content["sigma"]["value"]
    bound = "" if sigma is None else f", noise bound {upwards(sigma, 3)} g"
    text = f"Calibration of {about}, verdict {content['verdict']}{bound}, case (A1)"
    blocks = {"": CalibratedBlock(block, intervals, text)}
    of_gyros = calibrated_gyros(content)
    if of_gyros is not None:
        blocks["-gyros"] = _gyros_by_hand(content, *of_gyros, text)
    for ending, one in blocks.items():
        _check_limits(option, one.component(BLOCKS[ending][0]), one.values)
    return blocks


def _gyros_by_hand(
    content: Mapping[str, Any], values: Parameters, intervals: Mapping[str, Interval], text: str
) -> CalibratedBlock:
    """Return the gyros with the sensitivities to gravity and the lag that a calibration by hand has."""
    estimates = {}
    if content.get("by_hand") is not None:
        estimates = {p["symbol"]: p["estimate"] for p in content["parameters"]}
    all_values, effects = dict(values), []
    for place, symbols in BY_HAND.items():
        if any(estimates.get(symbol) is None for symbol in symbols):
            continue
        effects.append(place)
        for parameter, symbol in zip(place.definition.parameters, symbols, strict=True):
            all_values[parameter_name(place, parameter.name)] = estimates[symbol]
    if effects:
        # Sensitivities are per g of this size.
        all_values["gravity"] = content["gravity_mps2"]
    return CalibratedBlock(all_values, intervals, text, tuple(effects))


def write_parameter_set(result: Result, path: Path) -> None:
    """Write the calibrated block as an .ssv file, values with their intervals; both components have these parameters.

    Calibrated gyros go into a file of their own, NAME-gyros.ssv. Errors as of `calibrated_blocks`.
    """
    for ending, block in calibrated_blocks(result, f"--ssv {path}").items():
        component = block.component(BLOCKS[ending][0])
        with whole_file(path.with_name(f"{path.stem}{ending}{path.suffix}")) as temporary:
            temporary.write_bytes(parameter_set(component, block.values, block.text, block.intervals))


def export_calibrated(result: Result, folder: Path) -> list[Path]:
    """Write FMUs that start with the calibrated values, and beside each its parameter set; return the files.

    Of accelerometers, and of gyros where they are calibrated, the block and its compensation. Errors as of
    `calibrated_blocks`, and where the folder cannot be written.
    """
    blocks = calibrated_blocks(result, f"--export {folder}")
    files = []
    with whole_folder(folder) as draft:
        for ending, block in blocks.items():
            for name in BLOCKS[ending]:
                component = started(block.component(name), block.values)
                files.append(build(component, draft))
                written = draft / f"{name}.ssv"
                written.write_bytes(parameter_set(component, block.values, block.text, block.intervals))
                files.append(written)
    return [folder / path.name for path in files]


def _check_limits(option: str, component: Component, values: Parameters) -> None:
    """Refuse values beyond the limits of a component."""
    for variable in component.interface:
        least, most = variable.within
        for number in np.ravel(values.get(variable.name, [])).tolist():
            if (least is not None and number < least) or (most is not None and number > most):
                raise InputError(f"{option}: {variable.name} = {exactly(number)} is beyond what the component takes")
