"""What a campaign is to do: its order, which goes to whoever computes, and its design, which run is which.

Of a run the parameters and the seed follow from the campaign and the run's number alone.

Run number = (combination × samples + sample) × repeats + repeat. With Saltelli's sampling the samples are the rows of
A, then of B, then of A with each column from B; a row has the same random errors in all of them, so that a parameter
that does nothing has indices of exactly nothing.
"""

import hashlib
import os
import platform
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from ... import fmus, models
from ..errors import InputError
from ..orchestrator.scenario import read_scenario
from .file import Campaign, parse_campaign, read_campaign

_PACKAGES = ("trihedron", "numpy", "scipy", "highspy", "numba", "polars", "fmpy")
_CODE = (
    *("attitude", "bounded", "calibration", "campaign", "diagnosis", "evidence", "motion"),
    *("orchestrator", "papers", "records", "trials"),
)
"""Sub-packages that results follow from, beside models and fmus."""
_SAMPLES_STREAM, _ERRORS_STREAM = 0, 1
_CHUNK = 256
"""Rows of a Sobol sequence that are made at once."""
Value = float | str | bool


@dataclass(frozen=True)
class Order:
    """Everything that a worker needs to know of a campaign, wherever it is.

    Attributes
    ----------
    campaign_file : str
        path of the campaign file below the folder that all the files share
    files : tuple of (str, bytes)
        path below that folder and content, of the campaign file and of all that it reads
    code : str
        `code_hash` of whoever gives the order
    """

    campaign_file: str
    files: tuple[tuple[str, bytes], ...]
    code: str

    @cached_property
    def sha256(self) -> str:
        """Of the names and contents of all files, and of the code."""
        digest = hashlib.sha256(f"{self.campaign_file}\0{self.code}".encode())
        for name, content in self.files:
            digest.update(f"\0{name} {len(content)}\0".encode() + content)
        return digest.hexdigest()

    def unpack(self, folder: Path) -> Campaign:
        """Write the files into a folder; returns the campaign as it is read there."""
        for name, content in self.files:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        return read_campaign(folder / self.campaign_file)

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each file that the campaign reads."""
        return {name: hashlib.sha256(content).hexdigest() for name, content in self.files}


def make_order(path: Path) -> tuple[Order, Campaign]:
    """Read a campaign file and all that it reads.

    Raises
    ------
    InputError
        a file that cannot be read or that is not what it should be
    """
    content = _content(path, path)
    campaign = parse_campaign(content, path)
    found = {path.resolve(): content}
    for name in _inputs(campaign):
        file = (campaign.base_folder / name).resolve()
        found[file] = _content(file, path)
        if campaign.simulation is not None and name == campaign.simulation.scenario:
            for inner in _inputs_of_scenario(file):
                at = (file.parent / inner).resolve()
                found[at] = _content(at, path)
    root = Path(os.path.commonpath([file.parent for file in found]))
    files = sorted((PurePosixPath(file.relative_to(root)).as_posix(), content) for file, content in found.items())
    name = PurePosixPath(path.resolve().relative_to(root)).as_posix()
    return Order(name, tuple(files), code_hash()), campaign


def _content(file: Path, campaign: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        before = "" if file == campaign else f"{campaign}: "
        raise InputError(f"{before}{file}: cannot be read ({error.strerror})") from error


def _inputs(campaign: Campaign) -> list[str]:
    if campaign.simulation is not None:
        return [campaign.simulation.scenario]
    if campaign.calibration is not None and campaign.calibration.positions is not None:
        return [campaign.calibration.positions]
    return []


def _inputs_of_scenario(file: Path) -> Iterable[str]:
    if file.suffix.lower() != ".toml":
        raise InputError(f"{file}: simulation.scenario must be a scenario file (TOML)")
    scenario = read_scenario(file)
    for setting in scenario.fmus.values():
        yield from (name for name in (setting.fmu, setting.parameters_from) if name is not None)
    for stimulus in scenario.stimuli:
        yield from (name for name in (stimulus.csv, stimulus.programme) if name is not None)


@cache
def code_hash() -> str:
    """Hash of the code that results follow from, and of the versions of what it uses."""
    digest = hashlib.sha256(f"{platform.python_version()} {platform.machine()}".encode())
    for package in _PACKAGES:
        digest.update(f"\0{package} {metadata.version(package)}".encode())
    tools = Path(__file__).parents[1]
    folders = [Path(str(package.__file__)).parent for package in (models, fmus)]
    folders += [tools / name for name in _CODE]
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            digest.update(f"\0{path.relative_to(folder).as_posix()}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Versions that the manifest names."""
    return {name: metadata.version(name) for name in _PACKAGES} | {"python": platform.python_version()}


