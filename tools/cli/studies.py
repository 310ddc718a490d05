"""The commands that plan measurements, hide effects, carry out campaigns and reproduce the papers' tables."""

import sys
import threading
import webbrowser
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, Parameter

from .. import batch as batches
from .. import campaign as campaigns
from .. import instrument as folders
from .. import library, own_effects, papers, reports, trials, workbench
from ..errors import InputError
from ..files import at_once, json_text, made_folder, ordinary_file, ordinary_folder, write_text
from ..options import EffectsFrom
from ..rounding import exactly
from .answer import (
    STANDARD_OUTPUT,
    Answer,
    File,
    Folder,
    JsonFile,
    ReportFile,
    Whole,
    answer,
    distinct_files,
    page_file,
    with_options_of,
)

ADVICE: "list[workbench.Advise]" = []
"""Gives the command that follows a result; `tools.cli` puts it here, which knows all commands."""
LONGEST_S = 1e6
"""Longest run of a page that ends by itself [s]."""
WORSE = 3
"""Exit status of a gate that something does not pass: neither the work failed (1) nor the input was wrong (2)."""
Optional = Annotated[int | None, Parameter(allow_leading_hyphen=True)]
Real = Annotated[float | None, Parameter(allow_leading_hyphen=True)]


@with_options_of(workbench.measure)
def measure_command(
    plan: Path,
    /,
    *,
    source: Annotated[str, Parameter(name="--from", allow_leading_hyphen=True)],
    out: Annotated[Path, Parameter(name="--out", validator=ordinary_file)],
    noise_bound: Annotated[float, Parameter(name="--noise-bound", allow_leading_hyphen=True)],
    json: JsonFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron measure plan --from in.csv --out monday.csv --noise-bound 1e-5"""
    distinct_files({"the plan": plan, "--from": Path(source), "--out": out, "--json": json})
    # Results are kept as they arrive, and --resume continues from them.
    with at_once():
        try:
            result = workbench.measure(plan, source=source, out=out, noise_bound=noise_bound, **options, progress=True)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted; {out} holds what came, and continue with --resume with it") from None
    return answer(result, json)


@with_options_of()
def open_command(
    *files: Path, port: Whole = 0, no_browser: bool = False, duration: Real = None, json: JsonFile = None
) -> None:
    """Open records on one page: look, leave out bad rests, calculate again, export.

    The page is served to this machine alone, until Ctrl-C. Decisions are kept beside each record, in
    RECORD.decisions.toml; every command reads them.

    Example: trihedron open walk.csv

    Example: trihedron open

    Parameters
    ----------
    files
        Records; more are dropped on the page.
    port
        Port of the page; 0 takes a free one.
    no_browser
        Print the address, and open no browser.
    duration
        End after this time [s].
    json
        Write the address and the files as JSON to this file; - prints them.
    """
    if duration is not None and not 0.0 <= duration <= LONGEST_S:
        raise InputError(f"--duration {exactly(duration)}: must be from 0 to {exactly(LONGEST_S)} s")
    distinct_files({**{f"file {number}": path for number, path in enumerate(files, start=1)}, "--json": json})
    with at_once(), closing(workbench.open_records(*files, port=port, advise=ADVICE[0])) as page:
        if json is not None:
            listed = [str(path) for path in files]
            content = json_text({"schema": "trihedron.open/1", "address": page.address, "files": listed})
            if json == STANDARD_OUTPUT:
                print(content, end="", flush=True)
            else:
                write_text(json, content)
        print(f"the page of these records, for this machine alone: {page.address}", file=sys.stderr, flush=True)
        if not no_browser:
            webbrowser.open(page.address)
        with suppress(KeyboardInterrupt):
            threading.Event().wait(duration)


@with_options_of()
def hidden_command(
    record: File = None,
    /,
    *,
    seed: Optional = None,
    secret: Annotated[File, Parameter(name="--answer")] = None,
    effect: Annotated[tuple[str, ...], Parameter(name=("--effect", "--effects"))] = (),
    clean: bool = False,
    cases: Optional = None,
    size: Annotated[tuple[float, float] | None, Parameter(allow_leading_hyphen=True)] = None,
    out: Folder = None,
    jobs: int = 1,
    strapdown: bool = False,
    bench: bool = False,
    baseline: Literal["asymmetric", "symmetric"] | None = None,
    suite: str | None = None,
    mode: Literal["clean", "single", "between", "pairs"] | None = None,
    records: int | None = None,
    positions: tuple[int, int] | None = None,
    noise: Literal["uniform", "edge", "correlated", "all"] | None = None,
    effects_from: EffectsFrom = None,
    json: JsonFile = None,
) -> Answer:
    """Make a "measured" record with one hidden effect; or make, diagnose and count many (--cases).

    Example: trihedron hidden measured.csv --seed 7 --answer answer.json

    Example: trihedron hidden --cases 100 --seed 1 --mode single --out suite

    Example: trihedron hidden --suite quick-single

    Example: trihedron hidden --cases 20 --records 3 --positions 16 40 --out triples

    Example: trihedron hidden bench.csv --bench --seed 7 --answer answer.json

    Example: trihedron hidden moved.csv --strapdown --seed 7 --answer answer.json

    Parameters
    ----------
    record
        The record to write (CSV).
    seed
        Number that decides truth, effect, size and noise. Default: 0.
    secret
        File for the secret of one record. Without it the secret is lost.
    effect
        Draw from these effects only. Repeat it for several.
    clean
        Hide no effect.
    cases
        Number of cases to draw, measure and diagnose. A larger number keeps the first cases unchanged.
    size
        Suite: least and greatest size of an effect, as a multiple of the size of sure detection.
    out
        Suite: folder for the results (JSON, CSV, page) and the records.
    jobs
        Suite: number of processes.
    strapdown
        Make a record of gyros and accelerometers moved by hand.
    bench
        Make a record of a whole bench: encoders, gyros and accelerometers, at rest and turning.
    baseline
        Scale factors of the truth: two for each accelerometer, or one. symmetric can hide scale-asymmetry.
    suite
        A suite of scenarios/hidden/suites.toml: clean, single, between, pairs, detection, faults, beside, turns,
        triples, clean-triples. quick- before one of the first four is shorter. --cases and --seed override its own.
    mode
        Suite: hide no effect (clean), one that excludes every rival (single, the default), one that is only detected
        (between), or two (pairs). Or hide a wrong row or a break (faults), also beside an effect (beside).
    records
        Suite: number of records of one instrument in each case, diagnosed together. One effect is in all, another in
        one alone; with mode clean there is none.
    positions
        Suite: fewest and most positions. Default: 12 and 100.
    noise
        Suite: noise uniform within σ, always at ±σ (edge), wandering (correlated), or in turn (all, the default).
    """
    if clean and (effect or mode not in (None, "clean")):
        raise InputError(f"--clean and --{'effect' if effect else 'mode'}: give one of the two")
    drawn = {"--mode": mode, "--records": records, "--positions": positions, "--size": size, "--noise": noise}
    if bench:
        of_positions = {"--strapdown": strapdown or None, "--baseline": baseline, "--suite": suite, **drawn}
        del of_positions["--mode"], of_positions["--size"]
        _refuse(of_positions, "is not of a whole bench; leave it out with --bench")
    if strapdown:
        of_positions = {"--baseline": baseline, "--suite": suite, **drawn}
        del of_positions["--size"]
        _refuse(of_positions, "is of records of a table's positions; leave it out with --strapdown")
    if cases is None and suite is None:
        _refuse({**drawn, "--out": out}, "is of a suite; give --cases too, as --cases 100")
        if record is None:
            example = "moved.csv" if strapdown else "measured.csv"
            raise InputError(f"hidden: give the file of one record, as {example}, or --cases for a suite")
        distinct_files({"the record": record, "--answer": secret, "--json": json})
    else:
        suites, files = "--cases and --suite of many", " (many have --out)"
        if strapdown:
            suites, files = "--cases of many", ""
        of_one = {"the record": record, "--answer": secret, "--baseline": baseline}
        _refuse(of_one, f"is of one record, {suites}; give one of the two{files}")
        if suite is not None:
            _refuse({**drawn, "--effect": effect or None, "--clean": clean or None}, "is what --suite decides")
    with own_effects.with_effects_of(effects_from) as own_names:
        chosen = mode or ("single" if records in (None, 1) else "pairs")
        settings: dict[str, Any] = {
            "mode": "clean" if clean else chosen,
            "effects": effect,
            "positions": positions or (12, 100),
            "noise": noise or "all",
            "size": size,
            "strapdown": strapdown,
            "records": 1 if records is None else records,
            "own": own_names,
            "whole": bench,
        }
        if record is not None:
            seed = seed or 0
            trials.check_seed(seed)
            if strapdown or bench:
                case = trials.draw_case(trials.Options(**settings), seed, seed)
            else:
                effects = () if clean else effect or None
                case = trials.draw_alone(seed, effects=effects, symmetric=baseline == "symmetric")
            trials.write_hidden_record(case, record, secret)
            content = {"schema": "trihedron.hidden-record/1", "record": str(record), "seed": seed}
            return answer(str(record), json, content)
        if suite is None:
            drawn_suite = trials.NamedSuite(trials.Options(**settings), 100, 0)
        else:
            drawn_suite = trials.named_suite(suite)
            drawn_suite = replace(drawn_suite, options=replace(drawn_suite.options, own=own_names))
        folder = None
        if out is not None:
            folder = out / "records"
            made_folder(folder, out)
        result = trials.run_suite(
            drawn_suite.options,
            drawn_suite.cases if cases is None else cases,
            drawn_suite.seed if seed is None else seed,
            records=folder,
            jobs=jobs,
            progress=True,
        )
        return answer(result, json, files=() if out is None else reports.write_suite(result, out))


def _refuse(options: Mapping[str, object], why: str) -> None:
    """Refuse the first option that was given."""
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name}: {why}")


@with_options_of(library.run_campaign)
def campaign_command(campaign: Path, /, *, out: Folder = None, json: JsonFile = None, **options: Any) -> Answer:
    """Example: trihedron campaign attitude-60s.toml --jobs 2 --out attitude-60s"""
    distinct_files({"the campaign": campaign, "--json": json})
    # Results are kept as they arrive, and --resume continues from them.
    with at_once():
        result = library.run_campaign(campaign, out, **options, progress=True)
    folder = result.folder or Path()
    return answer(result, json, files=[folder / "runs", folder / "summary.json", folder / "index.html"])


@with_options_of(batches.batch)
def batch_command(
    files: Path,
    /,
    *others: Path,
    do: Literal["calibrate", "diagnose", "noise", "apply"],
    out: Annotated[Path, Parameter(name="--out", validator=ordinary_folder)],
    mounting: str | None = None,
    calibration: Annotated[Path | None, Parameter(name="--with")] = None,
    tolerance: File = None,
    json: JsonFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron batch records/*.csv --do calibrate --noise-bound 1e-5 --out lot

    Example: trihedron batch lot.csv --do diagnose --tolerance limits.toml --out lot

    Parameters
    ----------
    others
        Further records.
    """
    distinct_files({"the first record": files, "--json": json})
    # Results are kept as they arrive, and --resume continues from them.
    with at_once():
        lot = batches.batch(
            files,
            *others,
            do=do,
            out=out,
            mounting=mounting,
            calibration=calibration,
            tolerance=tolerance,
            **options,
            progress=True,
        )
    written = [out / name for name in ("index.html", "records.parquet", "lot.json")]
    return answer(lot, json, files=written)


@with_options_of(library.campaign_report)
def campaign_report_command(
    folder: Path,
    /,
    *,
    against: Path | None = None,
    gate: bool = False,
    report: ReportFile = None,
    json: JsonFile = None,
) -> Answer:
    """Example: trihedron campaign-report attitude-60s

    Example: trihedron campaign-report new --against old --gate

    Parameters
    ----------
    gate
        End with exit status 3 if a result is worse beyond chance.
    """
    distinct_files({"--report": report, "--json": json})
    if gate and against is None:
        raise InputError("--gate: goes with --against, the campaign to compare with")
    page = folder / campaigns.PAGE if report is None else report
    result = library.campaign_report(folder, report=page, against=against)
    if not isinstance(result, campaigns.Comparison):
        return answer(result, json, files=[page])
    worse = result.of("worse") if gate else ()
    complaint = f"{folder}: {len(worse)} worse than {against}, beyond chance" if worse else ""
    return answer(result, json, files=[page], complaint=complaint, status=WORSE)


@with_options_of(library.compare)
def compare_command(
    first: Path,
    second: Path,
    /,
    *,
    within: Annotated[tuple[str, ...], Parameter(name="--within", allow_leading_hyphen=True)] = (),
    report: ReportFile = None,
    json: JsonFile = None,
) -> Answer:
    """With --within, the exit status is 3 if they differ by more.

    Example: trihedron compare before after --report differences.html

    Example: trihedron compare before after --within 1e-9 --within f1_mps2=1e-6

    Parameters
    ----------
    first
        The folder of a run, or the file of a run or a record.
    second
        The other one.
    """
    distinct_files({"the first": first, "--report": report, "--json": json})
    distinct_files({"the second": second, "--report": report, "--json": json})
    differences = library.compare(first, second, within=within)
    if report is not None:
        reports.write_report(report, differences)
    complaint = ""
    if within and differences.verdict == "different":
        complaint = str(differences).split("\n")[0]
    return answer(differences, json, complaint=complaint, status=WORSE)


@with_options_of(library.plot)
def plot_command(
    run: Path, page: Annotated[Path, Parameter(validator=page_file("the page"))], /, *, json: JsonFile = None
) -> Answer:
    """Example: trihedron plot monday.csv monday.html

    Parameters
    ----------
    run
        The folder of a run, or the file of a run or a record.
    page
        The page, .html or .pdf.
    """
    distinct_files({"the run": run, "the page": page, "--json": json})
    library.plot(run, page)
    return answer(str(page), json, {"schema": "trihedron.plot/1", "run": str(run), "page": str(page)})


reproduce = App(
    name="reproduce",
    help="Recompute published tables, and name their errors.\n\nExample: trihedron reproduce calibration",
)


@reproduce.command
def calibration(*, json: JsonFile = None) -> Answer:
    """Recompute the published calibration tables, and name their errors.

    Example: trihedron reproduce calibration
    """
    return answer(papers.check_published_calibration(), json)


@reproduce.command(name="attitude")
def published_attitude(*, out: Folder = None, json: JsonFile = None) -> Answer:
    """Recompute every published row of the attitude algorithms, with the ratio and the true method error.

    Example: trihedron reproduce attitude --out reproduced

    Parameters
    ----------
    out
        Folder for attitude.csv and attitude.svg.
    """
    written = {f"--out (attitude.{form})": out and out / f"attitude.{form}" for form in ("csv", "svg")}
    distinct_files({**written, "--json": json})
    result = papers.reproduce_attitude(progress=True)
    return answer(result, json, files=() if out is None else reports.write_reproduction(result, out))


@reproduce.command
def word_length(*, json: JsonFile = None) -> Answer:
    """Compute the error of 32-bit arithmetic and increments in the update (22), and a remedy.

    Example: trihedron reproduce word-length
    """
    return answer(papers.word_length_errors(progress=True), json)


# An instrument's folder

instrument = App(
    name="instrument",
    help="Keep the calibrations and diagnoses of an instrument in a folder.\n\n"
    "Example: trihedron instrument list unit-17",
)
Degrees = Annotated[float | None, Parameter(allow_leading_hyphen=True)]


@instrument.command
def add(
    folder: Path,
    result: Path,
    /,
    *,
    records: Annotated[tuple[Path, ...], Parameter(name="--record")] = (),
    date: str | None = None,
    temperature: Degrees = None,
    serial: str | None = None,
    json: JsonFile = None,
) -> Answer:
    """Put a calibration or diagnosis into an instrument's folder.

    Example: trihedron instrument add unit-17 calibration.json --record monday.csv

    Parameters
    ----------
    folder
        The instrument's folder.
    result
        The result of `trihedron calibrate --json` or `trihedron diagnose --json`.
    records
        Record of the result. Its comment lines (# date: ...) and temperatures fill missing options. Repeat it for
        several.
    date
        Date of the measurement, as 2026-11-23 or 2026-11-23T14:00.
    temperature
        Temperature of the instrument [degC].
    serial
        Serial number of the instrument.
    """
    record_files = {f"--record {k}": path for k, path in enumerate(records, start=1)}
    distinct_files({"the result": result, **record_files, "--json": json})
    entry = folders.add_to_instrument(
        folder, result, records=records, date=date, temperature=temperature, serial=serial
    )
    return answer(entry, json, files=[folder / entry.file])


@instrument.command(name="list")
def list_(folder: Path, /, *, json: JsonFile = None) -> Answer:
    """List the entries of an instrument's folder by date.

    Example: trihedron instrument list unit-17

    Parameters
    ----------
    folder
        The instrument's folder.
    """
    return answer(folders.entries_of(folder), json)


@instrument.command
def show(
    folder: Path,
    /,
    *,
    date: str | None = None,
    temperature: Degrees = None,
    kind: Literal["calibration", "diagnosis"] | None = None,
    out: File = None,
    json: JsonFile = None,
) -> Answer:
    """Show the calibration or diagnosis nearest in date or temperature. Default: the last one.

    Example: trihedron instrument show unit-17 --temperature 35 --out nearest.json

    Parameters
    ----------
    folder
        The instrument's folder.
    date
        Nearest to this date, as 2026-11-23 or 2026-11-23T14:00.
    temperature
        Nearest to this temperature [degC].
    kind
        Choose among calibrations or diagnoses only.
    out
        Write the result to this file, for `trihedron apply`.
    """
    distinct_files({"--out": out, "--json": json})
    entry = folders.nearest_of_instrument(folder, date=date, temperature=temperature, kind=kind)
    if out is not None:
        write_text(out, json_text(entry.result))
    return answer(entry, json)


@instrument.command
def trend(folder: Path, /, *, json: JsonFile = None, report: ReportFile = None) -> Answer:
    """Show each parameter over time with its intervals, and the date since which no constant fits.

    Example: trihedron instrument trend unit-17 --report trend.html

    Parameters
    ----------
    folder
        The instrument's folder.
    """
    distinct_files({"--json": json, "--report": report})
    changes = folders.trend_of_instrument(folder)
    if report is not None:
        reports.write_report(report, changes)
    return answer(changes, json)
