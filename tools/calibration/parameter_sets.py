"""Parameter sets of SSP (.ssv) of a calibrated block and its gyros, for the components and for other tools."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...fmus import components
from ...fmus.parameters import (
    Interval,
    Parameters,
    calibrated_block,
    calibrated_gyros,
    calibrated_intervals,
    of_one_record,
    parameter_set,
)
from ..errors import InputError
from ..files import whole_file
from ..result import Result
from ..rounding import exactly, upwards


def write_parameter_set(result: Result, path: Path) -> None:
    """Write the calibrated block as an .ssv file, values with their intervals; both components have these parameters.

    Calibrated gyros go into a file of their own, NAME-gyros.ssv. A calibration of several records is written with the
    biases of the last. Raises an InputError if the calibration lacks an estimate, or the components do not accept a
    value.
    """
    try:
        content = of_one_record(result.to_json())
        block, intervals = calibrated_block(content), calibrated_intervals(content)
    except ValueError as error:
        raise InputError(f"--ssv {path}: {error}") from error
    about, source = "an accelerometer block", content.get("provenance")
    if source is not None:
        about = f"{source['record']} (SHA-256 {source['record_sha256'] or 'none'})"
    sigma = content["sigma"]["value"]
    bound = "" if sigma is None else f", noise bound {upwards(sigma, 3)} g"
    text = f"Calibration of {about}, verdict {content['verdict']}{bound}, case (A1)"
    contents = {path: _checked_set(path, "AccelerometerBlock", block, intervals, text)}
    of_gyros = calibrated_gyros(content)
    if of_gyros is not None:
        beside_it = path.with_name(f"{path.stem}-gyros{path.suffix}")
        contents[beside_it] = _checked_set(beside_it, "GyroBlock", of_gyros[0], of_gyros[1], text)
    for target, written in contents.items():
        with whole_file(target) as temporary:
            temporary.write_bytes(written)


def _checked_set(path: Path, name: str, values: Parameters, intervals: Mapping[str, Interval], text: str) -> bytes:
    """Return the parameter set of a component; raise an InputError for values beyond its limits."""
    component = components()[name]
    for variable in component.interface:
        least, most = variable.within
        for number in np.ravel(values.get(variable.name, [])).tolist():
            if (least is not None and number < least) or (most is not None and number > most):
                raise InputError(
                    f"--ssv {path}: {variable.name} = {exactly(number)} is beyond what the component takes"
                )
    return parameter_set(component, values, text, intervals)
