"""Campaign files: the kind and number of runs, their parameters, the kept outputs, the computations over all runs."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator
from scipy.special import ndtri

from ..result import Section, read_sections

SCHEMA = "trihedron.campaign/1"
KINDS = ("calibration", "attitude", "simulation", "hidden")
MOST_RUNS = 10**10
MOST_FILES_ASKED = 10**6
MOST_CUBE = 50_000_000
"""Largest Latin hypercube [numbers]: every worker holds it."""
RUNS_OF_PARTITION = {"calibration": 50, "attitude": 48, "simulation": 50, "hidden": 5}
"""Default number of runs in a file of the data set; large campaigns have more, to keep the files few."""
MOST_FILES = 4000
MOST_OF_PARTITION = 5000
"""Largest number of runs in a file: a worker holds a file in memory and loses it if it is killed."""
Value = float | str | bool
"""Value of a parameter in a run."""
Number = Annotated[float, Field(allow_inf_nan=False)]
Pair = tuple[Number, Number]
Span = tuple[Number, Number, Annotated[int, Field(ge=2, le=1_000_000)]]

DISCRETE = ("values", "grid", "log_grid")
DISTRIBUTIONS = ("uniform", "log_uniform", "normal", "truncated_normal", "triangular")
MOST_DEVIATIONS = 3.0
"""Ends of a truncated normal distribution [standard deviations]."""
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
TwoNumbers = Annotated[tuple[float, float], Field(strict=False)]
Whole = Annotated[tuple[int, int], Field(strict=False)]
Names = Annotated[list[str], Field(min_length=1)]
Part = Annotated[float, Field(ge=0.0, le=1.0)]


class Axis(Section):
    """Variation of one parameter; exactly one of the fields is given.

    Attributes
    ----------
    values : list
        a list of values
    grid, log_grid : (first, last, count)
        evenly spaced, or by even factors
    uniform, log_uniform : (low, high)
        uniform distribution of the value or of its logarithm
    normal, truncated_normal : (mean, standard deviation)
        the second ends at three standard deviations
    triangular : (low, most likely, high)
        triangular distribution
    """

    values: Annotated[list[bool | int | Number | str], Field(min_length=1, max_length=1_000_000)] | None = None
    grid: Annotated[Span, Field(strict=False)] | None = None
    log_grid: Annotated[Span, Field(strict=False)] | None = None
    uniform: Annotated[Pair, Field(strict=False)] | None = None
    log_uniform: Annotated[Pair, Field(strict=False)] | None = None
    normal: Annotated[Pair, Field(strict=False)] | None = None
    truncated_normal: Annotated[Pair, Field(strict=False)] | None = None
    triangular: Annotated[tuple[Number, Number, Number], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _one(self) -> "Axis":
        names = (*DISCRETE, *DISTRIBUTIONS)
        fields = self.given(*names)
        if len(fields) != 1:
            raise ValueError(f"give one of {', '.join(names)}; here: {' and '.join(fields) or 'none'}")
        for name in ("log_grid", "log_uniform"):
            pair = getattr(self, name)
            if pair is not None and not (pair[0] > 0.0 and pair[1] > 0.0):
                raise ValueError(f"{name} = {list(pair)} needs positive ends")
        for name in ("uniform", "log_uniform", "triangular"):
            ends = getattr(self, name)
            if ends is not None and not (sorted(ends) == list(ends) and ends[0] < ends[-1]):
                raise ValueError(f"{name} = {list(ends)} must rise")
        for name in ("normal", "truncated_normal"):
            pair = getattr(self, name)
            if pair is not None and not pair[1] > 0.0:
                raise ValueError(f"{name} = {list(pair)}: the standard deviation must be positive")
        if len({type(v) if isinstance(v, bool | str) else float for v in self.values or ()}) > 1:
            raise ValueError("values must be all numbers, all texts, or all true or false")
        return self

    @property
    def discrete(self) -> bool:
        """True if the values are listed one by one."""
        return bool(self.given(*DISCRETE))

    def listed(self) -> list[Any]:
        """Return the values of a discrete axis; numbers as floats."""
        if self.values is not None:
            for value in self.values:
                if isinstance(value, bool | str):
                    return list(self.values)
            return [float(value) for value in self.values]
        if self.grid is not None:
            return np.linspace(self.grid[0], self.grid[1], self.grid[2]).tolist()
        assert self.log_grid is not None
        return np.geomspace(self.log_grid[0], self.log_grid[1], self.log_grid[2]).tolist()

    def quantile(self, part: ArrayLike) -> NDArray:
        """Return the quantiles of a distribution at these probabilities, from 0 to 1."""
        u = np.asarray(part, dtype=float)
        if self.uniform is not None:
            low, high = self.uniform
            return low + u * (high - low)
        if self.log_uniform is not None:
            low, high = self.log_uniform
            return low * np.exp(u * math.log(high / low))
        if self.normal is not None:
            return self.normal[0] + self.normal[1] * ndtri(np.clip(u, 2.0**-54, 1.0 - 2.0**-53))
        if self.truncated_normal is not None:
            # Probability of each tail beyond the ends.
            tail = 0.5 * math.erfc(MOST_DEVIATIONS / math.sqrt(2.0))
            return self.truncated_normal[0] + self.truncated_normal[1] * ndtri(tail + u * (1.0 - 2.0 * tail))
        assert self.triangular is not None
        low, top, high = self.triangular
        below = (top - low) / (high - low)
        rising = low + np.sqrt(u * (high - low) * (top - low))
        return np.where(u < below, rising, high - np.sqrt((1.0 - u) * (high - low) * (high - top)))


class CalibrationSetting(Section):
    """A static calibration: readings of a bench at some positions, with errors within σ, calibrated.

    Attributes
    ----------
    positions : str
        CSV file with alpha_deg, beta_deg; by default the 24 positions of scenarios/static-calibration-positions.csv
    truth : "drawn" or "given"
        parameters that are not swept: drawn within the bounds for each run, or zero
    noise : str
        "uniform" within ± noise_part σ, or "edge": ± noise_part σ
    noise_part : float
        size of the errors as a part of σ
    noise_bound, gravity, baseline, convention, bounds
        as for `calibrate`
    """

    positions: str | None = None
    truth: Literal["drawn", "given"] = "drawn"
    noise: Literal["uniform", "edge"] = "uniform"
    noise_part: Annotated[float, Field(ge=0.0, le=1e6)] = 1.0
    noise_bound: Positive = 1e-5
    gravity: Positive = 9.80665
    baseline: Literal["asymmetric", "symmetric"] = "asymmetric"
    convention: Literal["A1", "A2"] = "A1"
    bounds: TwoNumbers = (3e-3, 1e-2)


class AttitudeSetting(Section):
    """An attitude run: a motion, gyros with errors, an algorithm, compared with the true attitude.

    Attributes
    ----------
    motion : str
        motion of the paper: 1 to 6, small, first, second
    duration_s, rate_hz : float
        length of the run [s], gyro samples a second
    algorithm : str
        name of an attitude algorithm
    noise_bound_radps : float
        bound of the gyros' errors of each sample [rad/s]
    """

    motion: str = "1"
    duration_s: Positive = 60.0
    rate_hz: Positive = 1000.0
    algorithm: str = "two-sample-rodrigues"
    noise_bound_radps: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _size(self) -> "AttitudeSetting":
        if not 8 <= self.duration_s * self.rate_hz <= 1e8:
            raise ValueError("duration_s times rate_hz: a run has from 8 to 100,000,000 samples")
        return self


class Reduction(Section):
    """A number from a column of a run's record."""

    column: str
    take: Literal["last", "first", "mean", "min", "max", "max-abs", "rms", "std"] = "last"


