"""The components: each model with its interface, exported as an FMU."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trihedron.fmus.component import Component
    from trihedron.models.effects import EffectPlace


@cache
def components() -> dict[str, "Component"]:
    """Every component, by its name."""
    from trihedron.fmus.accelerometer_block import ACCELEROMETER_BLOCK
    from trihedron.fmus.attitude_computer import ATTITUDE_COMPUTER
    from trihedron.fmus.harmonic_motion import HARMONIC_MOTION
    from trihedron.fmus.turntable_motion import TURNTABLE_MOTION

    return {c.name: c for c in (TURNTABLE_MOTION, HARMONIC_MOTION, ACCELEROMETER_BLOCK, ATTITUDE_COMPUTER)}


def component_names() -> tuple[str, ...]:
    """Names of the components."""
    return tuple(components())


def version() -> str:
    """Version of the distribution."""
    from importlib.metadata import version

    return version("trihedron")


def build(name: str, folder: Path, effects: "Sequence[EffectPlace]" = ()) -> Path:
    """Build a component, extended by effects, as an FMI 2.0 co-simulation FMU of the PythonFMU flavour.

    Parameters
    ----------
    name : str
        of the component
    folder : Path
        where ``<name>.fmu`` is written
    effects : sequence of EffectPlace
        composed into the component

    Returns
    -------
    Path
        the FMU; the same component and effects give the same bytes

    Raises
    ------
    KeyError
        no component has that name
    ValueError
        an effect belongs to another component
    """
    from trihedron.fmus.composition import extend
    from trihedron.fmus.python_flavour import build_python_fmu

    return build_python_fmu(extend(components()[name], effects), folder)
