"""The commands: each is a thin layer over one function of the library, with its options and descriptions."""

import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import asdict, replace
from io import StringIO
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from .. import calibration as calibrations
from .. import (
    corrections,
    diagnosis,
    document,
    foreign,
    library,
    measured,
    motion,
    noise,
    records,
    reports,
    trials,
)
from ..errors import InputError, one_line
from ..files import at_once, ordinary_file, ordinary_folder, write_text
from ..options import BridgeGaps, Channels, ExportTarget, Rates, Stamps, Trust
from .answer import (
    STANDARD_OUTPUT,
    Answer,
    File,
    Folder,
    JsonFile,
    Number,
    PlotFile,
    ReportFile,
    SheetFile,
    answer,
    distinct_files,
    terminal_width,
    with_options_of,
)

READING = ("channels", "stamps", "without")
"""How the channels, time stamps and rows of a record are read."""
PLACE = ("latitude_deg", "azimuth_deg", "gyro_noise", "encoder_bound")
"""Options of a bench with its encoders and gyros."""


@with_options_of(library.simulate)
def simulate_command(scenario: Path, /, *, json: JsonFile = None, **options: Any) -> Answer:
    """Example: trihedron simulate scenarios/static-calibration.toml --out run

    Example: trihedron simulate plant.fmu --stop 5 --set mass=2.5 --input u.csv --record h

    Example: trihedron simulate plant.fmu --stop 60 --realtime --live 0
    """
    out, place = options.pop("out", None) or Path(f"{scenario.stem}-run"), options.get("live")
    if place == str(json) == str(STANDARD_OUTPUT):
        raise InputError("--live -: --json - writes to standard output, too; give one of them a name or a port")
    written = {"--out": out, "--json": json, "--plot": options.get("plot")}
    distinct_files({"the scenario": scenario, **written})
    distinct_files({"--input": options.get("inputs"), **written})
    run = library.simulate(scenario, out=out, progress=True, **options)
    ignored = run.ignored_parameters
    if ignored:
        listed = one_line(", ".join([*ignored[:3], "..."][: len(ignored)]))
        print(f"{scenario}: {len(ignored)} parameters name nothing in it: {listed}", file=sys.stderr)
    if run.ended:
        print(run.ended, file=sys.stderr)
    for note in run.notes:
        print(note, file=sys.stderr)
    if run.no_positions:
        print(f"no position record: {run.no_positions}", file=sys.stderr)
    shown = answer("\n".join(map(str, run.files)), json, run.to_json())
    if place == str(STANDARD_OUTPUT):
        # Standard output has the rows.
        print(shown.text, file=sys.stderr)
        return replace(shown, text="")
    return shown


@with_options_of(library.export)
def export_command(*components: str, fmi: Literal["2", "3"] = "2", json: JsonFile = None, **options: Any) -> Answer:
    """Example: trihedron export TurntableMotion --flavour native --fmi 3 --out fmus"""
    exported = library.export(*components, fmi=2 if fmi == "2" else 3, **options)
    return answer(str(exported), json, exported.to_json())


@with_options_of(library.export_ssp)
def export_ssp_command(
    scenario: Path, /, *, out: Annotated[Path, Parameter(name="--out")], json: JsonFile = None, **options: Any
) -> Answer:
    """Example: trihedron export-ssp bench.toml --out bench.ssp"""
    distinct_files({"the scenario": scenario, "--out": out, "--json": json})
    path = library.export_ssp(scenario, out, **options)
    return answer(str(path), json, {"schema": "trihedron.export-ssp/1", "file": str(path), "scenario": str(scenario)})


