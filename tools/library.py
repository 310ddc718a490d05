"""Functions of `import trihedron as th`: one for each task of the program.

Functions on measured records are in `measured`, plans in `planning.library`. Each is documented once: the command of
the same name takes its options, their defaults and their words from it. Results print themselves and show themselves in
a notebook; those of a published schema convert to JSON by `to_json`. A function imports its modules when it is called,
so `--help`, a mistake and a notebook's first line do not wait for them.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from . import campaign as campaigns
from . import live as live_views
from . import orchestrator, own_effects, reports, ssp, trials
from .errors import InputError
from .options import Baseline, EffectsFrom, InputTable, Live, NoiseBound, Platform, Progress, SetValues, SspVersion

if TYPE_CHECKING:
    from .comparison import Compared
    from .exporting import Exported
    from .installation import Installation


def simulate(
    scenario: "str | Path | Mapping[str, Any] | orchestrator.Scenario",
    *,
    out: str | Path | None = None,
    start: float | None = None,
    stop: float | None = None,
    step: float | None = None,
    coupling: Literal["jacobi", "iterate", "delayed"] | None = None,
    values: SetValues = (),
    inputs: InputTable = None,
    record: Sequence[str] = (),
    tolerance: float | None = None,
    interface: Literal["me", "cs"] | None = None,
    accept_lost: bool = False,
    allow_nan: bool = False,
    realtime: float | None = None,
    live: Live = None,
    in_process: bool = False,
    call_limit: float | None = None,
    effects_from: EffectsFrom = None,
    plot: str | Path | None = None,
    progress: Progress = False,
) -> "orchestrator.Simulation":
    """Run a scenario: couple its FMUs, record the run, average its rests. Or run a single FMU.

    Parameters
    ----------
    scenario : path, mapping or Scenario
        The scenario (TOML), an .ssp or an .fmu; in Python also a mapping with the content of the file.
    out : path, optional
        Folder for the results. Default: SCENARIO-run in the current folder; none in Python.
    start : float, optional
        Start time of an .ssp or .fmu [s]. Default: its default experiment, else 0.
    stop : float, optional
        Stop time of an .ssp or .fmu [s]. Default: its default experiment, else one second after the start.
    step : float, optional
        Step of an .ssp or .fmu [s]. Default: the step in the file. The last step is shortened where it must be.
    coupling : str, optional
        Treatment of algebraic loops in an .ssp; without it loops are refused. delayed: every connection is a step late.
    record : sequence of str
        Variables to record, as h or element.h. Repeat it for several. Default: outputs; without any, states.
    tolerance : float, optional
        Relative tolerance of the solver of .fmu files. Default: that of the file, else 1e-6.
    interface : str, optional
        Model exchange (me) or co-simulation (cs), for an .fmu that has both. Default: cs.
    accept_lost : bool
        Run even if an FMU does not hold a value that was set.
    allow_nan : bool
        Run on when an output is not a finite number.
    realtime : float, optional
        Wait for the clock: real time without a number, 2 is twice as fast. Delay, jitter and overruns are reported.
    in_process : bool
        Run other makers' FMUs in this process. It is faster, but a crash of one FMU ends the program.
    call_limit : float, optional
        Longest call of an FMU in its own process [s]; then the run ends. Default: no limit.
    plot : path, optional
        Write the recorded columns as lines over time to this page, .html or .pdf.

    Returns
    -------
    Simulation
        The run, with its columns and files.

    Raises
    ------
    InputError
        for anything that cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> run = th.simulate("scenarios/table-attitude.toml")
    >>> run["q0"].max()
    """
    if not isinstance(scenario, str | Path | Mapping | orchestrator.Scenario):
        raise InputError(f"a scenario is a path, or what its file says, not {type(scenario).__name__}")
    choice = orchestrator.RunOptions(
        start, stop, step, coupling, in_process, call_limit, accept_lost, allow_nan, realtime
    )
    table = None if inputs is None else Path(inputs)
    adjustments = orchestrator.Adjustments(values, table, record, tolerance, interface)
    effects, shown = own_effects.with_effects_of(effects_from), live_views.shown_run(live)
    with effects, shown as show, ssp.opened(scenario, choice, adjustments) as (checked, ignored):
        folder = None if out is None else Path(out)
        run = orchestrator.simulate_table(checked, folder, ignored=ignored, progress=progress, show=show)
    if plot is not None:
        reports.write_plot_of_run(Path(plot), run)
    return run


def export(
    *components: str,
    fmi: Literal[2, 3] = 2,
    flavour: Literal["python", "native"] = "python",
    platform: Platform = None,
    effects: Sequence[str] = (),
    effects_from: EffectsFrom = None,
    out: str | Path = Path("fmus-exported"),
) -> "Exported":
    """Write components as FMUs; all components if none is named.

    Parameters
    ----------
    components : str
        Names of components.
    fmi : int
        FMI version; 3 needs --flavour native.
    flavour : str
        Content of the FMU: Python (by PythonFMU) or machine code.
    effects : sequence of str
        Effect to add, as "quadratic accelerometer-3". Repeat it for several.
    out : path
        Folder for the FMUs.

    Returns
    -------
    Exported
        The FMUs that were written.

    Raises
    ------
    InputError
        no such component, effect or platform, or a folder that cannot be written

    Examples
    --------
    >>> import trihedron as th
    >>> th.export("AccelerometerBlock", out="fmus", effects=["quadratic accelerometer-3"])  # doctest: +SKIP
    """
    from .exporting import export_components

    with own_effects.with_effects_of(effects_from):
        return export_components(components, Path(out), flavour, fmi, platform, effects)


def export_ssp(
    scenario: "str | Path | orchestrator.Scenario",
    out: str | Path,
    *,
    flavour: Literal["python", "native"] | None = None,
    fmi: int = 2,
    platform: Platform = None,
    version: SspVersion = "1.0",
) -> Path:
    """Write the system of a scenario as an .ssp for OMSimulator, FMPy and `trihedron simulate`.

    Its position programme becomes a component, and its constants become parameters.

    Parameters
    ----------
    scenario : path or Scenario
        The scenario file (TOML).
    out : path
        The .ssp to write.
    flavour : str, optional
        native: compiled, the default with a compiler; python: run by PythonFMU.
    fmi : int
        Version of FMI; tools that open an .ssp run 2.

    Returns
    -------
    Path
        The .ssp.

    Raises
    ------
    InputError
        a scenario that cannot be read, or content that an .ssp cannot hold

    Examples
    --------
    >>> import trihedron as th
    >>> th.export_ssp("bench.toml", "bench.ssp")  # doctest: +SKIP
    """
    checked = scenario if isinstance(scenario, orchestrator.Scenario) else orchestrator.read_scenario(scenario)
    return ssp.write_ssp(checked, Path(out), flavour=flavour, fmi=fmi, platform=platform, ssp=version)


def hide(
    seed: int = 0,
    *effects: str,
    baseline: Baseline = "asymmetric",
    effects_from: EffectsFrom = None,
) -> "trials.HiddenRecord":
    """Draw a "measured" record with one hidden effect, and its secret.

    Parameters
    ----------
    seed : int
        Number that decides truth, effect, size and noise.
    effects : str
        Draw from these only.
    baseline : str
        "symmetric" lets scale-asymmetry be hidden.

    Returns
    -------
    HiddenRecord
        The record and its secret.

    Raises
    ------
    InputError
        a seed, an effect or a baseline that there is not

    Examples
    --------
    >>> import trihedron as th
    >>> hidden = th.hide(7, "quadratic")
    >>> th.diagnose(hidden.record, noise_bound=1e-5).causes[0].place.effect
    'quadratic'
    """
    if baseline not in ("asymmetric", "symmetric"):
        raise InputError(f"--baseline {baseline}: must be asymmetric or symmetric")
    with own_effects.with_effects_of(effects_from):
        return trials.hidden_record(seed, effects=effects or None, symmetric=baseline == "symmetric")


def run_campaign(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    jobs: int | None = None,
    engine: Literal["local", "dask"] = "local",
    scheduler: str | None = None,
    resume: bool = False,
    progress: Progress = False,
) -> "campaigns.CampaignResult":
    """Run a campaign: thousands of runs of a scenario, a calibration, an attitude algorithm or hidden effects.

    Parameters
    ----------
    campaign : path
        The campaign file (TOML).
    out : path, optional
        Folder for the results. Default: CAMPAIGN-campaign in the current folder.
    jobs : int, optional
        Number of worker processes. Default: the number of cores.
    engine : str
        Where the work runs: on this machine, or on a Dask cluster (extra `cluster`).
    scheduler : str, optional
        Address of the scheduler of --engine dask. Default: a local cluster.
    resume : bool
        Continue from the results that the folder holds.
    progress : bool
        Show the progress on standard error if it is a terminal.

    Returns
    -------
    CampaignResult
        The results over all runs, and the failures.

    Raises
    ------
    InputError
        for anything that cannot be done, in one line; earlier results are kept
    KeyboardInterrupt
        Ctrl-C; the folder is whole, and `resume` goes on
    """
    result = campaigns.carry_out_campaign(
        Path(campaign),
        None if out is None else Path(out),
        jobs=jobs,
        engine=engine,
        scheduler=scheduler,
        resume=resume,
        progress=progress,
    )
    if result.folder is not None:
        reports.write_campaign_page(result.folder)
    return result


def campaign_report(
    folder: str | Path, *, against: str | Path | None = None, report: str | Path | None = None
) -> "campaigns.CampaignResult | campaigns.Comparison":
    """Write the page of a campaign, or its gains and losses against another one.

    Parameters
    ----------
    folder : path
        Folder of a complete campaign.
    against : path, optional
        Folder of the campaign to compare with.
    report : path, optional
        File of the page. Default: index.html in the folder.

    Returns
    -------
    CampaignResult or Comparison
        The results over all runs; with `against` the changes.

    Raises
    ------
    InputError
        a folder without a complete campaign, or two campaigns of different kinds

    Examples
    --------
    >>> import trihedron as th
    >>> th.campaign_report("new", against="old").of("worse")  # doctest: +SKIP
    """
    comparison = None if against is None else campaigns.compare_campaigns(Path(folder), Path(against))
    reports.write_campaign_page(Path(folder), None if report is None else Path(report), comparison)
    if comparison is not None:
        return comparison
    return campaigns.summarise(campaigns.open_result(Path(folder))[0])


def new(kind: str, file: str | Path | None = None, *, positions: int = 12) -> list[Path]:
    """Write a file to fill in: a scenario that already runs, or a record with its columns explained.

    Parameters
    ----------
    kind : str
        Kind of file: scenario, record, raw-record, strapdown-record or mounting.
    file : path, optional
        The file. Default: KIND.toml or KIND.csv.
    positions : int
        Number of positions of a scenario or record, 6 to 30.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    InputError
        for another kind, a file that is there already, or a number of positions without a plan

    Examples
    --------
    >>> import trihedron as th
    >>> th.new("scenario", "bench.toml")  # doctest: +SKIP
    """
    from .templates import new as write

    return write(kind, file, positions=positions)


def export_notebook(record: str | Path, *, out: str | Path | None = None, noise_bound: NoiseBound = None) -> Path:
    """Write a notebook (.ipynb) that calibrates and diagnoses a record.

    Parameters
    ----------
    record : path
        Position, raw or strapdown record, CSV or Parquet.
    out : path, optional
        The notebook. Default: the record's name with .ipynb in the current folder.
    noise_bound : float, optional
        σ in the calls: bound of the error of one averaged reading, as a fraction of g.

    Returns
    -------
    Path
        The notebook.

    Raises
    ------
    InputError
        for a record that cannot be read, or a notebook that is there already

    Examples
    --------
    >>> import trihedron as th
    >>> th.export_notebook("monday.csv", noise_bound=1e-5)  # doctest: +SKIP
    """
    from .templates import export_notebook as write

    return write(Path(record), None if out is None else Path(out), noise_bound=noise_bound)


def compare(first: Any, second: Any, *, within: Sequence[str] = ()) -> "Compared":
    """Compare two runs or records: show the largest difference of each column, and its time.

    Rows are matched by time, positions by number; at other times the second is interpolated. Angles differ by the
    shorter way round (359° and 1° by 2°), and q and -q are one attitude.

    Parameters
    ----------
    first, second : path, table in memory, record or Simulation
        The folder of a run, the file of a run or a record (CSV, Parquet), or either in memory.
    within : sequence of str
        Largest allowed difference, in the unit of the column: 1e-6 for all, f1_mps2=1e-6 for one. Repeat it for
        several.

    Returns
    -------
    Compared
        The verdict and the differences by column.

    Raises
    ------
    InputError
        for anything but a run or record, or two without common times or columns

    Examples
    --------
    >>> import trihedron as th
    >>> run = th.simulate("scenarios/table-attitude.toml")
    >>> th.compare(run, run).verdict
    'same'
    """
    from .comparison import compare as held

    return held(first, second, within)


def plot(run: Any, page: str | Path) -> Path:
    """Draw the columns of a run or a record over time on a page.

    Parameters
    ----------
    run : path, table in memory, record or Simulation
        The folder of a run, the file of a run or a record (CSV, Parquet), or either in memory.
    page : path
        .html, or .pdf

    Returns
    -------
    Path
        The page.

    Raises
    ------
    InputError
        for anything but a run or record, or a page that cannot be written
    """
    from .comparison import table_of_run

    name, table = table_of_run(run)
    reports.write_plot(Path(page), Path(name).name, f"{table.height} rows.", table)
    return Path(page)


def doctor() -> "Installation":
    """Check the installation: libraries, platforms for exported FMUs, and a test run.

    Returns
    -------
    Installation
        The verdict and the findings.
    """
    from .installation import doctor as look

    return look()
