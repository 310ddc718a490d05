"""A record as the table of inputs that FMPy's `simulate_fmu` takes."""

import shlex
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl
from pydantic import Field

from .errors import InputError
from .files import whole_file
from .motion.attitude import increments_from, starting_attitude
from .records import RawRecord, StrapdownRecord, read_record
from .result import ABSENT, Result

UNIFORM = 1e-3
"""How far a row's time may be off a uniform one, in steps."""


class FmpyInput(Result):
    """Inputs of a component over a run that begins at time 0, and the command of FMPy that runs it.

    Attributes
    ----------
    component : str
        which component takes them
    input_file : str
        where the table was written
    step, stop : float
        length of a step and end of the run [s]
    start_values : dict
        parameters of the component that go with the record
    table : DataFrame
        `time` [s] and the inputs: FMPy applies a row at the start of a step, so each row has the time at which its
        step begins
    """

    schema_: Literal["trihedron.fmpy-input/1"] = Field(default="trihedron.fmpy-input/1", alias="schema")
    component: str
    input_file: str = ""
    step: float = Field(alias="step_s")
    stop: float = Field(alias="stop_s")
    start_values: dict[str, float]
    command: str = ""
    table: pl.DataFrame = Field(default=ABSENT, exclude=True, repr=False)

    def __str__(self) -> str:
        return self.command


def fmpy_input(path: Path, *, rates: str = "instantaneous") -> FmpyInput:
    """Inputs from a record: increments for the AttitudeComputer, or readings for the AccelerometerCompensation.

    Parameters
    ----------
    path : Path
        a strapdown record or a raw record of a table
    rates : str
        "instantaneous" or "averaged": what a rate in the record means

    Raises
    ------
    InputError
        another record, or one that is not uniformly sampled
    """
    record = read_record(path)
    if isinstance(record, StrapdownRecord):
        first, start = starting_attitude(record)
        increments = increments_from(record, first, rates)
        names = [f"increment[{i}]" for i in (1, 2, 3)]
        start_values = {f"initial_attitude[{i}]": float(value) for i, value in enumerate(start, start=1)}
        start_values["sample_period"] = float(increments.period)
        # The increment that ends at a row's time is of the step that begins one row before.
        return _input("AttitudeComputer", names, increments.angle, float(increments.period), start_values)
    if isinstance(record, RawRecord):
        names = [f"reading[{i}]" for i in (1, 2, 3)]
        return _input("AccelerometerCompensation", names, record.specific_force, _period(record), {})
    raise InputError(f"{path}: is a position record, which has no steps; a strapdown or a raw record is needed")


def _period(record: RawRecord) -> float:
    count = len(record.time_s)
    if count < 2:
        raise InputError(f"{record.path}: has one row; at least two are needed")
    period = float(record.time_s[-1] - record.time_s[0]) / (count - 1)
    off = np.abs(record.time_s - record.time_s[0] - period * np.arange(count)) / period
    if off.max() > UNIFORM:
        row = int(record.row[int(off.argmax())])
        raise InputError(f"{record.path}, row {row}: is {off.max():.3g} rows off a uniform sampling of {period:.9g} s")
    return period


def _input(
    component: str, names: list[str], values: np.ndarray, period: float, start_values: dict[str, float]
) -> FmpyInput:
    steps = len(values)
    table = pl.DataFrame({"time": period * np.arange(steps), **dict(zip(names, values.T, strict=True))})
    return FmpyInput(component=component, step_s=period, stop_s=period * steps, start_values=start_values, table=table)


def write_fmpy_input(path: Path, out: Path, *, rates: str = "instantaneous") -> FmpyInput:
    """Write the table of inputs of a record as the CSV file that FMPy reads; see `fmpy_input`."""
    made = fmpy_input(path, rates=rates)
    with whole_file(out) as beside:
        made.table.write_csv(beside)
    words = ["fmpy", "simulate", f"{made.component}.fmu", "--input-file", str(out)]
    words += ["--stop-time", repr(made.stop), "--output-interval", repr(made.step)]
    if made.start_values:
        words.append("--start-values")
        words += [word for name, value in made.start_values.items() for word in (name, repr(value))]
    return made.model_copy(update={"input_file": str(out), "command": shlex.join(words)})
