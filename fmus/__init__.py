"""The components: each model with its interface, exported as an FMU."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..models.effects import EffectPlace
    from .component import Component


@cache
def components() -> dict[str, "Component"]:
    """Every component, by its name."""
    from .accelerometer_block import ACCELEROMETER_BLOCK
    from .accelerometer_compensation import ACCELEROMETER_COMPENSATION
    from .attitude_computer import ATTITUDE_COMPUTER
    from .gyro_block import GYRO_BLOCK
    from .gyro_compensation import GYRO_COMPENSATION
    from .harmonic_motion import HARMONIC_MOTION
    from .position_programme import POSITION_PROGRAMME
    from .table_controller import TABLE_CONTROLLER
    from .turntable_motion import TURNTABLE_MOTION

    every = (
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
    return {c.name: c for c in every}


def component_names() -> tuple[str, ...]:
    """Names of the components."""
    return tuple(components())


def version() -> str:
    """Version of the distribution."""
    from importlib.metadata import version

    return version("trihedron")


def build(
    name: str,
    folder: Path,
    effects: "Sequence[EffectPlace]" = (),
    *,
    flavour: str = "python",
    fmi: int = 2,
    platform: str = "host",
) -> Path:
    """Build a component, extended by effects, as a co-simulation FMU.

    Parameters
    ----------
    name : str
        of the component
    folder : Path
        where ``<name>.fmu`` is written
    effects : sequence of EffectPlace
        composed into the component
    flavour : str
        "python": run by PythonFMU; "native": compiled
    fmi : int
        2 or 3; the Python flavour is FMI 2.0 only
    platform : str
        of the native flavour: "host", "all" or a name of `trihedron.fmus.native.platforms.PLATFORMS`

    Returns
    -------
    Path
        the FMU; the same component and effects give the same bytes

    Raises
    ------
    KeyError
        no component has that name
    ValueError
        an effect belongs to another component, or no such flavour
    trihedron.fmus.native.compiler.BuildError
        there is no compiler for the platform, or it fails
    """
    from .composition import extend

    component = extend(components()[name], effects)
    if flavour == "native" and fmi in (2, 3):
        from .native.compiler import chosen_platforms
        from .native.flavour import build_native_fmu

        return build_native_fmu(component, folder, fmi, chosen_platforms(platform), portable=platform == "all")
    if flavour == "python" and fmi == 2:
        from .python_flavour import build_python_fmu

        return build_python_fmu(component, folder)
    raise ValueError(f"there is no flavour {flavour} of FMI {fmi}")
