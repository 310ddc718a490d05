"""Text, pages and files of campaigns and suites of hidden effects."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.targets import NAMES
from ..campaign.file import Campaign
from ..campaign.store import PAGE, Store, open_result
from ..campaign.summary import CHANCE, CampaignResult, Comparison, Results, ScalarChange, rate, summarise
from ..document.blocks import Page, Section, Table, Tone, table_of
from ..document.notation import Cell, minus, unit_text
from ..document.page import write_page
from ..files import write_text
from ..rounding import digits, exactly, interval, upwards
from ..trials.outcome import KINDS, NOTHING
from ..trials.suite import Suite, cases_csv, confusion, named_suite
from .bench import physical_words
from .lines import spread_over_time
from .pictures import suites
from .sources import versions

MOST_ROWS = 24
"""Largest number of rows of a table on a terminal; the page has all."""
CHANGED = ("verdict", "name", "what", "before", "after", "p", "runs")
"""Columns of the changes between two campaigns, the worst first."""
RANK = {"worse": 0, "better": 1, "changed": 2, "same": 3}


def result_page(result: CampaignResult) -> Page:
    """Return the results over all runs and their cost, as a terminal shows them."""
    answer = []
    for section in _failures(result) + _computed(result):
        table = section.table
        if table is not None and len(table.rows) > MOST_ROWS:
            note = f"The first {MOST_ROWS} of {len(table.rows)} rows:"
            section = Section(section.title, [note], table=Table(table.header, table.rows[:MOST_ROWS]))
        answer.append(section)
    if result.cost is not None:
        answer.append(Section("Cost", [str(result.cost)]))
    return Page("Campaign", f"{result.runs} runs, {result.failed} failed", answer)


def _failures(result: CampaignResult) -> list[Section]:
    """Return the messages of failed runs; empty if there are none."""
    if not result.failures:
        return []
    return [Section("Runs that failed", table=table_of(result.failures, ("runs", "first_run", "message")))]


def _computed(result: CampaignResult, results: Results | None = None) -> list[Section]:
    """Return a section for each table of a campaign's computations; with pictures if its runs are given."""
    sections: list[Section] = []
    for item in result.computed:
        outcome = item["result"]
        if "quantiles" in item:
            sections.append(_quantiles(item, results))
        elif "rate" in item and "against" not in item:
            title = f"How often {item['rate']} is {values_text(item)}"
            sections.append(Section(title, [f"{title}: {rate_text(outcome[0])}."]))
        elif "rate" in item:
            sections.append(_rates(item, results))
        elif "confusion" in item:
            sections.append(_confusion(item, results))
        else:
            sections += [_sensitivity(name, entry, results) for name, entry in outcome.items()]
    return sections


def _quantiles(item: Mapping[str, Any], results: Results | None) -> Section:
    """Return the distribution of each scalar: mean, quantiles, largest value."""
    header = ["scalar", "meaning", "unit", "runs", "mean"]
    rows = []
    columns, marks = {}, {}
    for name, entry in item["result"].items():
        if not entry["runs"]:
            continue
        if not rows:
            for quantile in entry["quantiles"]:
                header.append(f"{exactly(round(100.0 * quantile['at'], 9))} %")
            header.append("largest")
        meaning, unit = scalar_words(name)
        marks[meaning, unit] = [quantile["value"] for quantile in entry["quantiles"]]
        row: list[Cell] = [name, meaning, unit, entry["runs"], digits(entry["mean"], 4)]
        for value in marks[meaning, unit]:
            row.append(digits(value, 4))
        row.append(upwards(entry["largest"], 4))
        rows.append(row)
        if results is not None:
            columns[meaning, unit] = np.asarray(results.numbers(name))
    table = Table(header, rows)
    names = list(item["result"])
    title = "Distributions" if len(names) > 1 else f"Distribution of {names[0]}"
    if not columns:
        return Section(title, table=table)
    picture = suites.distributions_picture(columns, marks)
    return Section(title, [], picture, "Runs over values; dashed lines are the quantiles.", table)


