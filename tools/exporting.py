"""Components written as FMUs, and what importers have of them: reference results, records as tables of inputs."""

import hashlib
import math
import shlex
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from pydantic import Field

from ..fmus import build, component_names, components
from ..fmus.component import Component, can_extend, extend
from ..fmus.native.compile import BuildError, chosen_platforms
from ..fmus.reference import reference_texts
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
"""How far a row's time may be off a uniform one, in steps."""


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
    """What is said of an FMU at a path, which will stand in the folder `out`."""
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
    known = {place.title: place for effect in CATALOGUE.values() if effect.component for place in effect.places}
    for title in titles:
        if title not in known:
            raise InputError(f"--effect {title}: is not known; {nearest(title, list(known))}")
    return [known[title] for title in dict.fromkeys(titles)]


def export_components(
    names: Sequence[str],
    out: Path,
    flavour: Flavour = "python",
    fmi: int = 2,
    platform: str | None = None,
    effects: Sequence[str] = (),
) -> Exported:
    """Write components as FMUs into a folder, as `trihedron.export` says; native ones with reference results.

    All of them where none is named, or those that the effects extend.
    """
    known, table = component_names(), components()
    for name in names:
        if name not in known:
            raise InputError(f"component {name}: is not known; {nearest(name, known)}")
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
    chosen = list(dict.fromkeys(names)) or [name for name in known if name in extended] or list(known)
    for place in places:
        if not any(can_extend(table[name], place) for name in chosen):
            raise InputError(f"--effect {place.title}: extends {place.definition.component}, not exported here")
    try:
        if flavour == "native":
            chosen_platforms("host" if platform is None else platform)
        with whole_folder(out) as beside:
            for name in tracked(chosen, "FMUs", show=True):
                own = [place for place in places if can_extend(table[name], place)]
                build(name, beside, own, flavour=flavour, fmi=fmi, platform="host" if platform is None else platform)
                if flavour == "native":
                    write_reference(extend(table[name], own), beside, fmi)
            described = [_described(beside / f"{name}.fmu", out, flavour, fmi) for name in chosen]
    except BuildError as error:
        raise InputError(f"--flavour native: {error}") from error
    return Exported(effects=list(effects), fmus=described)


def write_reference(component: Component, folder: Path, fmi: int) -> list[Path]:
    """Write the reference results of a component beside its FMU; the files are returned."""
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
        of the attitude error that bridged gaps may cause [rad]
    trusted_until : float or None
        time of the run up to which the attitude is to be trusted: a gyro is at its limit behind it [s]; None: all is
    warnings : tuple of str
        channels of the record that are at a limit
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
        said = []
        if self.trusted_until is not None:
            said.append(f"attitudes after {downwards(self.trusted_until, 9)} s of the run are not to be trusted")
        if self.bridged_bound:
            bound = upwards(math.degrees(self.bridged_bound), 3)
            said.append(f"bridged gaps turn the attitude by at most {bound} deg")
        return "; ".join([*said, *self.warnings])


def write_fmpy_input(path: Path, out: Path, *, rates: str = "instantaneous", bridge_gaps: int = 0) -> FmpyInput:
    """Write a record as the CSV file that FMPy reads: inputs of a computer or of AccelerometerCompensation.

    Parameters
    ----------
    path : Path
        a strapdown record, of which increments are taken for AttitudeComputer, where it has increments of velocity for
        VelocityComputer; or a raw record of a table, of which readings
    out : Path
    rates : str
        "instantaneous" or "averaged": what a rate in the record means
    bridge_gaps : int
        bridge gaps of a strapdown record of up to so many lost rows

    Raises
    ------
    InputError
        another record, or one that is not uniformly sampled
    """
    import numpy as np
    import polars as pl

    record = records.read_record(path)
    if isinstance(record, records.BenchRecord):
        record = record.gyros
    care: dict[str, Any] = {}
    inputs: dict[str, np.ndarray] = {}
    if isinstance(record, records.StrapdownRecord):
        component = "AttitudeComputer"
        taken = motion.taken_from(record, rates, bridge_gaps=bridge_gaps)
        increments = taken.increments
        start_values = {f"initial_attitude[{i}]": float(value) for i, value in enumerate(taken.start, start=1)}
        start_values["sample_period"] = period = float(increments.period)
        # The increment that ends at a row's time is of the step that begins one row before.
        inputs["increment"] = increments.angle
        if increments.velocity is not None:
            component, inputs["velocity_increment"] = "VelocityComputer", increments.velocity
        until, begin = taken.trusted_until(increments.time_s), float(increments.time_s[0])
        care = {"trusted_until_s": None if until is None else until - begin, "warnings": taken.warnings}
        care["bridged_bound_rad"] = taken.bridged_bound
    elif isinstance(record, records.RawRecord):
        if bridge_gaps:
            raise InputError(
                f"--bridge-gaps {bridge_gaps}: is of a strapdown record; a record of a table carries no attitude"
            )
        component, start_values = "AccelerometerCompensation", {}
        care["warnings"] = tuple(records.limits_of(record).lines)
        inputs["reading"], count = record.specific_force, len(record.time_s)
        if count < 2:
            raise InputError(f"{record.path}: has one row; at least two are needed")
        period = float(record.time_s[-1] - record.time_s[0]) / (count - 1)
        off = np.abs(record.time_s - record.time_s[0] - period * np.arange(count)) / period
        if off.max() > UNIFORM:
            where = f"{record.path}, row {int(record.row[int(off.argmax())])}"
            raise InputError(f"{where}: is {off.max():.3g} rows off a uniform sampling of {period:.9g} s")
    else:
        raise InputError(f"{path}: is a position record, which has no steps; a strapdown or a raw record is needed")
    rows = len(next(iter(inputs.values())))
    table = {"time": period * np.arange(rows)}
    table |= {f"{name}[{i + 1}]": values[:, i] for name, values in inputs.items() for i in range(3)}
    with whole_file(out) as beside:
        pl.DataFrame(table).write_csv(beside)
    stop = period * rows
    words = ["fmpy", "simulate", f"{component}.fmu", "--input-file", str(out)]
    words += ["--stop-time", repr(stop), "--output-interval", repr(period)]
    if start_values:
        words.append("--start-values")
        words += [word for key, value in start_values.items() for word in (key, repr(value))]
    return FmpyInput(
        component=component,
        input_file=str(out),
        step_s=period,
        stop_s=stop,
        start_values=start_values,
        **care,
        command=shlex.join(words),
    )