@with_options_of(measured.calibrate, measured.calibrate_together, measured.bench_at)
def calibrate_command(
    record: Path,
    /,
    *others: Path,
    json: JsonFile = None,
    ssv: File = None,
    export: Annotated[Folder, Parameter(name="--export")] = None,
    strapdown: File = None,
    report: ReportFile = None,
    sheet: SheetFile = None,
    about: Annotated[Path | None, Parameter(name="--about")] = None,
    **options: Any,
) -> Answer:
    """Example: trihedron calibrate positions.csv --noise-bound 1e-5 --json calibration.json

    Example: trihedron calibrate positions.csv --with diagnosis.json --json new.json

    Example: trihedron calibrate bench.csv --latitude-deg 55.75 --azimuth-deg 20

    Example: trihedron calibrate phone.csv --json phone.json

    Example: trihedron calibrate monday.csv tuesday.csv --noise-bound 1e-5

    Parameters
    ----------
    others
        Further records of the same instrument, calibrated together.
    ssv
        Write the block's parameters as an SSP 1.0 parameter set (.ssv). Several records: with the biases of the last.
    export
        Folder for FMUs that start with the calibrated values: the block and its compensation, each with its .ssv.
    strapdown
        Write gyros, accelerometers and true attitude of a bench record to this file (CSV).
    about
        Facts for the sheet (TOML): serial_number, operator, bench, date, temperature. They precede the record's own.
    """
    written = {"--json": json, "--ssv": ssv, "--strapdown": strapdown, "--report": report, "--sheet": sheet}
    explained_by = options.get("explained_by")
    read = {"--about": about, "--with": explained_by, "--noise": options.get("noise_result")}
    distinct_files({**_files_of(record, others), **written, **read})
    if about is not None and sheet is None:
        raise InputError(f"--about {about}: is for a sheet; give --sheet, too")
    shared = _taken(options, ("shared", "own"))
    place = _taken(options, PLACE)
    rates = options.pop("rates", "instantaneous")
    if others:
        averaged = None if rates == "instantaneous" else rates
        of_one = {
            "with": options.pop("explained_by", None),
            **place,
            "rates": averaged,
            "strapdown": strapdown,
            "sheet": sheet,
        }
        of_one |= {"target": options.pop("targets", None), "prior": options.pop("priors", None)}
        of_one |= {
            "noise": options.pop("noise_result", None),
            "without": options.pop("without", None),
            **_taken(options, ("rests", "faces", "turns")),
        }
        _refuse_of_one(of_one)
        if options.pop("convention", "A1") != "A1":
            raise InputError("--convention A2: is of one record; give one")
        joint = measured.calibrate_together(record, *others, **shared, **options)
        if report is not None:
            reports.write_report(report, joint)
        return answer(joint, json, files=_components_of(joint, ssv, export))
    _refuse_of_several(shared)
    circumstances = {} if about is None else reports.read_about(about)
    run = records.read_record(record, *records.TO_CALIBRATE, **_taken(options, READING))
    bench = None
    if isinstance(run, records.PositionRecord):
        bench = measured.bench_at(run, **place, rates=rates)
    else:
        _refuse_of_table({**place, "strapdown": strapdown, "sheet": sheet}, run)
        options["rates"] = rates
    if explained_by is not None and not any(value is not None for value in place.values()):
        bench = None
    result = measured.calibrate(run, bench=bench, **options)
    if report is not None:
        reports.write_report(report, result, run)
    if sheet is not None:
        reports.write_sheet(sheet, result, run, circumstances)
    if strapdown is not None:
        records.write_record(calibrations.strapdown_by_table(result, run, bench), strapdown)
    return answer(result, json, files=_components_of(result, ssv, export))


def _components_of(result: "calibrations.Calibration", ssv: Path | None, export: Path | None) -> list[Path | str]:
    """Write parameter set and FMUs of a calibration where they are asked for.

    Returns the FMUs and their sets, and in words what the compensations do not take out.
    """
    if ssv is not None:
        calibrations.write_parameter_set(result, ssv)
    if export is None:
        return []
    files, stays = calibrations.export_calibrated(result, export)
    return [*files, *stays]


def _refuse_of_table(options: Mapping[str, object], run: "records.Record") -> None:
    """Refuse the first option that was given and is of a record of a table."""
    for name, value in options.items():
        if value is not None:
            raise InputError(f"--{name.replace('_', '-')}: is of a record of a table; {run.path} is no such record")


def _files_of(record: Path, others: Sequence[Path]) -> dict[str, Path | None]:
    """The records of a command by their names in messages."""
    if not others:
        return {"the record": record}
    return {f"record {number}": path for number, path in enumerate((record, *others), start=1)}


