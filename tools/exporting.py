"""Components written as FMUs."""

from collections.abc import Sequence
from pathlib import Path

from trihedron.errors import InputError, nearest
from trihedron.fmus import build, component_names
from trihedron.writing import whole_folder


def export_components(names: Sequence[str], out: Path) -> list[Path]:
    """Write components as FMI 2.0 FMUs of the PythonFMU flavour into a folder.

    Parameters
    ----------
    names : sequence of str
        components; all of them when there are none

    Raises
    ------
    InputError
        a name that no component has, or a folder that cannot be written
    """
    known = component_names()
    for name in names:
        if name not in known:
            raise InputError(f"component {name}: is not known; {nearest(name, known)}")
    chosen = list(dict.fromkeys(names)) or list(known)
    with whole_folder(out) as beside:
        for name in chosen:
            build(name, beside)
    return [out / f"{name}.fmu" for name in chosen]
