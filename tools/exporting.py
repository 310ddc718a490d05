"""Export components as FMUs, with reference results and records as input tables for importers."""

import hashlib
import math
import shlex
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from pydantic import Field

from ..fmus import build, component_names, components
from ..fmus.component import Component, can_extend, extend
from ..fmus.native.compile import BuildError, chosen_platforms
from ..fmus.reference import reference_texts
from ..models.attitude_algorithms import ALGORITHMS
from ..models.effects import CATALOGUE, EffectPlace
from . import motion, records
from .errors import InputError, nearest
from .files import whole_file, whole_folder
from .progress import tracked
from .result import Result
from .rounding import downwards, upwards

if TYPE_CHECKING:
    from polars import DataFrame

Flavour = Literal["python", "native"]
UNIFORM = 1e-3
"""Largest distance of a row's time from a uniform one, in steps."""
USUAL = ALGORITHMS[0]
"""Algorithm of the computers' FMUs, where no start value sets another."""


class ExportedFmu(Result):
    """An FMU that was written.

    Attributes
    ----------
    component, file : str
    fmi : int
    flavour : str
    platforms : list of str
        the folders of its binaries
    sha256 : str
    """

    component: str
    file: str
    fmi: int
    flavour: str
    platforms: list[str]
    sha256: str


class Exported(Result):
    """FMUs that were written, and by which effects they were extended."""

    schema_: Literal["trihedron.export/1"] = Field(default="trihedron.export/1", alias="schema")
    effects: list[str]
    fmus: list[ExportedFmu]

    @property
    def files(self) -> list[Path]:
        """The FMUs."""
        return [Path(fmu.file) for fmu in self.fmus]

    def to_polars(self) -> "DataFrame":
        """A row for each FMU."""
        import polars as pl

        return pl.DataFrame([fmu.to_json() | {"platforms": ", ".join(fmu.platforms)} for fmu in self.fmus])


def _described(path: Path, out: Path, flavour: str, fmi: int) -> ExportedFmu:
    """Describe an FMU at a path as it will be in the folder `out`."""
    with zipfile.ZipFile(path) as archive:
        folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return ExportedFmu(
        component=path.stem,
        file=str(out / path.name),
        fmi=fmi,
        flavour=flavour,
        platforms=sorted(folders),
        sha256=digest,
    )


def effect_places(titles: Sequence[str]) -> list[EffectPlace]:
    """The places of effects, each written as "quadratic accelerometer-3" or "encoder-harmonic outer-axis order 2".

    An InputError where there is no such effect at such a place, or no component can have it.
    """
    by_title = {}
    for effect in CATALOGUE.values():
        if effect.component:
            by_title.update((place.title, place) for place in effect.places)
    for title in titles:
        if title not in by_title:
            raise InputError(f"--effect {title}: is not known; {nearest(title, list(by_title))}")
    return [by_title[title] for title in dict.fromkeys(titles)]


def export_components(
    names: Sequence[str],
    out: Path,
    flavour: Flavour = "python",
    fmi: int = 2,
    platform: str | None = None,
    effects: Sequence[str] = (),
) -> Exported:
    """Write components as FMUs into a folder; see `trihedron.export`; native ones with reference results.

    All of them where none is named, or those that the effects extend.
    """
    catalogue, table = component_names(), components()
    for name in names:
        if name not in catalogue:
            raise InputError(f"component {name}: is not known; {nearest(name, catalogue)}")
    if flavour not in get_args(Flavour):
        raise InputError(f"--flavour {flavour}: must be {' or '.join(get_args(Flavour))}")
    if fmi not in (2, 3):
        raise InputError(f"--fmi {fmi}: must be 2 or 3")
    if flavour == "python" and fmi != 2:
        raise InputError("--fmi 3: the Python flavour is FMI 2.0 only; add --flavour native")
    if flavour == "python" and platform is not None:
        raise InputError("--platform: belongs to --flavour native; PythonFMU brings its own binaries")
    places = effect_places(effects)
    extended = {str(place.definition.component) for place in places}
    chosen = list(dict.fromkeys(names)) or [name for name in catalogue if name in extended] or list(catalogue)
    target = "host" if platform is None else platform
    for place in places:
        if not any(can_extend(table[name], place) for name in chosen):
            raise InputError(f"--effect {place.title}: extends {place.definition.component}, not exported here")
    try:
        if flavour == "native":
            chosen_platforms(target)
        with whole_folder(out) as beside:
            for name in tracked(chosen, "FMUs", show=True):
                extensions = [place for place in places if can_extend(table[name], place)]
                build(name, beside, extensions, flavour=flavour, fmi=fmi, platform=target)
                if flavour == "native":
                    write_reference(extend(table[name], extensions), beside, fmi)
            described = [_described(beside / f"{name}.fmu", out, flavour, fmi) for name in chosen]
    except BuildError as error:
        raise InputError(f"--flavour native: {error}") from error
    return Exported(effects=list(effects), fmus=described)