def _rates(item: Mapping[str, Any], results: Results | None) -> Section:
    """Return a rate over ranges of a scalar, with its intervals."""
    rows = []
    for entry in item["result"]:
        if entry["cases"]:
            rows.append([digits(entry["low"], 6), digits(entry["high"], 6), rate_text(entry)])
    table = Table(["from", "to", "rate"], rows)
    title = f"{item['rate']} is {values_text(item)}, by {item['against']}"
    if results is None:
        return Section(title, table=table)
    curve = {f"{item['rate']}: {values_text(item)}": item["result"]}
    picture = suites.rates_picture(curve, item["against"])
    return Section(title, [], picture, "Lines are intervals of 95 % (Wilson).", table)


def _confusion(item: Mapping[str, Any], results: Results | None) -> Section:
    """Return the outcomes of each true value, the most frequent first."""
    rows = []
    for true, counts in item["result"].items():
        ordered = sorted(counts.items(), key=lambda pair: -pair[1])
        rows.append([true, ", ".join([f"{name} {count}" for name, count in ordered])])
    table = Table(["true", "taken for"], rows)
    title = f"{item['of']}, and what {item['confusion']} was"
    if results is None:
        return Section(title, table=table)
    return Section(title, [], suites.confusion_picture(item["result"]), f"Rows: {item['of']}.", table)


def _sensitivity(name: str, entry: Mapping[str, Any], results: Results | None) -> Section:
    """Return the Sobol indices or the rank correlation of each parameter, the largest first."""
    sobol = entry["method"] == "sobol"
    key = "total" if sobol else "correlation"
    ordered = sorted(entry["parameters"].items(), key=lambda pair: -abs(pair[1][key] or 0.0))
    rows = []
    for parameter, numbers in ordered:
        if numbers[key] is None:
            rows.append([parameter, "no value", None])
        elif sobol:
            rows.append([parameter, _index_text(numbers, "first"), _index_text(numbers, "total")])
        else:
            rows.append([parameter, digits(numbers["correlation"]), digits(numbers["p"], 2)])
    table = Table(["parameter", "first order", "total"] if sobol else ["parameter", "correlation", "p"], rows)
    title = f"Dependence of {name}"
    if results is None:
        return Section(title, table=table)
    runs = int(np.isfinite(results.numbers(name)).sum())
    return Section(title, [], suites.sensitivity_picture(name, entry, runs), _method(entry, runs), table)


def _method(entry: Mapping[str, Any], runs: int) -> str:
    if entry["method"] == "sobol":
        without = f" {entry['rows_with_failures']} had a run that failed." if entry["rows_with_failures"] else ""
        indices = f"First-order and total Sobol indices from {entry['rows']} rows"
        return f"{indices}, with bootstrapped intervals of 95 %.{without}"
    return (
        f"Spearman's rank correlation with each parameter. With no connection 95 % of the correlations of {runs} runs "
        f"lie in the band, ±{upwards(suites.chance_of(runs))}."
    )


def _index_text(numbers: Mapping[str, Any], index: str) -> str:
    least, most = numbers[f"{index}_interval"]
    value, low, high = interval(numbers[index], least, most)
    return f"{value} [{low}, {high}]"


def values_text(item: Mapping[str, Any]) -> str:
    """Return the values that a rate counts, in words."""
    return " or ".join(str(v).lower() if isinstance(v, bool) else str(v) for v in item["is"])


def rate_text(entry: Mapping[str, Any]) -> str:
    """Return a rate with its interval."""
    if not entry["cases"]:
        return "no cases"
    least, most = entry["interval"]
    percent, low, high = interval(100.0 * entry["rate"], 100.0 * least, 100.0 * most)
    return f"{entry['count']} of {entry['cases']} ({percent} %, 95 % from {low} % to {high} %)"