class Design:
    """The runs of a campaign.

    Parameters
    ----------
    campaign : Campaign
    """

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        self._chunk: tuple[int, NDArray] | None = None

    @cached_property
    def _lists(self) -> dict[str, list[Any]]:
        return {name: axis.listed() for name, axis in self.campaign.lists.items()}

    @cached_property
    def _hypercube(self) -> NDArray:
        """All points of a Latin hypercube: it has no shorter description."""
        sampler = qmc.LatinHypercube(len(self.campaign.distributions), rng=self._generator())
        return sampler.random(self.campaign.sampling.points)

    def _generator(self, *key: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.campaign.seed, spawn_key=(_SAMPLES_STREAM, *key)))

    def _sobol(self, columns: int, row: int) -> NDArray:
        """A row of a scrambled Sobol sequence of so many columns."""
        chunk, at = divmod(row, _CHUNK)
        if self._chunk is None or self._chunk[0] != chunk:
            sampler = qmc.Sobol(columns, rng=self._generator())
            if chunk:
                sampler.fast_forward(chunk * _CHUNK)
            self._chunk = (chunk, sampler.random(_CHUNK))
        return self._chunk[1][at]

    def _cube(self, sample: int) -> NDArray:
        """The point of a sample in the unit cube of the distributions."""
        campaign, count = self.campaign, len(self.campaign.distributions)
        method = campaign.sampling.method
        if method == "latin-hypercube":
            return self._hypercube[sample]
        if method == "sobol":
            return self._sobol(count, sample)
        if method == "saltelli":
            block, row = divmod(sample, campaign.sampling.points)
            both = self._sobol(2 * count, row)
            point = both[count:] if block == 1 else both[:count].copy()
            if block > 1:
                point[block - 2] = both[count + block - 2]
            return point
        return self._generator(sample).random(count)

    def values(self, run: int) -> dict[str, Value]:
        """The parameters of a run, in the order of the file."""
        campaign = self.campaign
        combination, sample = divmod(run // campaign.repeats, campaign.samples)
        spread = campaign.distributions
        cube = self._cube(sample) if spread else np.zeros(0)
        drawn = {name: float(axis.quantile(u)) for (name, axis), u in zip(spread.items(), cube, strict=True)}
        listed: dict[str, Value] = {}
        for name, values in reversed(self._lists.items()):
            at = combination % len(values)
            listed[name] = values[at]
            if campaign.sampling.lists == "product":
                combination //= len(values)
        return {name: listed[name] if name in listed else drawn[name] for name in campaign.parameters}

    def seed(self, run: int) -> np.random.SeedSequence:
        """The seed of everything in a run that is random beside its parameters."""
        number = run
        if self.campaign.sampling.method == "saltelli":
            number = run % self.campaign.sampling.points
        return np.random.SeedSequence(self.campaign.seed, spawn_key=(_ERRORS_STREAM, number))


def short_seed(seed: np.random.SeedSequence) -> int:
    """A seed as the components take one, from 0 to 2**31 - 1."""
    return int(seed.generate_state(1, np.uint32)[0] >> 1)