def write_reference(component: Component, folder: Path, fmi: int) -> list[Path]:
    """Write the reference results of a component next to its FMU; return the files."""
    paths = []
    for ending, text in sorted(reference_texts(component, fmi).items()):
        path = folder / f"{component.name}{ending}"
        path.write_text(text, encoding="utf-8", newline="\n")
        paths.append(path)
    return paths


class FmpyInput(Result):
    """Inputs of a component over a run that begins at time 0, and the command of FMPy that runs it.

    Attributes
    ----------
    component : str
        which component takes them
    input_file : str
        the table: `time` [s] and the inputs. FMPy applies a row at the start of a step, so each row has the time at
        which its step begins
    step, stop : float
        length of a step and end of the run [s]
    start_values : dict
        parameters of the component that go with the record
    bridged_bound : float
        bound of the attitude error from bridged gaps [rad]
    trusted_until : float or None
        time of the run up to which the attitude is to be trusted: a gyro is at its limit behind it [s]; None: all is
    warnings : tuple of str
        channels of the record that are at a limit; last rows that fill no step of the FMU's algorithm
    command : str
    """

    schema_: Literal["trihedron.fmpy-input/1"] = Field(default="trihedron.fmpy-input/1", alias="schema")
    component: str
    input_file: str
    step: float = Field(alias="step_s")
    stop: float = Field(alias="stop_s")
    start_values: dict[str, float]
    bridged_bound: float = Field(default=0.0, alias="bridged_bound_rad")
    trusted_until: float | None = Field(default=None, alias="trusted_until_s")
    warnings: tuple[str, ...] = ()
    command: str

    def __str__(self) -> str:
        return self.command

    @property
    def complaint(self) -> str:
        """One line, where readings at a limit or bridged gaps are in the table; else nothing."""
        complaints = []
        if self.trusted_until is not None:
            complaints.append(f"attitudes after {downwards(self.trusted_until, 9)} s of the run are not to be trusted")
        if self.bridged_bound:
            bound = upwards(math.degrees(self.bridged_bound), 3)
            complaints.append(f"bridged gaps turn the attitude by at most {bound} deg")
        return "; ".join([*complaints, *self.warnings])


