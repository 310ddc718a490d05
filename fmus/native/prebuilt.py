"""Native FMUs that come with a wheel, for machines on which nothing compiles; a checkout has none.

`python -m trihedron.fmus.native.prebuilt FOLDER` makes them, where ziglang is installed.
"""

import json
import sys
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from .platforms import PLATFORMS, Platform

MANIFEST = "made.json"
VERSIONS = (2, 3)


def prebuilt_folder() -> Path:
    """Where a wheel has them."""
    return Path(__file__).resolve().parents[1] / "prebuilt"


def has_prebuilt() -> bool:
    """Whether native FMUs came with the package."""
    return (prebuilt_folder() / MANIFEST).is_file()


def prebuilt_library(platform: Platform, name: str, sources: Mapping[str, bytes], flags: list[str]) -> bytes | None:
    """The library of a component from the FMU that came with the package.

    Parameters
    ----------
    platform : Platform
    name : str
        of the component
    sources : mapping
        file name to content, what would be compiled
    flags : list of str
        by which

    Returns
    -------
    bytes or None
        None where there is no FMU made from exactly these sources with these flags
    """
    fmi = 2 if "fmi2.c" in sources else 3
    archive = prebuilt_folder() / f"fmi{fmi}" / f"{name}.fmu"
    with suppress(OSError, ValueError, KeyError, zipfile.BadZipFile):
        if json.loads((prebuilt_folder() / MANIFEST).read_text(encoding="utf-8"))["flags"] != flags:
            return None
        with zipfile.ZipFile(archive) as fmu:
            if all(fmu.read(f"sources/{file}") == content for file, content in sources.items()):
                return fmu.read(f"binaries/{platform.folder(fmi)}/{name}{platform.suffix}")
    return None


def make_prebuilt(folder: Path) -> list[Path]:
    """Build every component as a native FMU for all platforms, of both versions of FMI.

    Parameters
    ----------
    folder : Path
        gets fmi2/, fmi3/ and the manifest

    Raises
    ------
    trihedron.fmus.native.compiler.BuildError
        ziglang is not installed, or fails
    """
    from .. import build, component_names
    from .compiler import all_flags, zig_version

    made = [
        build(name, folder / f"fmi{fmi}", flavour="native", fmi=fmi, platform="all")
        for fmi in VERSIONS
        for name in component_names()
    ]
    content = {"compiler": f"zig {zig_version()}", "flags": all_flags(), "platforms": list(PLATFORMS)}
    (folder / MANIFEST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8", newline="\n")
    return made


if __name__ == "__main__":
    for path in make_prebuilt(Path(sys.argv[1])):
        print(path)