def comparison_page(comparison: Comparison) -> Page:
    """Return the better and the worse scalars."""
    counts = [f"{len(comparison.of(kind))} {kind}" for kind in ("worse", "better", "changed", "same")]
    how = "runs of the same number are pairs" if comparison.paired else "two samples of runs"
    changed = [change for change in comparison.changes if change.verdict != "same"]
    answer = [Section("Changes", table=_change_table(changed))]
    verdict = f"{len(comparison.changes)} scalars compared ({how}): {', '.join(counts)}"
    return Page("Two campaigns", verdict, answer)


def _change_table(changes: Sequence[ScalarChange]) -> Table:
    ordered = sorted(changes, key=lambda change: (RANK[change.verdict], 1.0 if change.p is None else change.p))
    return table_of(ordered, CHANGED)


WHAT = {
    "calibration": "static calibrations",
    "attitude": "attitude runs",
    "simulation": "simulations of a scenario",
    "hidden": "cases of hidden effects",
}
MOST_VALUES = 12
"""Largest number of values of a list that are shown."""
SALTELLI = "Saltelli et al., Computer Physics Communications 181 (2010), 259–270: Sobol indices"


def write_campaign_page(folder: Path, path: Path | None = None, comparison: Comparison | None = None) -> Path:
    """Write the page of the campaign in a folder; return its file, <folder>/index.html by default."""
    store, manifest = open_result(folder)
    page = folder / PAGE if path is None else path
    write_page(page, campaign_page(store, manifest, comparison))
    return page


def campaign_page(store: Store, manifest: Mapping[str, Any], comparison: Comparison | None = None) -> Page:
    """Return the page of a complete campaign, as `trihedron.tools.campaign.store.open_result` gives it."""
    campaign, results = store.campaign, Results(store)
    summary = summarise(store)
    sections = _changes(comparison)
    sections.append(_about(campaign))
    sections += _computed(summary, results)
    if (records := results.records()) is not None:
        sections += spread_over_time(records[0], f"Records of {records[1]} runs: quantiles over the runs at each time.")
    sections += _failures(summary)
    verdict = [f"{campaign.runs} {WHAT[campaign.kind]}, {summary.failed or 'none'} failed."]
    verdict += counted(summary)
    tone: Tone = "attention" if summary.failed else "neutral"
    if comparison is not None:
        got = [f"{len(comparison.of(word))} {word}" for word in ("worse", "better") if comparison.of(word)]
        verdict.append(f"Beyond chance got {', '.join(got) or 'nothing better or worse'}.")
        tone = "attention" if summary.failed or comparison.worse else "good"
    sobol = campaign.sampling.method == "saltelli" and any(item.sensitivity for item in campaign.compute)
    return Page(
        campaign.title or f"Campaign of {WHAT[campaign.kind]}",
        " ".join(verdict),
        [],
        lambda: sections,
        tone=tone,
        provenance={
            "campaign, SHA-256": manifest["order_sha256"],
            "code, SHA-256": manifest["code_sha256"],
            "seed": campaign.seed,
            **versions(),
        },
        sources=[SALTELLI] if sobol else [],
        zoom=records is not None,
    )


def counted(summary: CampaignResult) -> list[str]:
    """Return the rates of the whole campaign, each as a sentence."""
    sentences = []
    for item in summary.computed:
        if "rate" not in item or "against" in item or not item["result"]:
            continue
        entry = item["result"][0]
        if entry["cases"]:
            count = entry["count"] or "none"
            sentences.append(f"{item['rate'].capitalize()} was {values_text(item)} in {count} of {entry['cases']}.")
    return sentences