def _taken(options: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Take the options that have these names."""
    return {name: options.pop(name) for name in names if name in options}


def _refuse_of_one(options: Mapping[str, object]) -> None:
    """Refuse the first option that was given and is of one record alone."""
    for name, value in options.items():
        if value not in (None, (), ""):
            raise InputError(f"--{name.replace('_', '-')}: is of one record; give one")


def _refuse_of_several(options: Mapping[str, Sequence[str]]) -> None:
    """Refuse the first option that was given and is of several records."""
    for name, values in options.items():
        if values:
            raise InputError(f"--{name} {values[0]}: is of several records of one instrument; give two or more")


@with_options_of(corrections.apply)
def apply_command(
    result: Path,
    record: Path,
    /,
    *,
    out: File = None,
    noise_bound: Number = 0.0,
    latitude_deg: Number | None = None,
    json: JsonFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron apply calibration.json positions.csv --out corrected.csv

    Example: trihedron apply diagnosis.json tuesday.csv --out corrected.csv

    Parameters
    ----------
    out
        Write the corrected record (CSV).
    latitude_deg
        Latitude for the error of the azimuth [deg]. Default: the record's comment line, else 55.75.
    """
    distinct_files({"the calibration": result, "the record": record, "--out": out, "--json": json})
    corrected = corrections.apply(result, record, noise_bound=noise_bound, **options)
    text = document.text(reports.applied_page(corrected, latitude_deg), terminal_width())
    if out is not None:
        if corrected.record is None:
            raise InputError(f"--out {out}: the diagnosis names nothing that a correction could remove")
        records.write_record(corrected.record, out)
    return replace(answer(text, json, corrected.to_json()), result=corrected)


@with_options_of(corrections.export_calibration)
def export_calibration_command(
    calibration: Path,
    /,
    *,
    to: ExportTarget,
    out: Annotated[Path, Parameter(name="--out", validator=ordinary_file)],
    json: JsonFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron export-calibration calibration.json --to imucal --out imu.json

    Example: trihedron export-calibration calibration.json --to matlab --out imu.mat
    """
    distinct_files({"the calibration": calibration, "--noise": options.get("noise"), "--out": out, "--json": json})
    return answer(corrections.export_calibration(calibration, to, out, **options), json)


@with_options_of(measured.diagnose, measured.diagnose_together, measured.bench_at)
def diagnose_command(
    record: Path,
    /,
    *others: Path,
    json: JsonFile = None,
    report: ReportFile = None,
    export: Annotated[Folder, Parameter(name="--export")] = None,
    **options: Any,
) -> Answer:
    """Example: trihedron diagnose positions.csv --noise-bound 1e-5 --json diagnosis.json

    Example: trihedron diagnose positions.csv --hypothesis "f2 += c*sin(3*alpha)"

    Example: trihedron diagnose bench.csv --latitude-deg 55.75 --azimuth-deg 20

    Example: trihedron diagnose monday.csv tuesday.csv --noise-bound 1e-5

    Parameters
    ----------
    others
        Further records of the same instrument, to separate its effects from those of one run.
    export
        Folder for the extended simulation: FMUs with the cause, parameter sets (.ssv), and a scenario that gives the
        record again.
    """
    against = options.get("against")
    distinct_files({**_files_of(record, others), "--json": json, "--report": report, "--against": against})
    shared = _taken(options, ("shared", "own"))
    place = _taken(options, PLACE)
    if others:
        _refuse_of_one(place)
        if export is not None:
            raise InputError(f"--export {export}: is of one record; give one")
        of_one = {"hypothesis": options.pop("hypotheses", None), "noise": options.pop("noise_result", None)}
        of_one |= _taken(options, ("against", "without"))
        _refuse_of_one(of_one)
        several = measured.diagnose_together(record, *others, **shared, **options, progress=True)
        if report is not None:
            reports.write_report(report, several)
        return answer(several, json)
    _refuse_of_several(shared)
    kinds = records.PositionRecord, records.StrapdownRecord
    run = records.read_record(record, *kinds, **_taken(options, READING))
    bench = measured.bench_at(run, **place)
    result = measured.diagnose(run, bench=bench, **options, progress=True)
    if report is not None:
        reports.write_report(report, result, run)
    lines: Sequence[Path | str] = ()
    if export is not None:
        lines = diagnosis.export_extended(result, export)
        lines = lines or [f"--export {export}: nothing to write, {diagnosis.nothing_exported(result)}"]
    return answer(result, json, files=lines)


@with_options_of(measured.inspect)
def inspect_command(
    record: Path, /, *, json: JsonFile = None, allan: File = None, plot: PlotFile = None, **options: Any
) -> Answer:
    """Example: trihedron inspect motion.csv --allan allan.svg

    Parameters
    ----------
    allan
        Write the Allan deviation at rest as a picture (SVG).
    """
    distinct_files({"the record": record, "--json": json, "--allan": allan, "--plot": plot})
    inspection = measured.inspect(record, **options)
    rows = inspection.record
    if plot is not None:
        reports.write_plot(plot, f"Readings of {record.name}", f"{len(rows)} rows, as measured.", rows.to_polars())
    if allan is not None:
        write_text(allan, reports.allan_picture(inspection).svg())
    complaint = "; ".join(inspection.trust.faults)
    if complaint:
        complaint = f"{record.name}: {complaint}. If the record is right all the same, add --trust"
    return answer(inspection, json, complaint=complaint)


@with_options_of(measured.noise)
def noise_command(
    record: Path,
    /,
    *others: Path,
    json: JsonFile = None,
    report: ReportFile = None,
    kalibr: File = None,
    export: Annotated[File, Parameter(name="--export")] = None,
    **options: Any,
) -> Answer:
    """Example: trihedron noise static.csv --dwell 60 --json noise.json

    Example: trihedron noise static.csv --against bench.toml --export new.toml

    Example: trihedron noise static.csv --kalibr imu.yaml --report noise.html

    Parameters
    ----------
    others
        Further records of the same instrument, of the same rate.
    kalibr
        Write the noise densities as kalibr's imu.yaml to this file.
    export
        With --against: write the scenario with the record's noise to this file (TOML).
    """
    written = {"--json": json, "--report": report, "--kalibr": kalibr, "--export": export}
    against = options.get("against")
    distinct_files({**_files_of(record, others), **written, "--against": against})
    if export is not None and against is None:
        raise InputError(
            f"--export {export}: is the extended scenario; give --against SCENARIO.toml, too, or --kalibr IMU.yaml"
        )
    result = measured.noise(record, *others, **options, progress=True)
    if kalibr is not None:
        write_text(kalibr, noise.kalibr_yaml(result))
    if report is not None:
        reports.write_report(report, result)
    files = []
    if export is not None and against is not None:
        changed = {one.channel: one.changed for one in result.against if one.changed}
        files = noise.extended_scenario(against, changed, export)
    return answer(result, json, files=files)


@with_options_of(measured.attitude_of_record)
def attitude_command(
    record: Path,
    /,
    *,
    compare: bool = False,
    out: Folder = None,
    json: JsonFile = None,
    plot: PlotFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron attitude motion.csv --algorithm adaptive-degree --out attitude

    Parameters
    ----------
    compare
        Run every algorithm and compare them.
    """
    distinct_files({"the record": record, "--out": out, "--json": json, "--plot": plot})
    if compare and plot is not None:
        raise InputError("--plot: is of one algorithm; it does not go with --compare")
    source = records.read_record(record, records.StrapdownRecord, **_taken(options, READING))
    if compare:
        options.pop("algorithm", None)
        source = motion.trusted(source, trust=options.pop("trust", False))
        compared = motion.compare_algorithms(source, **options, progress=True)
        if out is not None:
            write_text(out / "comparison.csv", compared.to_polars().write_csv())
        return answer(compared, json, complaint=reports.distrust(compared, source.path.name))
    run = measured.attitude_of_record(source, **options, out=out, progress=True)
    if out is not None:
        write_text(out / "attitude.csv", run.to_polars().write_csv())
    if plot is not None:
        page = reports.attitude_page(run)
        reports.write_plot(plot, page.title, f"{page.verdict}.", run.to_polars())
    return answer(run, json, complaint=reports.distrust(run, source.path.name))


@with_options_of()
def fmpy_input_command(
    record: Path,
    /,
    *,
    rates: Rates = "instantaneous",
    bridge_gaps: BridgeGaps = 0,
    stamps: Stamps = None,
    channels: Channels = (),
    trust: Trust = False,
    out: File = Path("input.csv"),
    json: JsonFile = None,
) -> Answer:
    """Write a record as a table of inputs for FMPy's simulate_fmu, and print FMPy's command.

    Example: trihedron fmpy-input motion.csv --out input.csv

    Parameters
    ----------
    record
        Strapdown record or raw record, CSV or Parquet.
    out
        The table of inputs (CSV).
    """
    assert out is not None
    distinct_files({"the record": record, "--out": out, "--json": json})
    from ..exporting import write_fmpy_input

    source = records.read_record(record, channels=channels, stamps=stamps)
    inputs = write_fmpy_input(source, out, rates=rates, bridge_gaps=bridge_gaps, trust=trust)
    complaint = f"{record.name}: {inputs.complaint}" if inputs.complaint else ""
    return answer(inputs, json, complaint=complaint, status=0 if inputs.trusted_until is None else 2)


@with_options_of(measured.check)
def check_command(file: Path, /, *, json: JsonFile = None, **options: Any) -> Answer:
    """The exit status is 2 if there are problems.

    Example: trihedron check bench.toml
    """
    distinct_files({"the file": file, "--json": json})
    findings = measured.check(file, **options)
    return answer(findings, json, complaint="" if findings.good else findings.verdict)


@with_options_of(measured.import_record)
def import_command(
    file: Path,
    second: Path | None = None,
    /,
    *,
    out: Annotated[Path | None, Parameter(name="--out", validator=ordinary_file)] = None,
    mapping: Annotated[Path | None, Parameter(name="--mapping")] = None,
    answers: Annotated[tuple[str, ...], Parameter(name="--set", allow_leading_hyphen=True)] = (),
    preset: Annotated[str, Parameter(name="--as")] = "",
    part: Annotated[str, Parameter(name="--from")] = "",
    listing: Annotated[
        bool, Parameter(name="--list", negative="", help="List the tables of the file instead: names, sizes, guesses.")
    ] = False,
    json: JsonFile = None,
) -> Answer:
    """Example: trihedron import messung.csv --out record.csv

    Example: trihedron import messung.csv --out record.csv --set units.force=mg
    """
    distinct_files({"the file": file, "the second file": second, "--out": out, "--json": json})
    distinct_files({"--mapping": mapping, "--out": out, "the file": file})
    if listing:
        tables = foreign.listed(file)
        content = {"schema": "trihedron.tables/1", "tables": [asdict(table) for table in tables]}
        return answer("\n".join(map(str, tables)), json, content)
    if out is None:
        raise InputError(f"import {file}: give --out RECORD.csv, the record to write, or --list")
    settings = {}
    for words in answers:
        key, equals, text = words.partition("=")
        if not equals:
            raise InputError(f"--set {words}: write KEY=VALUE, as units.force=g")
        settings[key.strip()] = text
    options = {"out": out, "mapping": mapping, "answers": settings, "preset": preset, "part": part}
    return answer(measured.import_record(file, second, **options), json)


@with_options_of(library.new)
def new_command(kind: str, file: File = None, /, *, json: JsonFile = None, **options: Any) -> Answer:
    """Example: trihedron new scenario bench.toml

    Example: trihedron new record measured.csv --positions 24
    """
    distinct_files({"the file": file, "--json": json})
    files = [str(path) for path in library.new(kind, file, **options)]
    return answer("\n".join(files), json, {"schema": "trihedron.new/1", "kind": kind, "files": files})


@with_options_of(library.export_notebook)
def export_notebook_command(
    record: Path,
    /,
    *,
    out: Annotated[Path | None, Parameter(name="--out", validator=ordinary_file)] = None,
    json: JsonFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron export-notebook monday.csv --out monday.ipynb"""
    distinct_files({"the record": record, "--out": out, "--json": json})
    file = str(library.export_notebook(record, out=out, **options))
    return answer(file, json, {"schema": "trihedron.notebook/1", "record": str(record), "file": file})


@with_options_of(library.doctor)
def doctor_command(*, json: JsonFile = None) -> Answer:
    """Example: trihedron doctor"""
    state = library.doctor()
    return answer(state, json, complaint="" if state.works else str(state).split("\n")[0], status=1)


def demo_command(
    *,
    out: Annotated[Path, Parameter(name="--out", validator=ordinary_folder)] = Path("demo-results"),
    seed: int = 2026,
    show: Annotated[bool, Parameter(negative="--no-show")] = True,
    json: JsonFile = None,
) -> Answer:
    """Run the whole loop, from a simulation to a named cause, and open its page.

    Example: trihedron demo --out demo-results

    Parameters
    ----------
    out
        Folder for the results.
    seed
        Seed of the record with the hidden effect.
    show
        Open the page in a browser if there is a screen.
    """
    from ..demo import run_demo

    trials.check_seed(seed)
    # The command reads back its own output.
    with at_once(), redirect_stdout(StringIO() if json == STANDARD_OUTPUT else sys.stdout):
        page = run_demo(out, seed=seed, show=show)
    files = sorted(str(path) for path in out.rglob("*") if path.is_file())
    return answer("", json, {"schema": "trihedron.demo/1", "page": str(page), "seed": seed, "files": files})