def write_fmpy_input(
    source: records.Source,
    out: Path,
    *,
    rates: str = "instantaneous",
    bridge_gaps: int = 0,
    stamps: str | None = None,
    trust: bool = False,
) -> FmpyInput:
    """Write a record as the CSV file that FMPy reads: inputs of a computer or of AccelerometerCompensation.

    Parameters
    ----------
    source : path, table in memory or record
        a strapdown record: its increments serve AttitudeComputer, with increments of velocity VelocityComputer; or a
        raw record of a table: its readings serve AccelerometerCompensation
    out : Path
        the CSV file
    rates : str
        "instantaneous" or "averaged": meaning of a rate in the record
    bridge_gaps : int
        longest gap of a strapdown record to bridge [rows]
    stamps : str or None
        time stamps, as in `read_record`
    trust : bool
        use a record that looks wrong

    Returns
    -------
    FmpyInput
        the file, and FMPy's command

    Raises
    ------
    InputError
        another record, or one that is not uniformly sampled
    """
    import polars as pl

    record = motion.trusted(records.read_record(source, stamps=stamps), trust=trust)
    if isinstance(record, records.BenchRecord):
        record = record.gyros
    if isinstance(record, records.StrapdownRecord):
        inputs = _motion_inputs(record, rates, bridge_gaps)
    elif isinstance(record, records.RawRecord):
        if bridge_gaps:
            raise InputError(
                f"--bridge-gaps {bridge_gaps}: is of a strapdown record; a record of a table carries no attitude"
            )
        inputs = _reading_inputs(record)
    else:
        raise InputError(
            f"{record.path}: is a position record, which has no steps; a strapdown or a raw record is needed"
        )
    rows = len(next(iter(inputs.variables.values())))
    table = {"time": [inputs.period * row for row in range(rows)]}
    for name, values in inputs.variables.items():
        for axis in range(3):
            table[f"{name}[{axis + 1}]"] = values[:, axis]
    with whole_file(out) as beside:
        pl.DataFrame(table).write_csv(beside)
    stop = inputs.period * rows
    words = ["fmpy", "simulate", f"{inputs.component}.fmu", "--input-file", str(out)]
    words += ["--stop-time", repr(stop), "--output-interval", repr(inputs.period)]
    if inputs.start_values:
        words.append("--start-values")
        for name, value in inputs.start_values.items():
            words += [name, repr(value)]
    return FmpyInput(
        component=inputs.component,
        input_file=str(out),
        step_s=inputs.period,
        stop_s=stop,
        start_values=inputs.start_values,
        bridged_bound_rad=inputs.bridged_bound,
        trusted_until_s=inputs.trusted_until,
        warnings=inputs.warnings,
        command=shlex.join(words),
    )


@dataclass(frozen=True)
class _Inputs:
    """Inputs of a component from a record: variables (N, 3) by name, each step of one period [s]."""

    component: str
    period: float
    variables: dict[str, Any]
    warnings: tuple[str, ...]
    start_values: dict[str, float] = field(default_factory=dict)
    trusted_until: float | None = None
    bridged_bound: float = 0.0


def _motion_inputs(record: "records.StrapdownRecord", rates: str, bridge_gaps: int) -> _Inputs:
    """Inputs of the attitude computer, or of the velocity computer where the record has increments of velocity."""
    samples = motion.gyro_input(record, rates, bridge_gaps=bridge_gaps)
    increments = samples.increments
    period, begin = float(increments.period), float(increments.time_s[0])
    start_values = {f"initial_attitude[{i}]": float(value) for i, value in enumerate(samples.start, start=1)}
    start_values["sample_period"] = period
    # The increment that ends at a row's time is of the step that begins one row before.
    component, variables = "AttitudeComputer", {"increment": increments.angle}
    if increments.velocity is not None:
        component, variables["velocity_increment"] = "VelocityComputer", increments.velocity
    until = samples.trusted_until(increments.time_s)
    rows = len(increments.angle) % USUAL.samples
    left_out = motion.left_out_line(rows, f"{USUAL.name}, the FMU's algorithm", increments.time_s[-1 - rows] - begin)
    return _Inputs(
        component,
        period,
        variables,
        (*samples.warnings, *left_out),
        start_values,
        trusted_until=None if until is None else until - begin,
        bridged_bound=samples.bridged_bound,
    )


def _reading_inputs(record: "records.RawRecord") -> _Inputs:
    """Inputs of AccelerometerCompensation."""
    import numpy as np

    count = len(record.time_s)
    warnings = tuple(records.channel_limits(record).lines)
    if count < 2:
        raise InputError(f"{record.path}: has one row; at least two are needed")
    period = float(record.time_s[-1] - record.time_s[0]) / (count - 1)
    off = np.abs(record.time_s - record.time_s[0] - period * np.arange(count)) / period
    if off.max() > UNIFORM:
        where = f"{record.path}, row {int(record.row[int(off.argmax())])}"
        raise InputError(f"{where}: is {off.max():.3g} rows off a uniform sampling of {period:.9g} s")
    return _Inputs("AccelerometerCompensation", period, {"reading": record.specific_force}, warnings)
