"""The command line: each command is a thin layer over one function of the library."""

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from trihedron import (
    __version__,
    threads,  # noqa: F401  (before anything that imports numpy)
)
from trihedron.errors import InputError
from trihedron.exit_status import exit_status
from trihedron.fmpy_commands import fmpy_input
from trihedron.hidden_commands import hidden
from trihedron.options import (
    Baseline,
    Bounds,
    Gravity,
    JsonFile,
    Mounting,
    NoiseBound,
    Priors,
    Record,
    ReportFile,
    SsvFile,
)
from trihedron.outputs import distinct_files, ordinary_file
from trihedron.planning_commands import plan
from trihedron.reproduce_commands import reproduce
from trihedron.ssp_commands import export_ssp
from trihedron.strapdown_commands import inspect

app = App(
    name="trihedron",
    help="Simulate the bench, calibrate with guaranteed bounds, find what the simulation gets wrong.",
    version=__version__,
    default_parameter=Parameter(negative=(), negative_iterable=()),
    help_format="plaintext",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)


@app.command
def simulate(scenario: Path, /, *, out: Path | None = None, step: float | None = None) -> None:
    """Run a scenario: couple its FMUs, record the run, average its rests.

    Example: trihedron simulate scenarios/static-calibration.toml --out run

    Parameters
    ----------
    scenario
        The scenario file (TOML), or an .ssp.
    out
        Folder for the results; by default <scenario>-run in the current folder.
    step
        Length of a step [s] of an .ssp, where it does not say one or another is wanted.
    """
    from trihedron.bench_run import run_scenario

    for file in run_scenario(scenario, out, progress=True, step=step):
        print(file)


@app.command
def calibrate(
    record: Record,
    /,
    *,
    noise_bound: NoiseBound = None,
    gravity: Gravity = 9.80665,
    convention: Literal["A1", "A2"] = "A1",
    baseline: Baseline = "asymmetric",
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    target: Annotated[
        tuple[str, ...],
        Parameter(allow_leading_hyphen=True, help="Another combination, as X4-X5; may be repeated."),
    ] = (),
    prior: Priors = (),
    json: JsonFile = None,
    ssv: SsvFile = None,
    report: ReportFile = None,
) -> None:
    """Solve the guaranteed linear programme: estimates, guaranteed errors, exact intervals, verdict.

    Example: trihedron calibrate positions.csv --noise-bound 1e-5 --json calibration.json
    """
    distinct_files({"the record": record, "--json": json, "--ssv": ssv, "--report": report})
    from trihedron.calibration import calibrate as solve
    from trihedron.calibration.parameter_file import write_parameter_set
    from trihedron.records.reading import read_table_run
    from trihedron.summaries import calibration_summary
    from trihedron.writing import write_text

    run = read_table_run(record)
    result = solve(
        run.record,
        noise_bound=noise_bound,
        gravity=gravity,
        convention=convention,
        baseline=baseline,
        bounds=bounds,
        mounting=mounting,
        targets=target,
        priors=prior,
    )
    if json is not None:
        write_text(json, result.json_text())
    if report is not None:
        from trihedron.report.results import calibration_page

        write_text(report, calibration_page(result, run))
    print(calibration_summary(result))
    if ssv is not None:
        write_parameter_set(result, ssv)


@app.command
def diagnose(
    record: Record,
    /,
    *,
    noise_bound: NoiseBound = None,
    gravity: Gravity = 9.80665,
    baseline: Baseline = "asymmetric",
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    json: JsonFile = None,
    report: ReportFile = None,
    export: Annotated[Path | None, Parameter(help="Write the extended FMUs into this folder.")] = None,
) -> None:
    """Say whether the simulation can be true of a record; if not, name the effect that it lacks.

    Example: trihedron diagnose positions.csv --noise-bound 1e-5 --json diagnosis.json --export extended
    """
    distinct_files({"the record": record, "--json": json, "--report": report})
    from trihedron.diagnosis import diagnose as judge
    from trihedron.diagnosis.extension import export_extended
    from trihedron.records import read_position_record
    from trihedron.summaries import diagnosis_summary
    from trihedron.writing import write_text

    result = judge(
        read_position_record(record),
        noise_bound=noise_bound,
        gravity=gravity,
        baseline=baseline,
        bounds=bounds,
        mounting=mounting,
        progress=True,
    )
    if json is not None:
        write_text(json, result.json_text())
    if report is not None:
        from trihedron.report.results import diagnosis_page

        write_text(report, diagnosis_page(result, record.name))
    print(diagnosis_summary(result))
    if export is not None and result.verdict == "explained":
        for path in export_extended([cause.place for cause in result.causes], export):
            print(path)