def _changes(comparison: Comparison | None) -> list[Section]:
    """Return every change against another campaign; empty without one."""
    if comparison is None:
        return []
    pairs = "Runs of the same number are held against each other: " if comparison.paired else "Two samples of runs: "
    test = "Wilcoxon's and McNemar's tests." if comparison.paired else "the tests of Mann and Whitney, and of Fisher."
    corrected = f"p is corrected for the number of scalars (Holm); beyond chance is p ≤ {exactly(CHANCE)}."
    text = f"{pairs}{test} {corrected}"
    return [Section("Against the other campaign", [text], table=_change_table(comparison.changes))]


def _about(campaign: Campaign) -> Section:
    how = {
        "random": "drawn at random",
        "latin-hypercube": "drawn from a Latin hypercube",
        "sobol": "a Sobol sequence",
        "saltelli": "Saltelli's arrangement of a Sobol sequence",
    }[campaign.sampling.method]
    paragraphs = [f"{campaign.runs} {WHAT[campaign.kind]}; the seed of the campaign is {campaign.seed}."]
    if campaign.hidden is not None and campaign.hidden.suite is not None:
        suite = campaign.hidden.suite
        paragraphs = [f"The first {campaign.runs} cases of the suite {suite}, seed {named_suite(suite).seed}."]
    if campaign.distributions:
        paragraphs.append(f"{campaign.samples} points, {how}.")
    if campaign.repeats > 1 and campaign.hidden is None:
        paragraphs.append(f"Each is run {campaign.repeats} times with other random errors.")
    rows = []
    for name, axis in campaign.parameters.items():
        ((form, value),) = axis.model_dump(exclude_none=True).items()
        values = ", ".join(exactly(v) if isinstance(v, float) else str(v) for v in value[:MOST_VALUES])
        rows.append([name, form.replace("_", " "), minus(values) + (", ..." if len(value) > MOST_VALUES else "")])
    table = Table(["parameter", "distribution", "of"], rows)
    return Section("Runs", [" ".join(paragraphs)], table=table)


OF_TARGETS = {
    "error": "error of {}",
    "bound": "bound of the error of {}",
    "guaranteed": "guaranteed error of {}",
    "width": "width of the interval of {}",
}
SAID = {
    "misses": "true values outside their intervals",
    "radius": "least largest residual, over its bound",
    "worst_error_ratio": "largest error of an estimate, over its bound",
}
SUFFIXES = {"rad": "rad", "radps": "rad/s", "mps2": "m/s²", "deg": "deg", "g": "g", "h": "h", "s": "s", "degC": "°C"}


def scalar_words(name: str) -> tuple[str, str]:
    """Return a scalar or a parameter of a campaign in words, and its unit if the name has one."""
    symbol, _, what = name.rpartition("_")
    if symbol in NAMES and what in OF_TARGETS:
        target_name, unit = NAMES[symbol]
        return OF_TARGETS[what].format(physical_words(target_name)), unit_text(unit)
    unit = SUFFIXES.get(what, "")
    return SAID.get(name, (symbol if unit else name).replace("_", " ")), unit


# Suites

MOST_LISTED = 20
SHOWN = {
    "clean": "clean records, nothing hidden",
    "single": "one effect hidden, at 1.5 times the size from which every rival is surely excluded",
    "between": "one effect hidden, larger than what is surely detected, smaller than what surely excludes every rival",
    "pairs": "two effects hidden, each at 1.5 times the size at which nothing can stand for it",
}
"""Hidden effects of each mode, in words."""
WHOSE = "an effect of all records and one of a record alone"
CAPTION = (
    "Rows: the hidden effect. Columns: the diagnosis. Blue: right. Grey: open, with the truth among the candidates."
)


