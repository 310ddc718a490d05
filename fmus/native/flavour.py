"""The native flavour: a component compiled behind FMI 2.0 or FMI 3.0, with its sources."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import fmpy

from ..archive import write_archive
from ..component import Component
from ..model_description import identity, model_description
from ..pages import accompanying_files
from .compiler import FLAGS, binary
from .model_source import model_c, model_h
from .platforms import Platform

COMPILED = {
    2: ("model.c", "component.c", "values.c", "state.c", "fmi2.c"),
    3: ("model.c", "component.c", "values.c", "state.c", "fmi3.c", "fmi3_refused.c"),
}
"""Source files of each version of FMI that are compiled."""


def listed(fmi: int) -> tuple[str, ...]:
    """The files that the model description lists; FMI 3.0 has buildDescription.xml for them."""
    return COMPILED[fmi] if fmi == 2 else ()


@cache
def shared_sources(fmi: int) -> dict[str, bytes]:
    """The sources that all components share: ours, and the headers of FMI from FMPy."""
    folder = Path(__file__).parent / "sources"
    own = [*COMPILED[fmi][1:], "component.h"]
    headers = sorted((Path(fmpy.__file__).parent / "c-code").glob(f"fmi{fmi}*.h"))
    found = {name: (folder / name).read_bytes() for name in own}
    return found | {path.name: path.read_bytes() for path in headers}


def build_description(component: Component, fmi: int) -> bytes:
    """buildDescription.xml: how the sources are compiled."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=component.name)
    options = " ".join(flag for flag in FLAGS if flag.startswith(("-ff", "-fno")))
    files = SubElement(configuration, "SourceFileSet", language="C99", compilerOptions=options)
    for name in COMPILED[fmi]:
        SubElement(files, "SourceFile", name=name)
    ElementTree.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="utf-8") + b"\n"


def native_sources(component: Component, fmi: int) -> dict[str, bytes]:
    """Every source file of a component's native FMU, by its name."""
    source = model_c(component, fmi)
    shared = shared_sources(fmi)
    token = identity(component, source.encode() + b"".join(shared.values()), fmi=fmi, sources=listed(fmi))
    made = {"model.c": source.encode(), "model.h": model_h(component, fmi, token, source).encode()}
    return made | shared


def native_members(
    component: Component, fmi: int, platforms: Sequence[Platform], *, portable: bool
) -> dict[str, bytes]:
    """The files of the FMU, by their names in the archive."""
    sources = native_sources(component, fmi)
    content = sources["model.c"] + b"".join(shared_sources(fmi).values())
    members = {f"sources/{name}": text for name, text in sources.items()}
    if fmi == 3:
        members["sources/buildDescription.xml"] = build_description(component, fmi)
    members["modelDescription.xml"] = model_description(
        component, content, fmi=fmi, sources=COMPILED[fmi] if fmi == 2 else ()
    )
    for platform in platforms:
        library = binary(platform, component.name, sources, portable=portable)
        members[f"binaries/{platform.folder(fmi)}/{component.name}{platform.suffix}"] = library
    header = next(text for name, text in sources.items() if name.endswith("FunctionTypes.h"))
    return members | accompanying_files(component, fmi, header.decode("utf-8", "replace"))


def build_native_fmu(
    component: Component, folder: Path, fmi: int, platforms: Sequence[Platform], *, portable: bool
) -> Path:
    """Build the FMU into `folder`; the same component, compiler and platforms give the same bytes.

    Parameters
    ----------
    component : Component
    folder : Path
        made when it is missing
    fmi : int
        2 or 3
    platforms : sequence of Platform
    portable : bool
        whether the host's binary too is to run on old systems, where ziglang is installed

    Returns
    -------
    Path
        ``<folder>/<component's name>.fmu``

    Raises
    ------
    BuildError
        the compiler fails
    RestrictionError
        a kernel is not in restricted Python
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{component.name}.fmu"
    write_archive(path, native_members(component, fmi, platforms, portable=portable))
    return path