@app.command
def export(
    *components: str,
    fmi: Annotated[Literal["2", "3"], Parameter(help="FMI version; 3 needs --flavour native.")] = "2",
    flavour: Annotated[
        Literal["python", "native"], Parameter(help="What the FMU runs: Python by PythonFMU, or machine code.")
    ] = "python",
    platform: Annotated[
        str | None, Parameter(help="Of the native flavour: host (the default), all, or a name as aarch64-linux.")
    ] = None,
    effect: Annotated[
        tuple[str, ...], Parameter(help='Extend by an effect, as "quadratic accelerometer-3"; may be repeated.')
    ] = (),
    out: Path = Path("fmus-exported"),
) -> None:
    """Write components as FMUs; all of them when none is named.

    Example: trihedron export TurntableMotion AccelerometerBlock --flavour native --fmi 3 --out fmus

    Parameters
    ----------
    components
        Names of components.
    out
        Folder for the FMUs.
    """
    from trihedron.exporting import export_components

    for path in export_components(components, out, flavour, int(fmi), platform, effect):
        print(path)


@app.command
def attitude(
    record: Annotated[Path, Parameter(help="Strapdown record, CSV or Parquet.")],
    /,
    *,
    algorithm: str = "two-sample-rodrigues",
    rates: Annotated[
        Literal["instantaneous", "averaged"], Parameter(help="What a rate in the record means.")
    ] = "instantaneous",
    rate_divisor: Annotated[int, Parameter(help="Add up so many increments to one: a slower gyro.")] = 1,
    compare: Annotated[bool, Parameter(help="Run every algorithm and show them side by side.")] = False,
    out: Path | None = None,
) -> None:
    """Run a strapdown record through the attitude computer's FMU; compare with the true attitude where it is known.

    Example: trihedron attitude broad-03.strapdown.csv --algorithm adaptive-degree --out attitude

    Parameters
    ----------
    algorithm
        Name of the attitude algorithm; with --compare every one is run.
    out
        Folder for the computed attitude, or for the comparison.
    """
    from trihedron.attitude import attitude_of_record
    from trihedron.attitude.comparison import compare_algorithms, comparison_text, write_comparison
    from trihedron.records import StrapdownRecord, read_record

    measured = read_record(record)
    if not isinstance(measured, StrapdownRecord):
        raise InputError(f"{record}: is a table record; `trihedron attitude` takes a strapdown record (w1_radps, ...)")
    if compare:
        rows = compare_algorithms(measured, rates=rates, rate_divisor=rate_divisor, progress=True)
        if out is not None:
            write_comparison(rows, out / "comparison.csv")
        print(comparison_text(rows))
        return
    result = attitude_of_record(
        measured, algorithm=algorithm, rates=rates, rate_divisor=rate_divisor, out=out, progress=True
    )
    print("\n".join(result.summary()))


@app.command
def apply(
    calibration: Annotated[Path, Parameter(help="The result of `trihedron calibrate --json`.")],
    record: Annotated[Path, Parameter(help="Position, raw or strapdown record, CSV or Parquet.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="Write the corrected record (CSV).", validator=ordinary_file)] = None,
    noise_bound: Annotated[
        float,
        Parameter(allow_leading_hyphen=True, help="Bound of the readings' own errors, a fraction of g, for the bound."),
    ] = 0.0,
    latitude_deg: Annotated[float, Parameter(allow_leading_hyphen=True, help="For the error of the azimuth.")] = 55.75,
) -> None:
    """Correct the readings of a record by a calibration; print the equation and what it is worth for levelling.

    Example: trihedron apply calibration.json positions.csv --out corrected.csv
    """
    distinct_files({"the calibration": calibration, "the record": record, "--out": out})
    from trihedron.applying import application_summary, apply_calibration, write_corrected

    result = apply_calibration(calibration, record, noise_bound=noise_bound)
    text = application_summary(result, latitude_deg)
    if out is not None:
        write_corrected(result, out)
    print(text)


app.command(export_ssp)
app.command(fmpy_input)
app.command(hidden)
app.command(inspect)
app.command(plan)
app.command(reproduce)


@app.command
def demo(
    *,
    out: Path = Path("demo-results"),
    seed: int = 2026,
    show: Annotated[bool, Parameter(negative="--no-show")] = True,
) -> None:
    """Run the whole loop, from simulation to measured data to a named cause, and open the page of results.

    Example: trihedron demo --out demo-results

    Parameters
    ----------
    out
        Folder for everything that is made.
    seed
        Of the record with the hidden effect.
    show
        Open the page in a browser where there is a screen.
    """
    from trihedron.demo import run_demo
    from trihedron.hidden import check_seed

    check_seed(seed)
    run_demo(out, seed=seed, show=show)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    return exit_status(lambda: app(arguments, exit_on_error=False, print_error=False))


if __name__ == "__main__":
    sys.exit(main())
