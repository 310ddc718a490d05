"""Campaign files: what is run how often, with which parameters, what is kept of a run, what is computed over all."""

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from ..errors import InputError
from ..field_problems import FieldProblem, field_problems
from .axes import Axis
from .computations import Computation
from .settings import AttitudeSetting, CalibrationSetting, HiddenSetting, SimulationSetting

SCHEMA = "trihedron.campaign/1"
KINDS = ("calibration", "attitude", "simulation", "hidden")
MOST_RUNS = 10**10
MOST_FILES_ASKED = 10**6
MOST_CUBE = 50_000_000
"""Numbers of a Latin hypercube that every worker holds."""
RUNS_OF_PARTITION = {"calibration": 50, "attitude": 50, "simulation": 50, "hidden": 5}
"""Runs in a file of the data set where nothing else is said; more in large campaigns, for few files."""
MOST_FILES = 4000
MOST_OF_PARTITION = 5000
"""Runs in a file all the same: a worker holds a file in memory, and what it is killed in is lost."""
_NOT_IN_FILES = ("base_folder",)


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Sampling(_Section):
    """How distributions are sampled, and whether lists of values are combined or taken together."""

    method: Literal["random", "latin-hypercube", "sobol", "saltelli"] = "random"
    points: Annotated[int, Field(ge=1, le=2**30)] = 1
    lists: Literal["product", "together"] = "product"

    @model_validator(mode="after")
    def _power_of_two(self) -> "Sampling":
        if self.method == "saltelli" and self.points & (self.points - 1):
            below = 1 << (self.points.bit_length() - 1)
            raise ValueError(f"points = {self.points}: saltelli needs a power of two, as {below} or {2 * below}")
        return self


class Keep(_Section):
    """What is kept of each run: scalars (all without a list), its record, a diagnosis."""

    scalars: list[str] | None = None
    record: bool = False
    diagnosis: bool = False


class Campaign(_Section):
    """A campaign; `base_folder` is where its relative paths begin."""

    schema_: Literal["trihedron.campaign/1"] = Field(default=SCHEMA, alias="schema")
    title: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    repeats: Annotated[int, Field(ge=1, le=10**10)] = 1
    partition: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    calibration: CalibrationSetting | None = None
    attitude: AttitudeSetting | None = None
    simulation: SimulationSetting | None = None
    hidden: HiddenSetting | None = None
    sampling: Sampling = Field(default_factory=Sampling)
    parameters: dict[str, Axis] = Field(default_factory=dict)
    keep: Keep = Field(default_factory=Keep)
    compute: list[Computation] = Field(default_factory=list)
    base_folder: Path = Field(default_factory=Path, exclude=True)

    @field_validator("base_folder", mode="before")
    @classmethod
    def _folder(cls, value: Any) -> Path:
        return Path(value)

    @model_validator(mode="after")
    def _fits(self) -> "Campaign":
        kinds = [name for name in KINDS if getattr(self, name) is not None]
        if len(kinds) != 1:
            raise ValueError(f"give one section of {', '.join(KINDS)}; here: {' and '.join(kinds) or 'none'}")
        listed = [axis for axis in self.parameters.values() if axis.discrete]
        spread = len(self.parameters) - len(listed)
        method = self.sampling.method
        if method == "saltelli" and (listed or not spread or self.repeats != 1):
            raise ValueError('sampling.method = "saltelli" takes distributions only, at least one, and no repeats')
        if self.sampling.points != 1 and not spread:
            raise ValueError("sampling.points: no parameter has a distribution; repeats runs the same again")
        if method == "latin-hypercube" and self.sampling.points * spread > MOST_CUBE:
            raise ValueError(f"sampling.points: a Latin hypercube has at most {MOST_CUBE} numbers; sobol has no limit")
        if self.sampling.lists == "together" and len({len(axis.listed()) for axis in listed}) > 1:
            raise ValueError('sampling.lists = "together": the lists must be equally long')
        if kinds == ["hidden"] and self.parameters:
            raise ValueError("parameters: a hidden-effect case is drawn by its number; repeats says how many")
        if self.runs > MOST_RUNS:
            raise ValueError(f"{self.runs} runs are too many; at most {MOST_RUNS}: split the campaign by its seed")
        if self.partition is not None and -(-self.runs // self.partition) > MOST_FILES_ASKED:
            raise ValueError(f"partition = {self.partition}: that makes more than {MOST_FILES_ASKED} files")
        return self

    @property
    def kind(self) -> str:
        """What a run is: the name of the section that is given."""
        return next(name for name in KINDS if getattr(self, name) is not None)

    @property
    def distributions(self) -> dict[str, Axis]:
        """Parameters that are sampled."""
        return {name: axis for name, axis in self.parameters.items() if not axis.discrete}

    @property
    def lists(self) -> dict[str, Axis]:
        """Parameters whose values are listed."""
        return {name: axis for name, axis in self.parameters.items() if axis.discrete}

    @property
    def combinations(self) -> int:
        """How many combinations of listed values there are."""
        lengths = [len(axis.listed()) for axis in self.lists.values()]
        if self.sampling.lists == "together":
            return lengths[0] if lengths else 1
        count = 1
        for length in lengths:
            count *= length
        return count

    @property
    def samples(self) -> int:
        """How many points are drawn from the distributions."""
        spread = len(self.distributions)
        if not spread:
            return 1
        return self.sampling.points * (spread + 2 if self.sampling.method == "saltelli" else 1)

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return self.combinations * self.samples * self.repeats

    @property
    def partition_size(self) -> int:
        """Runs in each file of the data set, the last one's excepted; it follows from the file alone."""
        wanted = max(RUNS_OF_PARTITION[self.kind], -(-self.runs // MOST_FILES))
        return self.partition or min(wanted, MOST_OF_PARTITION)

    def as_written(self) -> dict[str, Any]:
        """The campaign with its defaults filled in, as plain values."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


def campaign_problems(error: ValidationError) -> list[FieldProblem]:
    """Everything that is wrong with a campaign file."""
    return field_problems(error, Campaign, _NOT_IN_FILES)


def parse_campaign(content: bytes, path: Path) -> Campaign:
    """A campaign from the bytes of its file; arguments and errors as for `read_campaign`."""
    try:
        data = tomllib.loads(content.decode("utf-8-sig").replace("\r\n", "\n"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start + 1})") from error
    except (tomllib.TOMLDecodeError, ValueError) as error:
        raise InputError(f"{path}: is not TOML: {error}") from error
    except RecursionError as error:
        raise InputError(f"{path}: is not a campaign (nested too deeply)") from error
    if "schema" not in data:
        raise InputError(f'{path}: schema is missing; write schema = "{SCHEMA}"')
    if "base_folder" in data:
        raise InputError(f"{path}: base_folder: unknown key; it is not for files")
    try:
        return Campaign.model_validate({**data, "base_folder": path.parent})
    except ValidationError as error:
        raise InputError(f"{path}: {campaign_problems(error)[0].text}") from error


def read_campaign(path: Path) -> Campaign:
    """Read a campaign file and check it down to each field.

    Parameters
    ----------
    path : Path
        a TOML file of schema trihedron.campaign/1

    Raises
    ------
    InputError
        not a file, not UTF-8, not TOML (with the line), or a field that is missing, unknown or wrong
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    return parse_campaign(content, path)
