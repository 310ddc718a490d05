"""Binaries of native FMUs: by the host's C compiler or by ziglang, kept by content, or such as came with a wheel."""

import hashlib
import json
import os
import platform as machines
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib import metadata
from pathlib import Path

from ..cache import kept

FLAGS = (
    "-std=c99",
    "-O2",
    "-g0",
    "-fvisibility=hidden",
    "-fno-asynchronous-unwind-tables",
    # The same bits as Python's: no fused operations, and sin and cos are those of the platform, not of the compiler.
    "-ffp-contract=off",
    "-fno-builtin-sin",
    "-fno-builtin-cos",
    "-fno-builtin-exp",
    "-fno-builtin-log",
    "-fno-builtin-atan2",
    "-fno-math-errno",
    # Pairs of numbers that were stored one by one would be waited for.
    "-fno-tree-vectorize",
)
SMALL = (
    "-fno-vectorize",
    "-fno-slp-vectorize",
    "-fno-unroll-loops",
    "-fno-unwind-tables",
    "-fno-stack-protector",
    "-mllvm",
    "-inline-threshold=100",
)
"""Of the cross compiler: what makes a library small and costs scalar code nothing."""

WINDOWS_LIBRARIES = tuple(f"-lapi-ms-win-crt-{part}-l1-1-0" for part in ("math", "heap", "string", "stdio", "private"))
"""The C library that Windows itself has: no other is linked in, and sin and cos are Windows' own."""


WHOLE = "whole.c"
"""A file that includes all the others: calls of every step are compiled into the functions of FMI."""

ENTITLEMENTS = "none.plist"
"""A list of nothing. The linker signs a library for ARM by itself, one for Intel only where it is given such a list."""

NO_COMPILER = "native FMUs need a C compiler: there is no cc here; install one, or trihedron[native]"
NO_ZIG = "needs ziglang to compile for it; install trihedron[native]"

MANIFEST = "made.json"
"""Says of the FMUs that came with a wheel how they were made."""


@dataclass(frozen=True)
class Platform:
    """Platform of a binary.

    Attributes
    ----------
    name : str
        as FMI 3.0 writes it, also the name of the folder there
    fmi2_folder : str
        name of the folder in FMI 2.0
    suffix : str
        of the binary
    target : str
        name for the cross compiler, with the oldest system that runs it: a Linux by its C library
    """

    name: str
    fmi2_folder: str
    suffix: str
    target: str

    def folder(self, fmi: int) -> str:
        """Folder under binaries/."""
        if fmi == 2:
            return self.fmi2_folder
        return self.name


PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "linux64", ".so", "x86_64-linux-gnu.2.17"),
        Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
        Platform("x86_64-windows", "win64", ".dll", "x86_64-windows-gnu"),
        Platform("x86_64-darwin", "darwin64", ".dylib", "x86_64-macos.10.7"),
        Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos.11.0"),
    )
}
"""Every platform, by its name."""


def host_name() -> str:
    """Name of the platform that this runs on; there may be no FMU for it."""
    machine = machines.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    return f"{machine}-{system}"


def all_flags() -> list[str]:
    """Return the flags of the cross compiler, which with its version determine the binary."""
    flags = list(FLAGS + SMALL + WINDOWS_LIBRARIES)
    flags += [platform.target for platform in PLATFORMS.values()]
    return flags


class BuildError(RuntimeError):
    """A binary cannot be made here; the message says why and what would help."""


@cache
def zig_version() -> str | None:
    """Version of ziglang, None where it is not installed."""
    try:
        return metadata.version("ziglang")
    except metadata.PackageNotFoundError:
        return None


@cache
def host_compiler() -> tuple[str, str] | None:
    """Return the host's C compiler, CC or cc, and its version text; None if no compiler runs."""
    path = shutil.which(os.environ.get("CC") or "cc")
    if path is None:
        return None
    with suppress(OSError, subprocess.SubprocessError):
        process = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=60, check=True)
        return path, process.stdout
    return None


def chosen_platforms(choice: str) -> tuple[Platform, ...]:
    """The platforms of ``all``, ``host`` or a name.

    Raises
    ------
    BuildError
        no such platform, or nothing here compiles for it
    """
    if choice == "all":
        names = list(PLATFORMS)
    else:
        names = [host_name() if choice == "host" else choice]
    for name in names:
        if name not in PLATFORMS:
            close = get_close_matches(name, PLATFORMS, n=1)
            meant = f" (did you mean {close[0]}?)" if close else ""
            raise BuildError(
                f"platform {name}: there is no native FMU for it; there is for {', '.join(PLATFORMS)}{meant}"
            )
        if not (compiles(name) or has_prebuilt()):
            if name == host_name() and choice != "all":
                raise BuildError(NO_COMPILER)
            raise BuildError(f"platform {name}: {NO_ZIG}")
    return tuple(PLATFORMS[name] for name in names)


def compiles(name: str) -> bool:
    """Return True if a compiler for a platform is installed."""
    return zig_version() is not None or (name == host_name() and host_compiler() is not None)


