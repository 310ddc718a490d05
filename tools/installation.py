"""Check the installation: packages, platforms for FMU export, and a trial run, for `trihedron doctor`."""

import os
import platform
import sys
from importlib import metadata
from time import perf_counter
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from ..fmus.cache import cache_folder, others_can_write
from ..fmus.native.compile import PLATFORMS, compiles, has_prebuilt, host_compiler, host_name, zig_version
from .calibration import calibrate
from .document.page import converter
from .files import at_once
from .locks import own_folder
from .orchestrator.load import usual_flavour
from .orchestrator.run import simulate_table
from .orchestrator.scenario import read_scenario
from .result import Result
from .rounding import digits
from .templates import new

if TYPE_CHECKING:
    from polars import DataFrame

CORE = (
    *("numpy", "scipy", "highspy", "fmpy", "pythonfmu", "polars", "pydantic", "cyclopts", "rich", "jinja2"),
    *("matplotlib", "joblib", "lazy-loader", "python-calamine", "xlsxwriter"),
)
EXTRAS = {
    "fast": ("numba", "llvmlite"),
    "native": ("ziglang",),
    "cluster": ("dask", "distributed", "cryptography"),
    "docs": ("mkdocs-material",),
    "logs": ("h5py", "pyulog", "rosbags", "mcap"),
    "tdms": ("npTDMS",),
}
"""Packages that each extra installs."""
POSITIONS, DWELL_S = 12, 2.0
"""Positions and dwell of the trial run."""


class InstallationFinding(Result):
    """Finding about the installation: subject, state, and whether it is right (None: a matter of choice)."""

    subject: str
    state: str
    good: bool | None = True


class Installation(Result):
    """The state of the installation.

    Attributes
    ----------
    works : bool
        true if everything needed is present and a run works
    findings : tuple of InstallationFinding
    """

    schema_: Literal["trihedron.doctor/1"] = Field(default="trihedron.doctor/1", alias="schema")
    works: bool
    findings: tuple[InstallationFinding, ...]

    def to_polars(self) -> "DataFrame":
        """A row for each finding: subject, state, good."""
        import polars as pl

        return pl.DataFrame([f.to_json() for f in self.findings], schema_overrides={"good": pl.Boolean})


def doctor() -> Installation:
    """Check the installation with a trial run: simulate a table and a block, and calibrate the simulated readings."""
    findings = (
        finding("trihedron", metadata.version("trihedron")),
        finding("Python", f"{platform.python_version()}, {sys.executable}", sys.version_info >= (3, 11)),
        *_packages(),
        *_platforms(),
        _cache(),
        _printing(),
        _run(),
    )
    return Installation(works=all(entry.good is not False for entry in findings), findings=findings)


def finding(subject: str, state: str, good: bool | None = True) -> InstallationFinding:
    """Return the state of a subject as a finding."""
    return InstallationFinding(subject=subject, state=state, good=good)


def _packages() -> list[InstallationFinding]:
    installed, missing = [], []
    for name in CORE:
        version = _version(name)
        if version is None:
            missing.append(name)
        else:
            installed.append(f"{name} {version}")
    state = ", ".join(installed)
    if missing:
        state += f"; MISSING: {', '.join(missing)}"
    findings = [finding("libraries", state, not missing)]
    for extra, names in EXTRAS.items():
        versions = [f"{name} {_version(name) or 'missing'}" for name in names]
        state, complete = ", ".join(versions), None not in map(_version, names)
        if complete:
            findings.append(finding(f"extra {extra}", state, True))
        else:
            findings.append(finding(f"extra {extra}", f'{state}; pip install "trihedron[{extra}]"', None))
    return findings


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _platforms() -> list[InstallationFinding]:
    compiler, zig = host_compiler(), zig_version()
    state = "none"
    if compiler is not None and compiler[1]:
        state = compiler[1].splitlines()[0]
    if zig is not None:
        state += f"; zig {zig}"
    findings = [finding("C compiler", state, True if compiler or zig else None)]
    for name in PLATFORMS:
        this = ", this machine" if name == host_name() else ""
        if compiles(name):
            state, good = f"compiled{this}", True
        elif has_prebuilt():
            state, good = f"components as they came with the package; none with effects{this}", True
        else:
            state, good = f'cannot be exported{this}; pip install "trihedron[native]"', None
        findings.append(finding(f"native FMUs for {name}", state, good))
    return findings


def _cache() -> InstallationFinding:
    folder = cache_folder()
    at = folder
    while not at.exists() and at != at.parent:
        at = at.parent
    if not (at.is_dir() and os.access(at, os.W_OK)):
        return finding("cache", f"{folder}, not writable: each run begins anew", None)
    open_place = others_can_write(folder if folder.exists() else at)
    if open_place is not None:
        return finding("cache", f"{folder}, not used: others can write to {open_place}; each run begins anew", None)
    return finding("cache", str(folder), True)


def _printing() -> InstallationFinding:
    program = converter()
    return finding(
        "reports as PDF", program or "no Chromium, Chrome or Edge; reports are HTML", True if program else None
    )


def _run() -> InstallationFinding:
    """A run of the whole chain, on a template's scenario."""
    subject = "a run"
    try:
        # The command reads back its own output.
        with own_folder() as folder, at_once():
            scenario = new("scenario", folder / "bench.toml", positions=POSITIONS)[0]
            text = scenario.read_text(encoding="utf-8")
            scenario.write_text(text.replace("dwell_s = 20.0", f"dwell_s = {DWELL_S}"), encoding="utf-8")
            begin = perf_counter()
            run = simulate_table(read_scenario(scenario))
            seconds = perf_counter() - begin
            if run.positions is None:
                return finding(subject, f"gives no positions: {run.no_positions}", False)
            verdict = calibrate(run.positions, noise_bound=1e-5).verdict
    except Exception as error:
        # Any error here answers the user's question.
        return finding(subject, f"{type(error).__name__}: {' '.join(str(error).split())}", False)
    state = f"{run.height} steps in {digits(seconds)} s by {usual_flavour()} FMUs; calibrated: {verdict}"
    return finding(subject, state, verdict == "consistent")
