"""Stimuli: the value of each driven input over each step; steps are counted, and tables of numbers read strictly.

Time is counted in whole steps, never accumulated. A position programme commands a table and may set the end of a run.
"""

import csv
import io
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...models.table_commands import TICK_TOLERANCE, move_duration
from ..errors import InputError, nearest, said_of
from ..files import advice_on, bytes_of, fault_of_parquet
from .interface import FmuVariable, Interface, Value, checked, conversion, is_angle, refer_to, spread
from .load import Loaded, Sources, interfaces_of
from .scenario import MOST_STEPS, RunSetting, Scenario, Stimulus
from .wiring import Wire

ROW_TOLERANCE = 1e-3
"""Largest distance [steps] of a row's time from its tick: files drop digits."""
GIVEN_BY_TABLE = {"rate": "block_rate", "angle": "angle", "specific_force": "specific_force"}
"""Outputs of a table that feed the inputs of effects."""
PROGRAMME_COLUMNS = ["alpha_deg", "beta_deg", "dwell_s"]


@dataclass(frozen=True)
class StepGrid:
    """The communication points: t_k = start + k step, k = 0 to steps."""

    start: float
    step: float
    steps: int
    stop: float = math.inf
    """End of a shortened last step [s]."""
    notes: tuple[str, ...] = ()
    """Remarks on the steps for the user."""

    def time(self, tick: int) -> float:
        """t_k [s]."""
        return min(self.start + tick * self.step, self.stop)

    @property
    def end(self) -> float:
        """Time that no step passes, by no rounding [s]."""
        return min(max(self.time(self.steps), self.time(self.steps - 1) + self.step), self.stop)

    def of_every(self, stride: int, step: float | None) -> "StepGrid":
        """Return the points of an FMU whose step of this length [s] has this many steps of the run."""
        return StepGrid(self.start, step or self.step, self.steps // stride, self.stop)


@dataclass(frozen=True)
class Drive:
    """Values for some inputs of one FMU: row i of `values` from its step `begins[i]` on; without `begins`, always.

    With `times` [s] the rows hold at these times, and the FMU's solver interpolates between them.
    """

    fmu: str
    variables: tuple[FmuVariable, ...]
    values: list[list[Value]] | NDArray
    begins: NDArray | None
    times: NDArray | None = None


@dataclass(frozen=True)
class NumberTable:
    """Columns (N,) of finite numbers by name, under the label that the user wrote.

    `lines` (N,) are the line numbers of the rows, as an editor counts them.
    """

    label: str
    columns: dict[str, NDArray]
    lines: NDArray

    def row(self, index: int) -> str:
        """Return the file and the row, for a message."""
        return f"{self.label}, row {int(self.lines[index])}"


def make_grid(scenario: Scenario, programme_ends: Sequence[int], constant: Sequence[str] = ()) -> StepGrid:
    """Count the run's steps; without a stop time the longest programme ends the run.

    `constant` are FMUs whose step must not change. Raises InputError if a step does not divide the run, or if
    nothing sets its end.
    """
    run, strides = scenario.run, {name: scenario.stride(name) for name in scenario.fmus}
    if run.stop_s is None and not programme_ends:
        raise InputError("run.stop_s is missing (only a position programme says by itself when a run ends)")
    if run.stop_s is None:
        common = math.lcm(*strides.values())
        steps: float = math.ceil(max(programme_ends) / common) * common
    else:
        span = run.stop_s - run.start_s
        steps = ratio = span / run.step_s
        if ratio < 2**53:
            steps = round(ratio)
            divides = steps >= 1 and abs(steps * run.step_s - span) <= 1e-9 * span
            if not divides and run.shorten and set(strides.values()) == {1} and ratio < MOST_STEPS:
                return _shortened(run, run.stop_s, constant)
            if not divides:
                shorter, longer = span / max(1, math.floor(ratio)), span / max(1, math.ceil(ratio))
                fits = f"{longer!r} would" if shorter == longer else f"{longer:.9g} or {shorter:.9g} would"
                raise InputError(
                    f"run.step_s = {run.step_s!r} does not divide the run of {span!r} s ({ratio:.9g} steps); {fits}"
                )
    if steps > MOST_STEPS:
        count = steps if isinstance(steps, int) else f"{steps:.3g}"
        raise InputError(f"run.step_s = {run.step_s!r} makes {count} steps; at most {MOST_STEPS} are possible")
    for name, stride in strides.items():
        if steps % stride:
            span = f"the run of {steps * run.step_s:.9g} s"
            raise InputError(f"fmus.{name}.step_s = {scenario.fmus[name].step_s!r} does not divide {span}")
    return StepGrid(run.start_s, run.step_s, int(steps))


def _shortened(run: RunSetting, stop: float, constant: Sequence[str]) -> StepGrid:
    """Return steps with a shorter last one, or the whole steps if an FMU needs equal ones."""
    span = stop - run.start_s
    whole = math.floor(span / run.step_s)
    rest = span - whole * run.step_s
    ends = f"{run.step_s:.9g} s does not divide the run of {span:.9g} s"
    if constant and whole:
        reached = run.start_s + whole * run.step_s
        note = f"{ends}: the run ends at {reached:.9g} s, since '{constant[0]}' allows no shorter last step"
        return StepGrid(run.start_s, run.step_s, whole, notes=(note,))
    note = f"{ends}: the last step is {rest:.9g} s long"
    return StepGrid(run.start_s, run.step_s, whole + 1, stop, (note,))


def read_number_table(path: Path, label: str, names: Sequence[str] | None) -> tuple[NumberTable, bytes]:
    """Return columns of numbers (None: all) of a CSV or Parquet file (by the ending of its name), and the file's bytes.

    Raises InputError if the file is missing, not UTF-8, or lacks a column, and for a field that is empty or not a
    finite number (with row and column).
    """
    content = bytes_of(path, label=label)
    advice = advice_on(label, content, "record")
    if advice:
        raise InputError(f"{label}: is not a table of numbers{advice}")
    if path.suffix.lower() != ".parquet":
        return _read_csv(content, label, names), content
    wrong = fault_of_parquet(content)
    if wrong is not None:
        raise InputError(f"{label}: {wrong}")
    try:
        frame = pl.read_parquet(io.BytesIO(content))
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(f"{label}: is not a readable Parquet file ({str(error).splitlines()[0]})") from error
    return _table_from(frame, label, names), content


def _table_from(frame: pl.DataFrame, label: str, names: Sequence[str] | None) -> NumberTable:
    """Return columns of numbers from a table in memory; rows count from 1."""
    return _numbers(label, frame.select(_chosen(label, frame.columns, names)), np.arange(1, frame.height + 1))


def stimulus_table(
    stimulus: Stimulus, name: str, folder: Path, names: Sequence[str] | None = None
) -> tuple[NumberTable, bytes | None]:
    """Return columns of a stimulus' table, and the bytes of its file; None if it is in memory."""
    label = stimulus.csv or stimulus.programme
    if label is None:
        return _table_from(stimulus.table, f"{name}.table", names), None
    return read_number_table(folder / label, label, names)


def _chosen(label: str, header: Sequence[str], required: Sequence[str] | None) -> list[str]:
    """Return the required columns (by default all); each must occur exactly once."""
    names = list(dict.fromkeys(header if required is None else required))
    for name in names:
        if name not in header:
            raise InputError(f"{label}: has no column '{name}'; {nearest(name, list(header))}")
        if header.count(name) > 1:
            raise InputError(f"{label}: column '{name}' is there {header.count(name)} times")
    return names


def _read_csv(content: bytes, label: str, required: Sequence[str] | None) -> NumberTable:
    if b"\0" in content:
        raise InputError(f"{label}: is a binary file; a CSV file is needed")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content[: error.start].count(b"\n") + 1
        raise InputError(f"{label}, row {row}: is not UTF-8 text") from error
    numbered = enumerate(text.replace("\r\n", "\n").split("\n"), start=1)
    filled = []
    for number, line in numbered:
        if line.strip() and not line.startswith("#"):
            filled.append((number, line))
    if not filled:
        raise InputError(f"{label}: is empty; a header line with the columns' names is needed")
    (first, top), rows = filled[0], filled[1:]
    try:
        header = [name.strip() for name in next(csv.reader([top], strict=True))]
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{label}, row {first}: is not a header line ({error})") from error
    names = _chosen(label, header, required)
    for number, line in rows:
        fields = line.count(",") + 1
        if fields != len(header) and '"' not in line:
            raise InputError(f"{label}, row {number}: has {fields} fields; the header has {len(header)}")
    if not rows:
        raise InputError(f"{label}: has no rows")
    body = io.BytesIO("\n".join(line for _, line in rows).encode())
    try:
        frame = pl.read_csv(body, has_header=False, infer_schema=False)
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{label}: is not a readable CSV file ({str(error).splitlines()[0]})") from error
    if frame.shape != (len(rows), len(header)):
        raise InputError(f"{label}: rows and header do not have the same number of fields")
    frame.columns = [str(i) for i in range(len(header))]
    chosen = frame.select(pl.col(str(header.index(name))).alias(name) for name in names)
    return _numbers(label, chosen, np.array([number for number, _ in rows], dtype=np.int64))


def _numbers(label: str, frame: pl.DataFrame, lines: NDArray) -> NumberTable:
    columns = {}
    for name in frame.columns:
        text = frame[name]
        if text.dtype == pl.String:
            text = text.str.strip_chars()
        elif not text.dtype.is_numeric() and text.dtype not in (pl.Boolean, pl.Null):
            raise InputError(f"{label}, column '{name}': holds {text.dtype}, not numbers")
        numbers = text.cast(pl.Float64, strict=False)
        bad = numbers.is_null() | ~numbers.is_finite().fill_null(False)
        if bad.any():
            index = int(bad.arg_true()[0])
            written = frame[name][index]
            what = f"'{written}' is not a finite number"
            if written is None or written == "":
                what = "is empty"
            raise InputError(f"{label}, row {int(lines[index])}, column '{name}': {what}")
        columns[name] = np.ascontiguousarray(numbers.to_numpy(), dtype=np.float64)
    if frame.height == 0:
        raise InputError(f"{label}: has no rows")
    return NumberTable(label, columns, lines)


def resolve_constant(stimulus: Stimulus, interfaces: Mapping[str, Interface]) -> Drive:
    """Return a constant for an input or for each element of an array."""
    assert stimulus.to is not None
    assert stimulus.constant is not None
    interface, variables = refer_to("input", stimulus.to, interfaces)
    values = spread(stimulus.constant, variables, stimulus.to)
    return Drive(interface.name, variables, [[value for _, value in values]], None)


def resolve_rows(
    stimulus: Stimulus,
    table_with: Callable[[list[str]], NumberTable],
    grids: Mapping[str, StepGrid],
    interfaces: Mapping[str, Interface],
    solved: Collection[str],
) -> list[Drive]:
    """Return timed rows for inputs, one drive for each FMU and type; `table_with` returns the table of some columns.

    `grids` are the steps of each FMU; `solved` are those with a solver. Raises InputError for a column that is missing
    or differs in dimension from its variable, and for rows that do not cover the run.
    """
    assert stimulus.columns is not None
    ends: list[tuple[Interface, FmuVariable, str, tuple[float, float]]] = []
    for text, column in stimulus.columns.items():
        interface, variables = refer_to("input", text, interfaces)
        if len(variables) != 1:
            raise InputError(f"columns.'{text}' is an array; name each element: '{text}[1]' = \"...\"")
        if variables[0].value_type.by_address:
            raise InputError(f"columns.'{text}' is a {variables[0].kind}; rows are numbers")
        scaled = (1.0, 0.0)
        if not stimulus.interpolate:
            scaled = conversion(variables[0].unit, column, interface.scales)
        ends.append((interface, variables[0], column, scaled))
    names, increments = ["time_s"], False
    for interface, variable, column, _ in ends:
        names.append(column)
        increments = increments or is_angle(variable.unit, interface.scales)
    table = table_with(names)

    @cache
    def held(grid: StepGrid) -> tuple[NDArray, NDArray]:
        if stimulus.stamp == "end":
            return _rows_that_end(table, grid, increments=increments)
        return _rows_that_begin(table, grid)

    groups: dict[tuple[str, str], list[tuple[FmuVariable, NDArray]]] = {}
    for interface, variable, column, (factor, offset) in ends:
        values = table.columns[column]
        if (factor, offset) != (1.0, 0.0):
            values = (values - offset) / factor
        groups.setdefault((interface.name, variable.access), []).append((variable, values))
        _check_column(table, column, variable, values)
    drives = []
    for (fmu, _), group in groups.items():
        if stimulus.interpolate:
            drives += _interpolated(fmu, group, table, grids[fmu], solved=fmu in solved)
            continue
        rows, begins = held(grids[fmu])
        values = np.column_stack([values for _, values in group])
        # No copy if every row holds over some step: runs of an hour at 1 kHz are large.
        if len(rows) != len(values):
            values = values[rows]
        drives.append(Drive(fmu, tuple(variable for variable, _ in group), values, begins))
    return drives


def _interpolated(
    fmu: str, group: Sequence[tuple[FmuVariable, NDArray]], table: NumberTable, grid: StepGrid, *, solved: bool
) -> list[Drive]:
    """Return rows at the beginning of each step: continuous inputs linearly between rows, others from the last row.

    A solver takes continuous inputs at all times. Two rows of one time are a jump. Raises InputError if times go back.
    """
    times = table.columns["time_s"]
    back = np.flatnonzero(np.diff(times) < 0.0)
    if back.size:
        raise InputError(f"{table.row(int(back[0]) + 1)}: its time is before that of the row before")
    begins = np.arange(grid.steps)
    instants = grid.start + begins * grid.step
    last = np.searchsorted(times, instants + ROW_TOLERANCE * grid.step, side="right") - 1
    continuous, held = {}, {}
    for variable, values in group:
        if variable.kind == "Real" and variable.variability == "continuous":
            continuous[variable] = values
        else:
            held[variable] = values[np.maximum(last, 0)]
    drives = []
    if continuous and solved:
        after = times > grid.start
        instants = np.append(grid.start, times[after])
        columns = [np.append(np.interp(grid.start, times, v), v[after]) for v in continuous.values()]
        drives.append(Drive(fmu, tuple(continuous), np.column_stack(columns), None, instants))
    else:
        held |= {variable: np.interp(instants, times, values) for variable, values in continuous.items()}
    if held:
        drives.append(Drive(fmu, tuple(held), np.column_stack(list(held.values())), begins))
    return drives


def _ticks(table: NumberTable, grid: StepGrid) -> NDArray:
    """Return the times of the rows in steps, rounded where they are near a step."""
    times = table.columns["time_s"]
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        raise InputError(f"{table.row(int(back[0]) + 1)}, column 'time_s': does not come after the row before")
    ticks = (times - grid.start) / grid.step
    near = np.round(ticks)
    return np.where(np.abs(ticks - near) <= ROW_TOLERANCE, near, ticks)


def _held(begins: NDArray, grid: StepGrid) -> tuple[NDArray, NDArray]:
    """Return the rows that hold over a step, and their first steps, from rows that begin at fractional steps."""
    first = np.clip(begins, 0.0, grid.steps).astype(np.int64)
    rows = np.flatnonzero(np.diff(np.append(first, grid.steps)) > 0)
    return rows, first[rows]


def _rows_that_begin(table: NumberTable, grid: StepGrid) -> tuple[NDArray, NDArray]:
    """Return the rows that hold from their time on over some step, and the first step of each."""
    ticks = _ticks(table, grid)
    if ticks[0] > 0.0:
        raise InputError(
            f"{table.row(0)}: begins at {table.columns['time_s'][0]:.9g} s, after the run's start {grid.start:.9g} s: "
            'the input has no value before (stamp = "end" where rows hold up to their time)'
        )
    return _held(np.ceil(ticks), grid)


def _rows_that_end(table: NumberTable, grid: StepGrid, *, increments: bool) -> tuple[NDArray, NDArray]:
    """Return the rows that hold up to their time over some step, and the first step of each."""
    times, ticks = table.columns["time_s"], _ticks(table, grid)
    if ticks[-1] < grid.steps:
        raise InputError(
            f"{table.row(len(ticks) - 1)}: ends at {times[-1]:.9g} s, "
            f"before the run's end {grid.time(grid.steps):.9g} s"
        )
    width = np.append(np.diff(ticks[:2]), 1.0)[0]
    # Row i holds over the steps that end after the previous row's time and not after its own.
    rows, begins = _held(np.concatenate([[-math.inf], np.floor(ticks[:-1])]), grid)
    if rows[0] == 0 and ticks[0] - width > ROW_TOLERANCE:
        raise InputError(
            f"{table.row(0)}: its interval ends at {times[0]:.9g} s, "
            f"and nothing covers the run's start {grid.start:.9g} s"
        )
    lost = np.flatnonzero(np.diff(rows) > 1)
    if lost.size:
        at = int(lost[0]) + 1
        raise InputError(
            f"{table.label}: rows {table.lines[rows[at] - 1]} and {table.lines[rows[at]]} both end within the step "
            f"that ends at {grid.time(int(begins[at]) + 1):.9g} s, so that one is lost; take a shorter step_s"
        )
    again = np.flatnonzero(np.diff(np.append(begins, grid.steps)) > 1)
    if increments and again.size:
        row, step = int(rows[again[0]]), int(begins[again[0]]) + 1
        raise InputError(
            f"{table.row(row)}: an increment would be applied again in the step that ends at "
            f"{grid.time(step + 1):.9g} s; step_s must be the rows' interval"
        )
    return rows, begins


def _check_column(table: NumberTable, column: str, variable: FmuVariable, values: NDArray) -> None:
    """Refuse a value that the variable's type or limits do not allow."""
    suspects = np.arange(len(values))
    if variable.kind == "Real":
        # A missing bound is NaN, which no value exceeds.
        low, high = np.array([variable.minimum, variable.maximum], dtype=float)
        suspects = np.flatnonzero((values < low) | (values > high))
    for index in suspects.tolist():
        value: Value = float(values[index])
        if variable.kind == "Boolean" and value in (0.0, 1.0):
            value = bool(value)
        elif variable.kind in ("Integer", "Enumeration") and value == math.floor(value):
            value = int(value)
        with said_of(f"{table.row(index)}, column '{column}'"):
            checked(value, variable)


def resolve_programme(
    stimulus: Stimulus, table: NumberTable, scenario: Scenario, loaded: Mapping[str, Loaded]
) -> tuple[Drive, int]:
    """Lay a position programme out in whole steps of the FMU that it commands.

    Each position takes the move from the previous position (of the slower axis, with limited rate and acceleration) and
    the dwell, rounded up to whole steps. Returns the commands of the two angles [rad], and the step of the run at which
    it ends. Raises InputError for a column that a programme does not have, for a missing dwell, and for a target that
    is not a two-axis command.
    """
    for name in table.columns:
        if name not in PROGRAMME_COLUMNS:
            raise InputError(f"{table.label}: unknown column '{name}'; {nearest(name, PROGRAMME_COLUMNS)}")
    for name in PROGRAMME_COLUMNS[:2]:
        if name not in table.columns:
            has = ", ".join(PROGRAMME_COLUMNS)
            raise InputError(f"{table.label}: column '{name}' is missing; a programme has {has}")
    assert stimulus.to is not None
    interface, variables = refer_to("input", stimulus.to, interfaces_of(loaded))
    if len(variables) != 2 or any(v.kind != "Real" for v in variables):
        raise InputError(f"'{stimulus.to}' cannot take a position programme: two angles are needed")
    for variable in variables:
        if variable.unit not in (None, "rad"):
            raise InputError(f"'{stimulus.to}' is in {variable.unit}; a position programme gives rad")
    step = scenario.fmus[interface.name].step_s or scenario.run.step_s
    rates, accelerations, before = _limits(loaded[interface.name])
    if "dwell_s" not in table.columns and stimulus.dwell_s is None:
        raise InputError(f"{table.label}: has no column dwell_s, so the stimulus must give dwell_s")
    dwell = table.columns.get("dwell_s", np.full(len(table.lines), stimulus.dwell_s))
    command = np.radians(np.column_stack([table.columns["alpha_deg"], table.columns["beta_deg"]]))
    begins, tick = [], 0
    for row, target in enumerate(command.tolist()):
        if dwell[row] <= 0.0:
            raise InputError(f"{table.row(row)}, column 'dwell_s': {dwell[row]} must be positive")
        with said_of(table.row(row)):
            for variable, angle in zip(variables, target, strict=True):
                checked(angle, variable)
        turns = [abs(angle - previous) for angle, previous in zip(target, before, strict=True)]
        move = max(map(move_duration, turns, rates, accelerations))
        begins.append(tick)
        slot = (move + float(dwell[row])) / step
        if slot > MOST_STEPS:
            raise InputError(f"{table.row(row)}: takes {slot:.3g} steps; no run is that long")
        if slot <= TICK_TOLERANCE:
            raise InputError(f"{table.row(row)}: takes {slot:.3g} of a step; take a shorter step_s")
        tick += math.ceil(slot - TICK_TOLERANCE)
        before = target
    return Drive(interface.name, variables, command, np.array(begins)), tick * scenario.stride(interface.name)


def _limits(table: Loaded) -> list[list[float]]:
    """Return rates, accelerations and initial angles of a table's two axes."""
    limits, interface = [], table.interface
    for name in ("max_rate", "max_acceleration", "initial_angle"):
        try:
            variables = interface.find(name)
        except InputError as error:
            raise InputError(f"a position programme needs {name}[1..2] to time its moves: {error}") from error
        values = [v for v in map(table.start_value, variables) if isinstance(v, float)]
        if len(values) != 2 or len(variables) != 2:
            raise InputError(f"a position programme needs two numbers {name} of '{interface.name}' to time its moves")
        if name != "initial_angle" and min(values) <= 0.0:
            raise InputError(f"'{interface.name}.{name}' must be positive: {values}")
        limits.append(values)
    return limits


def resolve_stimuli(
    scenario: Scenario, sources: Sources, loaded: Mapping[str, Loaded]
) -> tuple[StepGrid, list[tuple[str, Drive]]]:
    """Return the run's grid, and the drives with their names; programmes come first because they may end the run."""

    def table(stimulus: Stimulus, name: str, columns: list[str] | None) -> NumberTable:
        read_columns, content = stimulus_table(stimulus, name, scenario.base_folder, columns)
        if content is not None:
            sources.note(read_columns.label, content)
        return read_columns

    interfaces = interfaces_of(loaded)
    stimuli = {f"stimuli[{number}]": stimulus for number, stimulus in enumerate(scenario.stimuli, start=1)}
    programmes: dict[str, tuple[Drive, int]] = {}
    for name, stimulus in stimuli.items():
        if stimulus.kind == "programme":
            with said_of(name):
                positions = table(stimulus, name, None)
                programmes[name] = resolve_programme(stimulus, positions, scenario, loaded)
    constant, solved = [], []
    for name, entry in loaded.items():
        simulation = entry.fmu.description.coSimulation
        if simulation is None:
            solved.append(name)
        elif not entry.fmu.says("canHandleVariableCommunicationStepSize"):
            constant.append(name)
    grid = make_grid(scenario, [end for _, end in programmes.values()], constant)
    grids = {name: grid.of_every(scenario.stride(name), setting.step_s) for name, setting in scenario.fmus.items()}
    drives: list[tuple[str, Drive]] = []
    for name, stimulus in stimuli.items():
        with said_of(name):
            if stimulus.kind == "programme":
                drive_of_all, _ = programmes[name]
                # The last command holds to the end.
                within = int(np.searchsorted(np.asarray(drive_of_all.begins), grids[drive_of_all.fmu].steps))
                new_drives = [
                    replace(
                        drive_of_all,
                        values=drive_of_all.values[:within],
                        begins=np.asarray(drive_of_all.begins)[:within],
                    )
                ]
            elif stimulus.kind == "constant":
                new_drives = [resolve_constant(stimulus, interfaces)]
            else:
                new_drives = resolve_rows(
                    stimulus, lambda columns, s=stimulus, n=name: table(s, n, columns), grids, interfaces, solved
                )
            for drive in new_drives:
                drives.append((name, drive))
    return grid, drives


def check_sources(wires: Iterable[Wire], drives: Iterable[tuple[str, Drive]], loaded: Mapping[str, Loaded]) -> None:
    """Refuse an input with two sources, and an input that an effect reads and nothing feeds.

    Each drive comes with the user's name of its stimulus.
    """
    source_of: dict[tuple[str, str], str] = {}
    sources = [(w.target, w.input, f"'{w.source}.{w.output.name}'") for w in wires]
    for name, drive in drives:
        for variable in drive.variables:
            sources.append((drive.fmu, variable, name))
    for fmu, variable, source in sources:
        before = source_of.setdefault((fmu, variable.name), source)
        if before is not source:
            raise InputError(f"'{fmu}.{variable.name}' has two sources, {before} and {source}; one is possible")
    for fmu, entry in loaded.items():
        for name, effect in entry.read.items():
            variables = entry.interface.find(name, ("input",))
            if not any((fmu, v.name) in source_of or v.name in entry.values for v in variables):
                of_table = f" (from a table: its {GIVEN_BY_TABLE[name]})" if name in GIVEN_BY_TABLE else ""
                raise InputError(
                    f"fmus.{fmu}.effects: {effect} reads '{fmu}.{name}', and nothing feeds it; connect it{of_table}, "
                    f"drive it by a stimulus, or give {name} a value among the parameters of '{fmu}'"
                )