def _commands(platform: Platform, output: str, cross: bool) -> tuple[list[list[str]], str]:
    """The commands, one after the other, and the version of the compiler."""
    linux: list[str] = []
    install_name: list[str] = []
    if platform.suffix == ".so":
        linux = ["-Wl,--build-id=none"]
    if platform.suffix == ".dylib":
        # Found by whoever loads it, wherever the archive was unpacked.
        install_name = ["-install_name", f"@rpath/{output}"]
    shared, into = ["-fPIC", "-shared"], ["-o", output, WHOLE, "-lm"]
    if not cross:
        compiler = host_compiler()
        assert compiler is not None
        if install_name:
            shared.append(f"-mmacosx-version-min={platform.target.partition('macos.')[2]}")
            shared += install_name
        else:
            shared += ["-s"]
        if linux:
            shared += linux
            shared.append("-Wl,-z,noseparate-code")
        return [_command(compiler[:1], FLAGS, shared, into)], compiler[1]
    zig = [sys.executable, "-m", "ziglang"]
    small = _command(zig, ["cc", "-target", platform.target], FLAGS, SMALL)
    version = f"zig {zig_version()}"
    if platform.name == "x86_64-darwin":
        build = ["build-lib", "-target", platform.target, "-dynamic", "-fstrip", "-lc", "--name", platform.name]
        signed = ["--entitlements", ENTITLEMENTS, f"-femit-bin={output}", str(Path(WHOLE).with_suffix(".o"))]
        return [_command(small, ["-fPIC", "-c", WHOLE]), _command(zig, build, install_name, signed)], version
    if platform.suffix != ".dll":
        stripped = ["-s", *linux, *install_name, "-ffunction-sections", "-Wl,--gc-sections"]
        return [_command(small, shared, stripped, into)], version
    linker = ["-O2", "-shared", "-s", "-nostdlib", "-Wl,--entry=TrihedronEntry"]
    linked = ["-o", output, str(Path(WHOLE).with_suffix(".obj"))]
    compiled = _command(small, ["-DTRIHEDRON_UCRT_ONLY", "-c", WHOLE])
    return [compiled, _command(zig, small[3:6], linker, linked, WINDOWS_LIBRARIES)], version


def _command(*parts: Sequence[str]) -> list[str]:
    """The words of a command, part by part."""
    words: list[str] = []
    for part in parts:
        words += part
    return words


def prebuilt_folder() -> Path:
    """Return the folder of the native FMUs in a wheel."""
    return Path(__file__).resolve().parents[1] / "prebuilt"


def has_prebuilt() -> bool:
    """Return True if the package contains native FMUs."""
    return (prebuilt_folder() / MANIFEST).is_file()


def prebuilt_library(platform: Platform, name: str, sources: Mapping[str, bytes], flags: Sequence[str]) -> bytes | None:
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


def binary(platform: Platform, name: str, sources: Mapping[str, bytes], *, portable: bool) -> bytes:
    """The shared library for a platform, from the cache where it has been made before.

    Parameters
    ----------
    platform : Platform
    name : str
        of the library, without its ending
    sources : mapping
        file name to content
    portable : bool
        whether ziglang is taken for the host too where it is installed, so that old systems run it

    Raises
    ------
    BuildError
        the compiler fails, or there is none and no FMU made from these sources came with the package
    """
    if zig_version() is None and (portable or not compiles(platform.name)):
        library = prebuilt_library(platform, name, sources, all_flags())
        if library is not None:
            return library
        if not compiles(platform.name):
            if platform.name == host_name():
                raise BuildError(NO_COMPILER)
            raise BuildError(f"platform {platform.name}: {NO_ZIG}")
    cross = zig_version() is not None and (portable or platform.name != host_name() or host_compiler() is None)
    output = f"{name}{platform.suffix}"
    commands, version = _commands(platform, output, cross)
    source = ""
    for file in sources:
        if file.endswith(".c"):
            source += f'#include "{file}"\n'
    files = {**sources, WHOLE: source.encode(), ENTITLEMENTS: b'<plist version="1.0"><dict/></plist>\n'}
    words = [version]
    for command in commands:
        words += command[1:]
    digest = hashlib.sha256("\0".join(words).encode())
    for file, content in files.items():
        digest.update(f"\0{file}\0{len(content)}\0".encode() + content)

    def make() -> bytes:
        with tempfile.TemporaryDirectory(prefix="trihedron-") as scratch:
            return _compile(commands, files, Path(scratch), output)

    return kept("binaries", f"{digest.hexdigest()}{platform.suffix}", make)


def _compile(commands: Sequence[Sequence[str]], files: Mapping[str, bytes], folder: Path, output: str) -> bytes:
    """Run the commands in the folder, with the files in it; the bytes of the output."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    environment = {**os.environ, "LC_ALL": "C", "ZIG_LOCAL_CACHE_DIR": str(folder / "zig")}
    for command in commands:
        try:
            process = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        except OSError as error:
            raise BuildError(f"the compiler {command[0]} cannot be run ({error.strerror})") from error
        if process.returncode != 0:
            message = next((line for line in process.stderr.splitlines() if "error" in line), process.stderr.strip())
            raise BuildError(f"the compiler {command[0]} fails: {' '.join(message.split()) or 'it says nothing'}")
    return (folder / output).read_bytes()