def write_suite(suite: Suite, folder: Path) -> list[Path]:
    """Write suite.json, cases.csv and the page index.html into a folder; return the files."""
    files = [folder / "suite.json", folder / "cases.csv", folder / "index.html"]
    write_text(files[0], json.dumps(suite.to_json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(files[1], cases_csv(suite))
    write_page(files[2], suite_page(suite))
    return files


def suite_page(suite: Suite) -> Page:
    """Return the results of a suite: counts, confusion, errors of sizes, cases named wrongly."""
    bench = not suite.strapdown
    provenance = {"trihedron": versions()["trihedron"], "seed": suite.seed}
    if bench:
        provenance["mode"] = suite.mode
    answer = [_counts_section(suite)]
    answer += _confusion_sections(suite)
    answer += _size_sections(suite)
    answer.append(_failure_section(suite))
    return Page(
        f"Hidden effects: {suite.mode}" if bench else "Hidden effects in strapdown records",
        f"{_what_was_drawn(suite)}, seed {suite.seed}: {_outcome_counts(suite)}",
        answer,
        lambda: [_about_section(suite), _all_failures(suite)],
        tone="attention" if "wrong" in suite.outcomes else "good",
        provenance=provenance,
    )


def _what_was_drawn(suite: Suite) -> str:
    if suite.strapdown:
        return f"{suite.cases} strapdown records"
    of_each = "" if suite.records is None else f" of {suite.records} records"
    return f"{suite.cases} cases{of_each} ({suite.mode})"


def _outcome_counts(suite: Suite) -> str:
    counts = [f"{kind} {count}" for kind, count in suite.outcomes.items()]
    return ", ".join(counts)


def _counts_section(suite: Suite) -> Section:
    """Return rejected effects, false alarms, and errors of the estimated sizes."""
    lines = []
    alarms = suite.false_alarms
    if alarms["clean"]:
        lines.append(f"False alarms on clean records: {alarms['alarms']} of {alarms['clean']}.")
    errors: Any = suite.size_errors
    if errors["estimates"]:
        figures = [f"rms error {digits(100.0 * errors['rms'])} %", f"largest {upwards(100.0 * errors['largest'], 3)} %"]
        if not suite.strapdown:
            figures.insert(0, f"mean error {digits(100.0 * errors['mean'])} %")
        inside = f"{errors['inside_intervals']} of {errors['cases_with_intervals']}"
        lines.append(f"Estimated sizes: {', '.join(figures)}. Inside their intervals: {inside}.")
    return Section("Verdicts on the records", lines)


def _confusion_sections(suite: Suite) -> list[Section]:
    """Return the outcomes of each hidden effect, as a table and a picture; empty if nothing was hidden."""
    if suite.false_alarms["clean"] >= suite.cases:
        return []
    counts = confusion(suite.results)
    rows = []
    for name, row in counts.items():
        words = []
        for outcome, count in row.most_common():
            words.append(f"{'right' if outcome == name else outcome} {count}")
        rows.append([name, sum(row.values()), ", ".join(words)])
    table = Table(["hidden", "cases", "diagnosis"], rows)
    return [Section("Verdicts by effect", [], suites.confusion_picture(counts), CAPTION, table)]


def _size_sections(suite: Suite) -> list[Section]:
    """Return the sizes from which effects are seen, and errors of the estimated sizes; only for positions."""
    if suite.strapdown:
        return []
    sections = []
    if suite.detection:
        sections.append(_detection_section(suite))
    sizes, errors = [], []
    for outcome in suite.results:
        if len(outcome.errors) == len(outcome.secrets):
            for secret, error in zip(outcome.secrets, outcome.errors, strict=True):
                sizes.append(secret.relative_size)
                errors.append(error)
    if sizes:
        counts: Any = suite.size_errors
        sections.append(
            Section(
                "Errors of the sizes",
                f"In {counts['inside_intervals']} of {counts['cases_with_intervals']} cases that are named rightly, "
                "the true parameters are inside their intervals.",
                suites.size_errors_picture(sizes, errors),
                "Relative error of each estimated size; the band is the mean with twice its standard error.",
            )
        )
    return sections


def _detection_section(suite: Suite) -> Section:
    """Return how often effects are detected and named, over their size."""
    falsified, named_rightly = [], []
    rows = []
    for bin_ in suite.detection:
        high = bin_.low * 1.19**2 if bin_.high is None else bin_.high
        ends = {"low": max(bin_.low, 0.18), "high": high}
        falsified.append({**ends, **rate(np.arange(bin_.cases) < bin_.detected)})
        named_rightly.append({**ends, **rate(np.arange(bin_.cases) < bin_.named)})
        last = digits(math.inf if bin_.high is None else bin_.high)
        detected, named = digits(100.0 * bin_.detected / bin_.cases), digits(100.0 * bin_.named / bin_.cases)
        rows.append([digits(bin_.low), last, bin_.cases, detected, named])
    curves = {"falsified": falsified, "named rightly": named_rightly}
    return Section(
        "Detection by size",
        ["Sizes are relative to that from which an effect is surely detected at its positions."],
        suites.rates_picture(curves, "size over that of sure detection", "cases", "surely detected from here"),
        "How often an effect is detected and named, over its size.",
        Table(["size from", "to", "cases", "falsified [%]", "named [%]"], rows),
    )


def _failure_section(suite: Suite) -> Section:
    """Return the first cases that were named wrongly or in part."""
    lines = []
    for outcome in suite.results:
        if outcome.outcome not in (KINDS[2:] if suite.strapdown else ("part", "wrong")):
            continue
        hidden = outcome.titles(named=False, between=" and ") or NOTHING
        where = f" ({outcome.reference})" if suite.strapdown else ""
        names = outcome.titles(named=True, between=" and ")
        verdict = f"{outcome.verdict}: {names}" if names or not suite.strapdown else outcome.verdict
        lines.append(f"case {outcome.case}: hidden {hidden}{where}; {verdict}")
    return Section("Wrong or in part", lines[:MOST_LISTED])


def _all_failures(suite: Suite) -> Section:
    """Return every case that was not named rightly, with the text of its diagnosis."""
    rows: list[list[Any]] = []
    for outcome in suite.results:
        if outcome.outcome != "right":
            row = [outcome.case, outcome.positions, outcome.reference, outcome.titles(named=False) or NOTHING]
            row += [outcome.verdict, outcome.outcome, outcome.titles(named=True), outcome.why]
            rows.append(row)
    header = ["case", "positions", "reference", "hidden", "verdict", "outcome", "named", "diagnosis"]
    return Section("Cases that were not named rightly", table=Table(header, rows))


def _about_section(suite: Suite) -> Section:
    """Return a description of the records of a suite."""
    about = _about_block(suite) if suite.strapdown else _about_bench(suite)
    return Section("How the records were made", about)


def _about_bench(suite: Suite) -> list[str]:
    what = SHOWN[suite.mode] if suite.size is None else "effects of drawn sizes"
    if suite.records is not None:
        what = f"{suite.records} records of one instrument each, " + what.replace("two effects", WHOSE)
    fewest, most = suite.positions
    return [
        f"{suite.cases} cases: {what}; {fewest} to {most} positions in random order, noise {suite.noise}.",
        "The bench runs in time, with its slews, dwells and temperature; the diagnosis gets the record, σ and the "
        "mountings, and nothing else.",
        f"Effects drawn again, since no possible size would show at their positions: {suite.redrawn}.",
    ]


def _about_block(suite: Suite) -> list[str]:
    sizes = "Nothing is hidden."
    if suite.size is not None and any(outcome.places for outcome in suite.results):
        least, greatest = suite.size
        sizes = (
            f"Effects are {exactly(least)} to {exactly(greatest)} times the size from which a record surely disproves "
            "the model."
        )
    return [
        "A block is moved by hand from rest to rest; gyro and accelerometer block read, with white and flicker noise. "
        "Every second record has the true attitude, the others have gravity at their rests alone. The diagnosis gets "
        "the record and nothing else.",
        sizes,
    ]