class SimulationSetting(Section):
    """A scenario, simulated.

    Attributes
    ----------
    scenario : str
        its file
    seeds : "derived" or "fixed"
        parameters `seed` of the FMUs: a new one for each run, or the scenario's
    scalars : dict
        name -> column of the record and reduction; by default the last value of every column
    calibrate : bool
        average the rests of the record and calibrate them too
    noise_bound : float
        σ of that calibration
    """

    scenario: str
    seeds: Literal["derived", "fixed"] = "derived"
    scalars: dict[str, Reduction] | None = None
    calibrate: bool = False
    noise_bound: Positive = 1e-5


class HiddenSetting(Section):
    """A case of the hidden-effect suite: drawn, measured in time, diagnosed.

    Attributes
    ----------
    suite : str or None
        suite of scenarios/hidden/suites.toml; it sets the other fields, its seed and number of cases
    mode, effects, positions, noise, size
        as for `trihedron hidden`, without a suite
    """

    suite: str | None = None
    mode: Literal["clean", "single", "between", "pairs"] = "single"
    effects: list[str] = Field(default_factory=list)
    positions: Whole = (12, 100)
    noise: Literal["uniform", "edge", "correlated", "all"] = "all"
    size: TwoNumbers | None = None

    @model_validator(mode="after")
    def _suite_decides(self) -> "HiddenSetting":
        decided = sorted(self.model_fields_set - {"suite"})
        if self.suite is not None and decided:
            raise ValueError(f"{decided[0]} is what suite decides")
        return self


