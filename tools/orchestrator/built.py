"""FMUs of components for a run: native where something compiles here, else PythonFMU's; kept by content.

Both flavours give the same bits; the native one is a hundred times faster.
"""

import hashlib
import os
import platform
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Literal

from ... import fmus, models
from ...fmus import build
from ...fmus.native.compile import (
    PLATFORMS,
    BuildError,
    cache_folder,
    compiles,
    has_prebuilt,
    host_compiler,
    host_name,
    zig_version,
)
from ...models.effects import EffectPlace
from .machine_code import keep

Flavour = Literal["native", "python"]


@cache
def usual_flavour() -> Flavour:
    """What a component runs as where the scenario does not say."""
    can = host_name() in PLATFORMS and (compiles(host_name()) or has_prebuilt())
    return "native" if can else "python"


@cache
def _sources() -> str:
    """Hash of everything that components are made from."""
    digest = hashlib.sha256(f"{platform.python_version()} {host_name()}".encode())
    for package in ("trihedron", "fmpy", "pythonfmu"):
        digest.update(f"\0{package} {metadata.version(package)}".encode())
    for package in (models, fmus):
        folder = Path(str(package.__file__)).parent
        for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix not in (".pyc", ".fmu")):
            content = path.read_bytes()
            digest.update(f"\0{path.relative_to(folder).as_posix()} {len(content)}\0".encode() + content)
    return digest.hexdigest()


def _key(name: str, places: Sequence[EffectPlace], flavour: Flavour) -> str:
    compiler = (host_compiler() or ("", ""))[1] if flavour == "native" else ""
    said = [_sources(), name, repr(list(places)), flavour, compiler, str(zig_version())]
    said.append(os.environ.get("SOURCE_DATE_EPOCH", ""))
    return hashlib.sha256("\0".join(said).encode()).hexdigest()


def component_fmu(name: str, places: Sequence[EffectPlace], flavour: Flavour | None, folder: Path) -> Path:
    """The FMU of a component, extended by effects, from the cache where it has been built before.

    Parameters
    ----------
    name : str
        of the component
    places : sequence of EffectPlace
    flavour : str or None
        "native", "python"; None: as `usual_flavour` says
    folder : Path
        where it is built

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        an effect that belongs to another component
    BuildError
        "native" was asked for, and nothing here compiles
    """
    if flavour is None and usual_flavour() == "native":
        with suppress(BuildError):
            return component_fmu(name, places, "native", folder)
    flavour = flavour or "python"
    kept = cache_folder() / "fmus" / _key(name, places, flavour)
    for path in kept.glob("*.fmu"):
        # Its name is the hash of its bytes: a damaged one is built again.
        if hashlib.sha256(path.read_bytes()).hexdigest() == path.stem:
            return path
    path = build(name, folder, places, flavour=flavour)
    content = path.read_bytes()
    keep(kept / f"{hashlib.sha256(content).hexdigest()}.fmu", content)
    return path
