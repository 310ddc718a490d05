"""The commands that plan measurements, hide effects, carry out campaigns and reproduce the papers' tables."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, Parameter

from .. import at_table, document, library, own_effects, papers, planning, reports, trials
from .. import campaign as campaigns
from ..errors import InputError
from ..files import at_once, made_folder, ordinary_file, write_text
from .answer import Answer, File, Folder, JsonFile, ReportFile, answer, distinct_files, page_file, takes

WORSE = 3
"""Exit status of a gate that something does not pass: neither the work failed (1) nor the input was wrong (2)."""
Optional = Annotated[int | None, Parameter(allow_leading_hyphen=True)]
Real = Annotated[float | None, Parameter(allow_leading_hyphen=True)]


SEARCH = ("criterion", "reserve_deg", "keep_out", "seed", "starts", "cuts", "mountings", "goal")
FOR = {
    "positions": (
        *SEARCH,
        "resolution_deg",
        "order",
        "repeat",
        "detect",
        "extra",
        "measured",
        "dwell_s",
        *("rate_dps", "acceleration_dps2", "latitude_deg", "accuracy", "out"),
    ),
    "curve": (*SEARCH, "out"),
    "check": ("noise_bound", "keep_out"),
    "imu": (
        *("minutes", "gyro_noise", "encoder_bound", "latitude_deg", "azimuth_deg", "rate_dps", "exchanges"),
        *("dwell_s", "noise_bound", "out"),
    ),
}
"""Which options go with which of the four programmes."""
EVERY_PLAN = ("admissible", "bounds", "convention", "baseline", "mounting")
"""Options of every plan."""


@takes(library.plan, library.plan_positions, library.plan_imu)
def plan(
    *,
    targets: Annotated[tuple[str, ...], Parameter(name="--target", allow_leading_hyphen=True)] = (),
    grid: Real = None,
    continuum: bool = False,
    positions: Optional = None,
    curve: Annotated[tuple[int, int] | None, Parameter(allow_leading_hyphen=True)] = None,
    check: Path | None = None,
    imu: bool = False,
    minutes: Real = None,
    noise_bound: Real = None,
    out: Folder = None,
    picture: File = None,
    json: JsonFile = None,
    report: ReportFile = None,
    **options: Any,
) -> Answer:
    """Or one set of N positions for all; what more positions gain; what setting errors do; or turns for a whole IMU.

    Example: trihedron plan --target X4 --continuum --picture X4.svg

    Example: trihedron plan --positions 12 --reserve 0.1 --out plan12

    Example: trihedron plan --goal levelling --accuracy 7arcsec --noise-bound 1e-5

    Example: trihedron plan --imu --minutes 30 --gyro-noise 1e-5 --out imu30

    Parameters
    ----------
    grid
        Step of the grid of positions [deg]; 1 by default.
    continuum
        All angles in place of a grid.
    positions
        One set of so many positions for all targets.
    curve
        Cost against the number of positions, from LOW to HIGH.
    check
        Compare bias and noise of a plan at the angles that were set: planned_..., alpha_deg, ...
    imu
        Rests and turns that determine accelerometers, gyros and bench.
    minutes
        Time on the table, of --imu; 30.
    dwell_s
        Time at each position [s], for --out and --imu.
    noise_bound
        σ, as a fraction of g, for --goal, --accuracy, --check and --imu; 1e-5.
    out
        Folder for programme, table list, operator's page, picture.
    picture
        Write the paper's figure, for one target, to this SVG file.
    """
    distinct_files({"--json": json, "--report": report, "--picture": picture})
    uses = {"positions": positions, "curve": curve, "check": check, "imu": imu or None}
    if "accuracy" in options and not any(value is not None for value in uses.values()):
        uses["positions"] = 0
    more = {"minutes": minutes, "out": out}
    if not options.keys() & {"goal", "accuracy"}:
        more["noise_bound"] = noise_bound
    given = {name: value for name, value in (uses | more).items() if value is not None}
    given |= {name: value for name, value in options.items() if name not in EVERY_PLAN}
    others = {"--grid": grid, "--continuum": continuum, "--picture": picture}
    use = use_of(given, others | ({"--target": targets} if check is not None or imu else {}))
    if report is not None and use in ("curve", "check"):
        raise InputError(f"--report: does not go with --{use}; it is the page of --target, --positions or --imu")
    if use == "imu":
        if wrong := next((name for name in EVERY_PLAN if name in options), None):
            raise InputError(f"--{wrong}: does not go with --imu")
        options |= {} if noise_bound is None else {"noise_bound": noise_bound}
        return _imu(library.plan_imu(30.0 if minutes is None else minutes, **options, progress=True), out, json, report)
    if use is not None:
        mounting, dwell = options.pop("mounting", "identity"), options.pop("dwell_s", None)
        if "mountings" in options and mounting != "identity":
            raise InputError("--mounting and --mountings: give one of the two")
        options |= {} if noise_bound is None else {"noise_bound": noise_bound}
        request = planning.Request(**{"mountings": (mounting,), **options}, targets=targets)
        if use == "positions":
            return _positions(positions, dwell, request, out, json, report)
        return _check(check, request, noise_bound, json) if curve is None else _curve(curve, request, out, json)
    if continuum and grid is not None:
        raise InputError("--grid and --continuum: give one of the two")
    if picture is not None and len(targets) != 1:
        raise InputError("--picture: is of one target; give one --target")
    step = None if continuum else 1.0 if grid is None else grid
    plans = library.plan(*targets, grid=step, **options, progress=True)
    if report is not None:
        document.write_page(report, reports.plan_page(plans))
    if picture is not None:
        write_text(picture, reports.plan_picture(plans[0]))
    return answer(plans, json)


@takes(at_table.measure)
def measure(
    plan: Path,
    /,
    *,
    source: Annotated[str, Parameter(name="--from", allow_leading_hyphen=True)],
    out: Annotated[Path, Parameter(name="--out", validator=ordinary_file)],
    noise_bound: Annotated[float, Parameter(name="--noise-bound", allow_leading_hyphen=True)],
    json: JsonFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron measure plan24 --from growing.csv --out monday.csv --noise-bound 1e-5 --serve

    Example: trihedron measure plan24 --from /dev/ttyUSB0 --out monday.csv --noise-bound 1e-5 --resume
    """
    distinct_files({"the plan": plan, "--from": Path(source), "--out": out, "--json": json})
    # What comes is kept as it comes, and --resume goes on with it.
    with at_once():
        try:
            done = at_table.measure(plan, source=source, out=out, noise_bound=noise_bound, **options, progress=True)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted; {out} holds what came, and --resume goes on with it") from None
    return answer(done, json)


