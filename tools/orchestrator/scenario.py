"""Scenario files: FMUs with parameters, connections and stimuli, and the recorded columns."""

import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal

import numpy as np
import polars as pl
from pydantic import AfterValidator, BeforeValidator, Field, field_serializer, field_validator, model_validator

from ..errors import InputError
from ..files import LARGEST_TEXT, bytes_of, write_text
from ..result import Section, read_sections

SCHEMA = "trihedron.scenario/1"
MOST_STEPS = 10**9
_ROWS_OF_TEXT = 50_000
"""Rows of a table that are written as text at once."""


def _plain(value: Any) -> Any:
    """Return a scalar or a flat list of scalars, all finite; convert numpy scalars to Python's."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, tuple):
        value = list(value)
    for item in value if isinstance(value, list) else [value]:
        if not isinstance(item, bool | int | float | str):
            raise ValueError("give a number, true or false, a text, or a flat list of them")
        if isinstance(item, float) and not math.isfinite(item):
            raise ValueError(f"{item} is not a finite number")
    if value == []:
        raise ValueError("is an empty list; give at least one value")
    return value


def _frame(value: Any) -> Any:
    """Convert a table in memory to a polars DataFrame."""
    if isinstance(value, pl.DataFrame):
        return value
    if not isinstance(value, Mapping):
        raise ValueError("give a polars DataFrame or a mapping of column names to values")
    try:
        return pl.DataFrame(dict(value), strict=False)
    except (pl.exceptions.PolarsError, TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"is not a table ({str(error).splitlines()[0]})") from error


PathText = Annotated[
    str, BeforeValidator(lambda path: path.as_posix() if isinstance(path, PurePath) else path), Field(min_length=1)
]
Plain = Annotated[Any, AfterValidator(_plain)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class RunSetting(Section):
    """Time of the run [s] and the treatment of cycles; without `stop_s` the position programme ends the run.

    `coupling` selects the treatment of cycles of connections:

    - None: refuse them.
    - "jacobi": within a cycle every input is the output at the beginning of the step.
    - "iterate": repeat the step from the same state until the values that go around no longer change.
    - "delayed": every connection, in a cycle or not, passes on the output at the beginning of the step, like a master
      that passes outputs on after all FMUs have stepped.

    An FMU from a file runs in a process of its own, unless `in_process`. A call longer than `call_limit_s` [s] ends the
    run. So does an output that is not a number, unless `allow_nan`, and a parameter that an FMU does not hold, unless
    `accept_lost`. With `shorten` a step that does not divide the run is shortened at its end.
    `realtime` is the number of seconds of the run in a second of the clock; without it the run does not wait.
    """

    start_s: Finite = 0.0
    stop_s: Finite | None = None
    step_s: Positive
    coupling: Literal["jacobi", "iterate", "delayed"] | None = None
    tolerance: Positive | None = None
    iterations: Annotated[int, Field(ge=2, le=1_000_000)] | None = None
    in_process: bool | None = None
    call_limit_s: Positive | None = None
    accept_lost: bool | None = None
    allow_nan: bool | None = None
    shorten: bool | None = None
    realtime: Positive | None = None

    @property
    def allowed_change(self) -> float:
        """A value x that changes by less than allowed_change * (1 + |x|) in an iteration counts as settled."""
        return self.tolerance or 1e-12

    @property
    def most_iterations(self) -> int:
        """Largest number of iterations of a cycle."""
        return self.iterations or 50

    @model_validator(mode="after")
    def _fits(self) -> "RunSetting":
        settings = self.given("tolerance", "iterations")
        if settings and self.coupling != "iterate":
            raise ValueError(f'{settings[0]} goes with coupling = "iterate"')
        if self.stop_s is not None and self.stop_s <= self.start_s:
            raise ValueError(f"stop_s = {self.stop_s!r} must be after start_s = {self.start_s!r}")
        return self


@dataclass(frozen=True)
class RunOptions:
    """Options of a run beside its file: times [s], treatment of cycles, place of foreign FMUs.

    A scenario has its own times and cycles; an .ssp file has its own start and stop.
    """

    start: float | None = None
    stop: float | None = None
    step: float | None = None
    coupling: str | None = None
    in_process: bool = False
    call_limit: float | None = None
    accept_lost: bool = False
    allow_nan: bool = False
    realtime: float | None = None

    def __post_init__(self) -> None:
        for name in ("start", "stop", "step"):
            seconds = getattr(self, name)
            if seconds is not None and not math.isfinite(seconds):
                raise InputError(f"--{name} {seconds}: must be a finite number of seconds")
        if self.realtime is not None and not (self.realtime > 0.0 and math.isfinite(self.realtime)):
            raise InputError(f"--realtime {self.realtime:g}: must be greater than 0")
        if self.step is not None and not self.step > 0.0:
            raise InputError(f"--step {self.step:g}: must be greater than 0 s")

    def refuse(self, belongs: str, **keys: str) -> None:
        """Refuse each option that the file sets itself, with the key in the file."""
        for option, key in keys.items():
            if getattr(self, option) is not None:
                raise InputError(f"--{option}: belongs to {belongs}; {key}")

    def over(self, scenario: "Scenario") -> "Scenario":
        """Return the scenario with the options that it leaves to the command."""
        options = {"in_process": self.in_process or None, "call_limit_s": self.call_limit}
        options |= {
            "accept_lost": self.accept_lost or None,
            "allow_nan": self.allow_nan or None,
            "realtime": self.realtime,
        }
        if all(value is None for value in options.values()):
            return scenario
        if self.call_limit is not None and not (self.call_limit > 0.0 and math.isfinite(self.call_limit)):
            raise InputError(f"--call-limit: {self.call_limit} must be greater than 0 s")
        run = scenario.run.model_copy(update={key: value for key, value in options.items() if value is not None})
        return scenario.model_copy(update={"run": run})


class FmuSetting(Section):
    """One FMU of the scenario: a component of ours or a file, its effects and its parameters, its own step [s].

    `tolerance` is the relative tolerance of the solver: ours for an FMU of model exchange, otherwise the FMU's own.
    `interface` chooses model exchange or co-simulation if an FMU has both; co-simulation is usual. With
    `event_mode` (FMI 3.0) an FMU returns at its events, which are handled, and takes its inputs as at an event.
    """

    component: str | None = None
    flavour: Literal["native", "python"] | None = None
    fmu: PathText | None = None
    parameters_from: PathText | None = None
    parameters: dict[str, Plain] = Field(default_factory=dict)
    effects: list[dict[str, Any]] = Field(default_factory=list)
    step_s: Positive | None = None
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    interface: Literal["me", "cs"] | None = None
    event_mode: bool | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> "FmuSetting":
        if (self.component is None) == (self.fmu is None):
            raise ValueError('give either component = "..." or fmu = "...", one of the two')
        if self.flavour is not None and self.component is None:
            raise ValueError("flavour belongs to a component, not to an fmu file")
        if (self.tolerance or self.interface) and self.component is not None:
            raise ValueError("tolerance and interface belong to an fmu file")
        if self.event_mode and self.component is not None:
            raise ValueError("event_mode belongs to an fmu file; our components have none")
        if self.effects and self.component is None:
            raise ValueError("effects can be added to a component only, not to an fmu file")
        return self


class Connection(Section):
    """An output that feeds an input: whole arrays (`fmu.name`) or single elements (`fmu.name[2]`).

    `between` applies if the two FMUs have different steps. "hold" takes the last value; "interpolate" is linear between
    the values of a slower FMU; "sum" adds a faster FMU's values since the reader's previous step. The input is factor *
    output + offset, in the output's unit, and is then converted to its own, unless `convert` is false.
    """

    source: str = Field(alias="from")
    target: str = Field(alias="to")
    between: Literal["hold", "interpolate", "sum"] | None = None
    factor: Finite | None = None
    offset: Finite | None = None
    convert: bool | None = None


class Stimulus(Section):
    """Source of an input: a constant, timed rows (`csv`, `table` with `columns`) or a position programme.

    With `interpolate` rows are read as FMPy and fmusim read a table of inputs: continuous inputs linearly at the
    beginning of each step, in the inputs' units. The first and the last row hold before and after.
    """

    to: str | None = None
    constant: Plain | None = None
    csv: PathText | None = None
    stamp: Literal["start", "end"] | None = None
    columns: dict[str, str] | None = None
    programme: PathText | None = None
    dwell_s: Positive | None = None
    table: Annotated[Any, BeforeValidator(_frame)] = None
    interpolate: bool | None = None

    @property
    def kind(self) -> Literal["constant", "rows", "programme"]:
        """Kind of the stimulus."""
        if self.constant is not None:
            return "constant"
        if self.columns is not None:
            return "rows"
        return "programme"

    @model_validator(mode="before")
    @classmethod
    def _nothing_is_absent(cls, fields: Any) -> Any:
        if not isinstance(fields, dict):
            return fields
        return {key: value for key, value in fields.items() if value is not None}

    @model_validator(mode="after")
    def _one_kind(self) -> "Stimulus":
        sources = self.given("constant", "csv", "programme", "table")
        if len(sources) != 1:
            names = " and ".join(sources) or "none"
            raise ValueError(f"give one of constant, csv, programme and table; here: {names}")
        if sources == ["csv"] and not self.columns:
            raise ValueError('csv needs columns = { "fmu.variable" = "column", ... }')
        if sources != ["csv"] and sources != ["table"] and self.columns is not None:
            raise ValueError(f"columns goes with csv, not with {sources[0]}")
        if (self.to is None) == (self.columns is None):
            if self.to is None:
                raise ValueError('give to = "fmu.variable"')
            raise ValueError("give to or columns, not both of them")
        if self.stamp is not None and self.kind != "rows":
            raise ValueError("stamp goes with csv only")
        if self.interpolate and (self.kind != "rows" or self.stamp is not None):
            raise ValueError("interpolate goes with csv only, and without stamp")
        if self.dwell_s is not None and self.kind != "programme":
            raise ValueError("dwell_s goes with a programme only")
        if self.kind == "rows" and self.stamp is None:
            object.__setattr__(self, "stamp", "start")
        return self

    @field_serializer("table")
    def _described(self, table: Any) -> dict[str, Any] | None:
        if table is None:
            return None
        digest = hashlib.sha256()
        # Part by part: as one text, an hour at 1 kHz is larger than the rest of its run.
        for first in range(0, max(1, table.height), _ROWS_OF_TEXT):
            digest.update(table[first : first + _ROWS_OF_TEXT].write_csv(include_header=first == 0).encode())
        return {"columns": table.columns, "rows": table.height, "sha256_of_csv": digest.hexdigest()}


class RecordSetting(Section):
    """Settings of the record: interval in steps, file format, columns.

    With `own_units` a column is in its variable's unit, and its name need not say so.
    """

    every: int = Field(default=1, ge=1, le=MOST_STEPS)
    format: Literal["parquet", "csv"] = "parquet"
    columns: dict[str, str] | None = None
    own_units: bool | None = None

    @field_validator("columns")
    @classmethod
    def _some(cls, columns: dict[str, str] | None) -> dict[str, str] | None:
        if columns is not None and not columns:
            raise ValueError("is empty; leave it out to record every output")
        return columns


class Scenario(Section):
    """A scenario; its relative paths begin at `base_folder`, and `source` is its file."""

    schema_: Literal["trihedron.scenario/1"] = Field(default=SCHEMA, alias="schema")
    title: str = ""
    run: RunSetting
    fmus: dict[str, FmuSetting] = Field(min_length=1)
    connections: list[Connection] = Field(default_factory=list)
    stimuli: list[Stimulus] = Field(default_factory=list)
    record: RecordSetting = Field(default_factory=RecordSetting)
    notes: list[str] = Field(default_factory=list, exclude=True)
    """Sentences about the file that the user must know."""
    base_folder: Path = Field(default_factory=Path, exclude=True)
    source: Path | None = Field(default=None, exclude=True)

    @field_validator("fmus")
    @classmethod
    def _named(cls, fmus: dict[str, FmuSetting]) -> dict[str, FmuSetting]:
        for name in fmus:
            if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", name):
                raise ValueError(f"'{name}' cannot name an FMU; use letters, digits, _ and -")
        return fmus

    def stride(self, name: str) -> int:
        """Return the number of run steps in one step of an FMU.

        Raises InputError if the FMU's step is not a whole multiple.
        """
        step, base = self.fmus[name].step_s, self.run.step_s
        if step is None:
            return 1
        ratio = step / base
        stride = round(min(ratio, MOST_STEPS))
        if not 1 <= stride < MOST_STEPS or abs(ratio - stride) > 1e-9 * stride:
            raise InputError(f"fmus.{name}.step_s = {step!r} is not a whole multiple of run.step_s = {base!r}")
        return stride


def read_scenario(path: Path | str) -> Scenario:
    """Read a scenario file (TOML) and check every field; its `base_folder` is the folder of the file.

    Raises
    ------
    InputError
        if the file is not UTF-8 or not TOML (with the line), or if a field is missing, unknown or wrong
    """
    path = Path(path)
    content = bytes_of(path, "the file of a scenario is needed", most=LARGEST_TEXT)
    return read_sections(content, path, Scenario, base_folder=path.parent, source=path)


def write_scenario(scenario: Scenario, path: Path) -> list[Path]:
    """Write a scenario as a TOML file, its tables in memory as CSV files beside it; return all files, the scenario
    first.

    Raises InputError if it cannot be written.
    """
    written, files = scenario.as_written(), [path]
    for number, stimulus in enumerate(scenario.stimuli, start=1):
        if stimulus.table is not None:
            rows = path.with_name(f"{path.stem}-rows{number if number > 1 else ''}.csv")
            write_text(rows, stimulus.table.write_csv())
            described = written["stimuli"][number - 1]
            written["stimuli"][number - 1] = {"csv": rows.name, **{k: v for k, v in described.items() if k != "table"}}
            files.append(rows)
    write_text(path, "\n".join(_toml_lines(written, "")).strip() + "\n")
    return files


def _toml_lines(table: Mapping[str, Any], name: str) -> Iterator[str]:
    """Yield the lines of a TOML table without its empty entries."""
    filled = {key: value for key, value in table.items() if value not in ({}, [])}

    def is_table(value: Any) -> bool:
        return isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict))

    def said(key: str) -> str:
        # JSON's strings, numbers, booleans and flat lists are valid TOML.
        if re.fullmatch(r"[A-Za-z0-9_-]+", key):
            return key
        return json.dumps(key, ensure_ascii=False)

    for key, value in filled.items():
        if not is_table(value):
            yield f"{said(key)} = {json.dumps(value, ensure_ascii=False)}"
    for key, value in filled.items():
        if is_table(value):
            inner = f"{name}.{said(key)}" if name else said(key)
            for entry in value if isinstance(value, list) else [value]:
                # A table that has only tables needs no heading.
                if isinstance(value, list) or not all(map(is_table, entry.values())):
                    yield from ("", f"[[{inner}]]" if isinstance(value, list) else f"[{inner}]")
                yield from _toml_lines(entry, inner)
