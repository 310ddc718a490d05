"""The commands that carry out campaigns of runs; thin layers over `trihedron.tools.campaign`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .errors import InputError
from .options import JsonFile, ReportFile
from .outputs import distinct_files, ordinary_folder

WORSE = 3
"""Exit status of a gate that something does not pass: neither the work failed (1) nor the input was wrong (2)."""


def campaign(
    campaign: Path,
    /,
    *,
    jobs: Annotated[
        int | None,
        Parameter(allow_leading_hyphen=True, help="Worker processes; by default as many as there are cores."),
    ] = None,
    engine: Annotated[
        Literal["local", "dask"], Parameter(help="Processes of this machine, or a Dask cluster (extra `cluster`).")
    ] = "local",
    scheduler: Annotated[
        str | None, Parameter(help="Of --engine dask: address of its scheduler; without it, a local cluster.")
    ] = None,
    resume: Annotated[bool, Parameter(help="Go on with what the folder holds already.")] = False,
    out: Annotated[
        Path | None,
        Parameter(
            validator=ordinary_folder,
            help="Folder for the results; by default <campaign>-campaign in the current folder.",
        ),
    ] = None,
    json: JsonFile = None,
) -> Answer:
    """Carry out a campaign: thousands of runs of a scenario, a calibration, an attitude algorithm or hidden effects.

    Example: trihedron campaign scenarios/campaigns/attitude-60s.toml --jobs 2 --out attitude-60s

    Parameters
    ----------
    campaign
        The campaign file (TOML).
    """
    distinct_files({"the campaign": campaign, "--json": json})
    from . import library

    done = library.run_campaign(
        campaign, out, jobs=jobs, engine=engine, scheduler=scheduler, resume=resume, progress=True
    )
    return answer([*done.lines(), *map(str, done.files)], json, done.summary)


def campaign_report(
    folder: Path,
    /,
    *,
    against: Annotated[Path | None, Parameter(help="Folder of the campaign to compare with.")] = None,
    gate: Annotated[bool, Parameter(help="End with exit status 3 where something got worse beyond chance.")] = False,
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
    report
        File of the page, <folder>/index.html by default.
    json
        File for the comparison, or without --against for the summary.
    """
    distinct_files({"--report": report, "--json": json})
    from .campaign.comparison import compare
    from .campaign.computing import summarise
    from .campaign.store import open_result
    from .campaign.texts import comparison_text, summary_text
    from .printing import write_report
    from .report.campaign_page import campaign_page

    if gate and against is None:
        raise InputError("--gate: goes with --against, the campaign to compare with")
    store, manifest = open_result(folder)
    comparison = None if against is None else compare(folder, against)
    page = folder / "index.html" if report is None else report
    summary = summarise(store)
    write_report(page, campaign_page(store, manifest, comparison))
    if comparison is None:
        return answer([summary_text(summary), str(page)], json, summary)
    worse = comparison.of("worse") if gate else ()
    complaint = f"{folder}: {len(worse)} worse than {against}, beyond chance" if worse else ""
    return answer(
        [comparison_text(comparison), str(page)], json, comparison.to_json(), complaint=complaint, status=WORSE
    )