def use_of(given: Mapping[str, Any], others: Mapping[str, object]) -> str | None:
    """Which use of a common set is asked for, None: plans of single targets; refuses what does not go together."""
    uses = [name for name in FOR if name in given]
    if len(uses) > 1:
        raise InputError(f"--{uses[0]} and --{uses[1]}: give one of the two")
    if not uses:
        if given:
            name = next(iter(given))
            takes_it = [f"--{use}" for use in FOR if name in FOR[use]]
            if "--positions" in takes_it:
                takes_it += ["--accuracy"]
            raise InputError(f"--{_typed(name)}: goes with {' or '.join(takes_it)}")
        return None
    use = uses[0]
    for name in given:
        if name != use and name not in FOR[use]:
            raise InputError(f"--{_typed(name)}: does not go with --{use}")
    for name, value in others.items():
        if value:
            raise InputError(
                f"{name}: does not go with --{use}; a common set is sought at any angles, and checked for all targets"
            )
    return use


def _typed(name: str) -> str:
    return name.removesuffix("_deg").removesuffix("_s").replace("_", "-")


def _positions(
    count: int | None,
    dwell: float | None,
    request: "planning.Request",
    out: Path | None,
    json: Path | None,
    page: Path | None,
) -> Answer:
    dwell_s = planning.checked_dwell(planning.DWELL_S if dwell is None else dwell)
    if (count is None) == (request.accuracy is None):
        raise InputError("--positions and --accuracy: give one of the two")
    if count is None:
        found = planning.plan_to_accuracy(request, progress=True)
    else:
        found = planning.plan_positions(count, request, progress=True)
    files = reports.write_plan(found, out, dwell_s=dwell_s) if out is not None else []
    if page is not None:
        document.write_page(page, reports.operator_page(found, dwell_s))
    return answer(found, json, files=files)


def _imu(found: "planning.ImuPlan", out: Path | None, json: Path | None, page: Path | None) -> Answer:
    files = reports.write_imu_plan(found, out) if out is not None else []
    if page is not None:
        reports.write_report(page, found)
    return answer(found, json, files=files)


def _curve(ends: tuple[int, int], request: "planning.Request", out: Path | None, json: Path | None) -> Answer:
    curve = planning.plan_curve(*ends, request, progress=True)
    files = reports.write_curve(curve, out) if out is not None else []
    return answer(curve, json, files=files)


def _check(file: Path | None, request: "planning.Request", noise_bound: float | None, json: Path | None) -> Answer:
    assert file is not None
    planned, actual = planning.read_angles(file, request.keep_out)
    noise = 1e-5 if noise_bound is None else noise_bound
    found = planning.check_settings(planning.task_of(request, progress=True), planned, actual, noise)
    return answer(found, json)


