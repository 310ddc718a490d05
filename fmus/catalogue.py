"""Every component, and how it becomes an FMU."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from ..models.effects import EffectPlace
from .cache import store, stored
from .component import Component, extend
from .instruments import (
    ACCELEROMETER_BLOCK,
    ACCELEROMETER_COMPENSATION,
    ATTITUDE_COMPUTER,
    GYRO_BLOCK,
    GYRO_COMPENSATION,
    VELOCITY_COMPUTER,
)
from .motions import HARMONIC_MOTION, POSITION_PROGRAMME, TABLE_CONTROLLER, TURNTABLE_MOTION
from .source import build_python_fmu

BUILT = "built"
"""Folder of the cache with the digests of the FMUs that this program has built."""
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
        VELOCITY_COMPUTER,
        TABLE_CONTROLLER,
    )
}
"""Every component, by its name."""


def components() -> dict[str, Component]:
    """Every component, by its name."""
    return COMPONENTS


def component_names() -> tuple[str, ...]:
    """Names of the components."""
    return tuple(COMPONENTS)


def build(
    component: str | Component,
    folder: Path,
    effects: Sequence[EffectPlace] = (),
    *,
    flavour: str = "python",
    fmi: int = 2,
    platform: str = "host",
) -> Path:
    """Build a component, extended by effects, as a co-simulation FMU.

    Parameters
    ----------
    component : str or Component
        by its name, or one with start values of its own (`trihedron.fmus.component.started`)
    folder : Path
        where ``<name>.fmu`` is written
    effects : sequence of EffectPlace
        composed into the component
    flavour : str
        "python": run by PythonFMU; "native": compiled
    fmi : int
        2 or 3; the Python flavour is FMI 2.0 only
    platform : str
        of the native flavour: "host", "all" or a name of `trihedron.fmus.native.compile.PLATFORMS`

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
    trihedron.fmus.native.compile.BuildError
        there is no compiler for the platform, or it fails
    """
    component = extend(COMPONENTS[component] if isinstance(component, str) else component, effects)
    if flavour == "native" and fmi in (2, 3):
        # FMPy, which has the headers, is not waited for elsewhere
        from .native.c_source import build_native_fmu
        from .native.compile import chosen_platforms

        path = build_native_fmu(component, folder, fmi, chosen_platforms(platform), portable=platform == "all")
    elif flavour == "python" and fmi == 2:
        path = build_python_fmu(component, folder)
    else:
        raise ValueError(f"there is no flavour {flavour} of FMI {fmi}")
    store(BUILT, hashlib.sha256(path.read_bytes()).hexdigest(), b"")
    return path


def is_built_here(sha256: str) -> bool:
    """Return True if this program has built the FMU with this digest, and its cache knows it."""
    return stored(BUILT, sha256) is not None
