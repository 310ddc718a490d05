"""Every component, and how it becomes an FMU."""

from collections.abc import Sequence
from pathlib import Path

from ..models.effects import EffectPlace
from .accelerometers import ACCELEROMETER_BLOCK, ACCELEROMETER_COMPENSATION
from .attitude_computer import ATTITUDE_COMPUTER
from .component import extend
from .gyros import GYRO_BLOCK, GYRO_COMPENSATION
from .harmonic_motion import HARMONIC_MOTION
from .source import build_python_fmu
from .turntable import POSITION_PROGRAMME, TABLE_CONTROLLER, TURNTABLE_MOTION

COMPONENTS = {
    c.name: c
    for c in (
        TURNTABLE_MOTION,
        POSITION_PROGRAMME,
        HARMONIC_MOTION,
        ACCELEROMETER_BLOCK,
        ACCELEROMETER_COMPENSATION,
        GYRO_BLOCK,
        GYRO_COMPENSATION,
        ATTITUDE_COMPUTER,
        TABLE_CONTROLLER,
    )
}
"""Every component, by its name."""


def build_fmu(name: str, folder: Path, effects: Sequence[EffectPlace], flavour: str, fmi: int, platform: str) -> Path:
    """Build a component, extended by effects, as a co-simulation FMU; as `trihedron.fmus.build`."""
    component = extend(COMPONENTS[name], effects)
    if flavour == "native" and fmi in (2, 3):
        # FMPy, which has the headers, is not waited for elsewhere
        from .native.c_source import build_native_fmu
        from .native.compile import chosen_platforms

        return build_native_fmu(component, folder, fmi, chosen_platforms(platform), portable=platform == "all")
    if flavour == "python" and fmi == 2:
        return build_python_fmu(component, folder)
    raise ValueError(f"there is no flavour {flavour} of FMI {fmi}")