class Computation(Section):
    """One computation; exactly one of quantiles, rate, confusion and sensitivity is given.

    Attributes
    ----------
    quantiles : list of str
        scalars whose quantiles `at` these probabilities are computed
    rate : str
        a scalar; how often it is one of `is`, by default over all runs, or over ranges of `against` with these `edges`
    confusion : str
        a text; how often each of its values goes with each value of `of`
    sensitivity : list of str
        scalars whose dependence on the parameters is computed: Sobol indices of a Saltelli sampling, else rank
        correlations
    """

    quantiles: Names | None = None
    at: Annotated[list[Part], Field(min_length=1)] | None = None
    rate: str | None = None
    values: Annotated[list[str | bool], Field(min_length=1)] | None = Field(default=None, alias="is")
    against: str | None = None
    edges: Annotated[list[float], Field(min_length=2)] | None = None
    confusion: str | None = None
    of: str | None = None
    sensitivity: Names | None = None

    @model_validator(mode="after")
    def _one(self) -> "Computation":
        kinds = self.given("quantiles", "rate", "confusion", "sensitivity")
        if len(kinds) != 1:
            raise ValueError(
                f"give one of quantiles, rate, confusion, sensitivity; here: {' and '.join(kinds) or 'none'}"
            )
        companions: dict[str, tuple[str, ...]] = {"quantiles": ("at",), "rate": ("values", "against", "edges")}
        companions_of_kind = {**companions, "confusion": ("of",), "sensitivity": ()}[kinds[0]]
        for name in ("at", "values", "against", "edges", "of"):
            if getattr(self, name) is not None and name not in companions_of_kind:
                key = name
                if name == "values":
                    key = "is"
                raise ValueError(f"{key} does not go with {kinds[0]}")
        if self.rate is not None and self.values is None:
            raise ValueError('rate needs is = ["...", ...], the values that count')
        if (self.against is None) != (self.edges is None):
            raise ValueError("against and edges go together")
        if self.edges is not None and not all(a < b for a, b in zip(self.edges, self.edges[1:], strict=False)):
            raise ValueError("edges must rise")
        if self.confusion is not None and self.of is None:
            raise ValueError('confusion needs of = "...", the column of what is true')
        return self

    @property
    def names(self) -> list[str]:
        """Return the columns that the computation reads."""
        names = list(self.quantiles or [])
        names += self.sensitivity or []
        for name in (self.rate, self.against, self.confusion, self.of):
            if name is not None:
                names.append(name)
        return names


class SamplingSetting(Section):
    """Sampling of distributions, and the combination of lists of values (every combination, or taken together)."""

    method: Literal["random", "latin-hypercube", "sobol", "saltelli"] = "random"
    points: Annotated[int, Field(ge=1, le=2**30)] = 1
    lists: Literal["product", "together"] = "product"

    @model_validator(mode="after")
    def _power_of_two(self) -> "SamplingSetting":
        if self.method == "saltelli" and self.points & (self.points - 1):
            below = 1 << (self.points.bit_length() - 1)
            raise ValueError(f"points = {self.points}: saltelli needs a power of two, as {below} or {2 * below}")
        return self


class Keep(Section):
    """Kept outputs of each run: scalars (by default all), its record, a diagnosis."""

    scalars: list[str] | None = None
    record: bool = False
    diagnosis: bool = False


class Campaign(Section):
    """A campaign; its relative paths begin at `base_folder`."""

    schema_: Literal["trihedron.campaign/1"] = Field(default=SCHEMA, alias="schema")
    title: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    repeats: Annotated[int, Field(ge=1, le=10**10)] = 1
    partition: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    calibration: CalibrationSetting | None = None
    attitude: AttitudeSetting | None = None
    simulation: SimulationSetting | None = None
    hidden: HiddenSetting | None = None
    sampling: SamplingSetting = Field(default_factory=SamplingSetting)
    parameters: dict[str, Axis] = Field(default_factory=dict)
    keep: Keep = Field(default_factory=Keep)
    compute: list[Computation] = Field(default_factory=list)
    base_folder: Path = Field(default_factory=Path, exclude=True)

    @model_validator(mode="after")
    def _fits(self) -> "Campaign":
        kinds = self.given(*KINDS)
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
        """Kind of the runs: the name of the section in the file."""
        return self.given(*KINDS)[0]

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
        """Number of combinations of listed values."""
        lengths = [len(axis.listed()) for axis in self.lists.values()]
        if self.sampling.lists == "together":
            lengths = lengths[:1]
        return math.prod(lengths)

    @property
    def samples(self) -> int:
        """Number of points that are drawn from the distributions."""
        spread = len(self.distributions)
        if spread and self.sampling.method == "saltelli":
            return self.sampling.points * (spread + 2)
        return self.sampling.points

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self.combinations * self.samples * self.repeats

    @property
    def partition_size(self) -> int:
        """Runs in each file of the data set except the last; it follows from the file alone."""
        usual = max(RUNS_OF_PARTITION[self.kind], -(-self.runs // MOST_FILES))
        return self.partition or min(usual, MOST_OF_PARTITION)

    @property
    def partitions(self) -> int:
        """Number of files of the data set."""
        return -(-self.runs // self.partition_size)

    def runs_of(self, partition: int) -> range:
        """Return the runs of a file."""
        first = partition * self.partition_size
        return range(first, min(first + self.partition_size, self.runs))

    def file_name(self, partition: int) -> str:
        """Return the name of a file; names in order are runs in order."""
        digits = max(5, len(str(self.partitions - 1)))
        return f"part-{partition:0{digits}d}.parquet"


def parse_campaign(content: bytes, path: Path) -> Campaign:
    """Return a campaign from the bytes of its file, checked field by field; errors are those of `read_sections`."""
    return read_sections(content, path, Campaign, base_folder=path.parent)
