"""The platforms of native FMUs: folders, endings, targets."""

import platform
import sys
from dataclasses import dataclass


@dataclass(frozen=True)
class Platform:
    """Where a binary runs.

    Attributes
    ----------
    name : str
        as FMI 3.0 writes it, also the name of the folder there
    fmi2_folder : str
        name of the folder in FMI 2.0
    suffix : str
        of the binary
    target : str
        what the cross compiler calls it
    """

    name: str
    fmi2_folder: str
    suffix: str
    target: str

    def folder(self, fmi: int) -> str:
        """Folder under binaries/."""
        return self.fmi2_folder if fmi == 2 else self.name


PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "linux64", ".so", "x86_64-linux-gnu.2.17"),
        Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
        Platform("x86_64-windows", "win64", ".dll", "x86_64-windows-gnu"),
        Platform("x86_64-darwin", "darwin64", ".dylib", "x86_64-macos"),
        Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
    )
}
"""Every platform, by its name."""


def host_name() -> str:
    """Name of the platform that this runs on; there may be no FMU for it."""
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    return f"{machine}-{system}"