def hidden(
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
    effects_from: Annotated[Path | None, Parameter(name="--effects-from")] = None,
    json: JsonFile = None,
) -> Answer:
    """Make a "measured" record with one hidden effect, or with --cases a suite: many records, diagnosed and counted.

    Example: trihedron hidden measured.csv --seed 7 --answer answer.json

    Example: trihedron hidden --cases 100 --seed 1 --mode single --out suite

    Example: trihedron hidden --suite quick-single

    Example: trihedron hidden --cases 20 --records 3 --positions 16 40 --out triples

    Example: trihedron hidden bench.csv --bench --seed 7 --answer answer.json

    Example: trihedron hidden moved.csv --strapdown --seed 7 --answer answer.json

    Parameters
    ----------
    record
        Where one position record is written (CSV).
    seed
        Decides truth, effect, size and noise; 0 by default.
    secret
        Of one record: where the secret goes; without it nobody will know.
    effect
        Draw from these effects only; may be repeated.
    clean
        Hide nothing.
    cases
        So many records are drawn, measured and diagnosed; more leave these as they are.
    size
        Of a suite: least and greatest size over that of sure detection, in place of those of the mode.
    out
        Of a suite: folder for the results (JSON, CSV, page) and the records.
    jobs
        Of a suite: number of processes.
    strapdown
        A record of gyros and accelerometers that are moved by hand, in place of one of a table's positions.
    bench
        A record of a whole bench, encoders, gyros and accelerometers at rest and turning.
    baseline
        Of one record: whether the block's scale factors depend on the sign; symmetric lets scale-asymmetry be hidden.
    suite
        A suite of scenarios/hidden/suites.toml: clean, single, between, pairs, detection, triples, clean-triples, or
        quick- before one of the first four. It decides what is drawn, and, unless they are given, --cases and --seed.
    mode
        Of a suite: nothing hidden; one effect that every rival is surely excluded for (the default); one that is only
        surely detected; two effects.
    records
        Of a suite: so many records of one instrument in each case, diagnosed together. One effect is in all of them,
        one in a record alone (mode pairs, the default), or none (clean).
    positions
        Of a suite: fewest and most positions, 12 and 100 by default.
    noise
        Of a suite: uniform within σ, at ±σ everywhere, wandering within σ, or one after the other (the default).
    effects_from
        A file of effects of your own (Python, as in models/effects): it is run, checked, and its effects may be hidden
        and are tried beside those of the catalogue.
    """
    with own_effects.with_effects_of(effects_from) as own:
        if clean and (effect or mode not in (None, "clean")):
            raise InputError(f"--clean and --{'effect' if effect else 'mode'}: give one of the two")
        drawn = {"--mode": mode, "--records": records, "--positions": positions, "--size": size, "--noise": noise}
        if bench:
            others = {"--strapdown": strapdown or None, "--baseline": baseline, "--suite": suite, **drawn}
            _refuse(others | {"--mode": None, "--size": None}, "is not of a whole bench; leave it out with --bench")
        if strapdown:
            of_a_table = {"--baseline": baseline, "--suite": suite, **drawn, "--size": None}
            _refuse(of_a_table, "is of records of a table's positions; leave it out with --strapdown")
        if cases is None and suite is None:
            _refuse({**drawn, "--out": out}, "is of a suite; give --cases too, as --cases 100")
            if record is None:
                example = "moved.csv" if strapdown else "measured.csv"
                raise InputError(f"hidden: give the file of one record, as {example}, or --cases for a suite")
            distinct_files({"the record": record, "--answer": secret, "--json": json})
            seed = seed or 0
            trials.check_seed(seed)
            if strapdown or bench:
                chosen = "clean" if clean else "single"
                options = trials.Options(chosen, effect, strapdown=strapdown, own=own, whole=bench)
                case = trials.draw_case(options, seed, seed)
            else:
                chosen = () if clean else effect or None
                case = trials.draw_alone(seed, effects=chosen, symmetric=baseline == "symmetric")
            trials.write_hidden_record(case, record, secret, progress=True)
            return answer(
                str(record), json, {"schema": "trihedron.hidden-record/1", "record": str(record), "seed": seed}
            )
        many = (
            "--cases of many; give one of the two" if strapdown else "--cases and --suite of many; give one of the two"
        )
        only = {"the record": record, "--answer": secret, "--baseline": baseline}
        _refuse(only, f"is of one record, {many}{'' if strapdown else ' (many have --out)'}")
        if suite is not None:
            _refuse({**drawn, "--effect": effect or None, "--clean": clean or None}, "is what --suite decides")
            named = trials.named_suite(suite)
            named = replace(named, options=replace(named.options, own=own))
        else:
            chosen_mode = "clean" if clean else mode or ("single" if records in (None, 1) else "pairs")
            options = trials.Options(
                chosen_mode,
                effect,
                positions or (12, 100),
                noise or "all",
                size,
                strapdown,
                1 if records is None else records,
                own,
                bench,
            )
            named = trials.NamedSuite(options, 100, 0)
        number, seed = named.cases if cases is None else cases, named.seed if seed is None else seed
        done = trials.run_suite(named.options, number, seed, records=_records_folder(out), jobs=jobs, progress=True)
        return answer(done, json, files=() if out is None else reports.write_suite(done, out))


