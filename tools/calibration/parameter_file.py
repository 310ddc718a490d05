"""A calibration's block as an SSP 1.0 parameter set for `AccelerometerBlock` and `AccelerometerCompensation`."""

from pathlib import Path

from ...fmus import components
from ...fmus.parameter_set import parameter_set
from ..errors import InputError
from ..writing import whole_file
from .result import Calibration
from .values import calibrated_block


def write_parameter_set(result: Calibration, path: Path) -> None:
    """Write the calibrated block as an .ssv file; both components have all of its parameters.

    Raises
    ------
    InputError
        when the calibration is not consistent, or a value is beyond what the components take; nothing is written
    """
    block = calibrated_block(result.to_json(), f"--ssv {path}")
    component = components()["AccelerometerBlock"]
    for variable in component.interface:
        value = block.get(variable.name, [])
        for number in value if isinstance(value, list) else [value]:
            least, most = variable.minimum, variable.maximum
            if (least is not None and number < least) or (most is not None and number > most):
                raise InputError(f"--ssv {path}: {variable.name} = {number:g} is beyond what the component takes")
    about = "an accelerometer block"
    if result.provenance is not None:
        about = f"{result.provenance.record} (SHA-256 {result.provenance.sha256 or 'none'})"
    text = f"Calibration of {about}, noise bound {result.noise_bound:g} g, case (A1)"
    with whole_file(path) as beside:
        beside.write_bytes(parameter_set(component, block, text))
