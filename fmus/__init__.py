"""The components: each model with its interface, exported as an FMU."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..models.effects import EffectPlace
    from .component import Component


def components() -> dict[str, "Component"]:
    """Every component, by its name."""
    from .catalogue import COMPONENTS

    return COMPONENTS


def component_names() -> tuple[str, ...]:
    """Names of the components."""
    return tuple(components())


def version() -> str:
    """Version of the distribution."""
    from importlib import metadata

    return metadata.version("trihedron")


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
    from .catalogue import build_fmu

    return build_fmu(name, folder, effects, flavour, fmi, platform)