def _refuse(given: Mapping[str, object], why: str) -> None:
    """Refuse the first option that was given."""
    for name, value in given.items():
        if value is not None:
            raise InputError(f"{name}: {why}")


def _records_folder(out: Path | None) -> Path | None:
    """The folder for a suite's records, made; None where nothing is written."""
    if out is None:
        return None
    made_folder(out / "records", out)
    return out / "records"


@takes(library.run_campaign)
def campaign(campaign: Path, /, *, out: Folder = None, json: JsonFile = None, **options: Any) -> Answer:
    """Example: trihedron campaign scenarios/campaigns/attitude-60s.toml --jobs 2 --out attitude-60s"""
    distinct_files({"the campaign": campaign, "--json": json})
    # What is computed is kept as it comes, and --resume goes on with it.
    with at_once():
        done = library.run_campaign(campaign, out, **options, progress=True)
    folder = done.folder or Path()
    return answer(done, json, files=[folder / "runs", folder / "summary.json", folder / "index.html"])


def campaign_report(
    folder: Path,
    /,
    *,
    against: Path | None = None,
    gate: bool = False,
    report: ReportFile = None,
    json: JsonFile = None,
) -> Answer:
    """Write the page of a campaign; say what got better or worse than in another one, beyond chance.

    Example: trihedron campaign-report attitude-60s

    Example: trihedron campaign-report new --against old --gate

    Parameters
    ----------
    folder
        Of a campaign that is complete.
    against
        Folder of the campaign to compare with.
    gate
        End with exit status 3 where something got worse beyond chance.
    report
        File of the page, <folder>/index.html by default.
    json
        File for the comparison, or without --against for the summary.
    """
    distinct_files({"--report": report, "--json": json})
    if gate and against is None:
        raise InputError("--gate: goes with --against, the campaign to compare with")
    store, manifest = campaigns.open_result(folder)
    comparison = None if against is None else campaigns.compare(folder, against)
    page = folder / "index.html" if report is None else report
    summary = campaigns.summarise(store)
    document.write_page(page, reports.campaign_page(store, manifest, comparison))
    if comparison is None:
        return answer(summary, json, files=[page])
    worse = comparison.of("worse") if gate else ()
    complaint = f"{folder}: {len(worse)} worse than {against}, beyond chance" if worse else ""
    return answer(comparison, json, files=[page], complaint=complaint, status=WORSE)


@takes(library.compare)
def compare(
    first: Path,
    second: Path,
    /,
    *,
    within: Annotated[tuple[str, ...], Parameter(name="--within", allow_leading_hyphen=True)] = (),
    report: ReportFile = None,
    json: JsonFile = None,
) -> Answer:
    """Exit status 3 where --within is given and they differ by more.

    Example: trihedron compare before after --report differences.html

    Example: trihedron compare before/run.parquet after/run.parquet --within 1e-9 --within f1_mps2=1e-6

    Parameters
    ----------
    first
        The folder of a run, or the file of a run or a record.
    second
        The other one.
    """
    distinct_files({"the first": first, "--report": report, "--json": json})
    distinct_files({"the second": second, "--report": report, "--json": json})
    found = library.compare(first, second, within=within)
    if report is not None:
        reports.write_report(report, found)
    complaint = str(found).split("\n")[0] if within and found.verdict == "different" else ""
    return answer(found, json, complaint=complaint, status=WORSE)


@takes(library.plot)
def plot(
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


reproduce = App(name="reproduce", help="Compute published tables again, and say where they are wrong.")


@reproduce.command
def calibration(*, json: JsonFile = None) -> Answer:
    """Compute the published calibration tables again, and say where they are wrong.

    Example: trihedron reproduce calibration
    """
    return answer(papers.check_published_calibration(), json)


@reproduce.command(name="attitude")
def published_attitude(*, out: Folder = None, json: JsonFile = None) -> Answer:
    """Run every published row of the attitude algorithms again: published, reproduced, ratio, true method error.

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
    """Show what 32-bit arithmetic and 32-bit increments cost the update (22), and what mends it.

    Example: trihedron reproduce word-length
    """
    return answer(papers.word_length_errors(progress=True), json)
