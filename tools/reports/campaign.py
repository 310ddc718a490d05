"""What campaigns and suites of hidden effects say: text, pages and files."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.targets import NAMES
from ..campaign.file import Campaign
from ..campaign.store import PAGE, Store, open_result
from ..campaign.summary import CHANCE, CampaignResult, Comparison, Results, rate, summarise
from ..document.blocks import Page, Section, Table
from ..document.notation import Cell, minus, unit_text
from ..document.page import write_page
from ..files import write_text
from ..rounding import digits, exactly, interval, upwards
from ..trials.outcome import KINDS, NOTHING
from ..trials.suite import Suite, cases_csv, confusion, named_suite
from .bench import physical_words
from .lines import spread_over_time
from .makers import versions
from .pictures import suites

MOST_ROWS = 24
"""Lines of one table on a terminal; the page has all."""


def campaign_lines(result: CampaignResult) -> list[str]:
    """What was computed over all runs, and what it took."""
    lines = [f"{result.runs} runs, {result.failed} failed"]
    lines += [
        f"  failed {entry.runs} times, first run {entry.first_run}: {entry.message}" for entry in result.failures[:5]
    ]
    for item in result.computed:
        lines += ["", *_computed_lines(item)]
    return lines if result.cost is None else [*lines, "", str(result.cost)]


def _computed_lines(item: Mapping[str, Any]) -> list[str]:
    result = item["result"]
    if "quantiles" in item:
        return _cut(_quantile_lines(result))
    if "rate" in item:
        head = f"{item['rate']} is {told_values(item)}"
        if "against" not in item:
            return [f"{head}: {rate_text(result[0])}"]
        rows = [f"  {exactly(r['low']):>10} to {exactly(r['high']):>10}  {rate_text(r)}" for r in result if r["cases"]]
        return _cut([f"{head}, by {item['against']}:", *rows])
    if "confusion" in item:
        told = {true: sorted(row.items(), key=lambda pair: -pair[1]) for true, row in result.items()}
        rows = [f"  {true:<44} {', '.join(f'{n} {count}' for n, count in row)}" for true, row in told.items()]
        return _cut([f"{item['of']}, and what {item['confusion']} was:", *rows])
    return [line for name, found in result.items() for line in _sensitivity(name, found)]


def _quantile_lines(result: Mapping[str, Any]) -> list[str]:
    at = next((entry["quantiles"] for entry in result.values() if entry["runs"]), [])
    lines = [f"{'':<24} {'mean':>11} " + " ".join(f"{exactly(q['at']):>10}q" for q in at)]
    for name, entry in result.items():
        values = (entry["mean"], *(q["value"] for q in entry["quantiles"])) if entry["runs"] else ()
        lines.append(f"{name:<24} {' '.join(f'{digits(value, 4):>11}' for value in values) or 'no values'}")
    return lines


def _sensitivity(name: str, found: Mapping[str, Any]) -> list[str]:
    sobol = found["method"] == "sobol"
    key = "total" if sobol else "correlation"
    rows = sorted(found["parameters"].items(), key=lambda pair: -abs(pair[1][key] or 0.0))
    head = "Sobol indices, first order and total" if sobol else "rank correlations"
    lines = [f"{name}: {head}"]
    for parameter, entry in rows:
        if entry[key] is None:
            told = "no value"
        elif sobol:
            parts = []
            for index in ("first", "total"):
                value, low, high = interval(entry[index], *entry[f"{index}_interval"])
                parts.append(f"{value:>7} [{low}, {high}]")
            told = "  ".join(parts)
        else:
            told = f"{digits(entry['correlation'])}  (p {digits(entry['p'], 2)})"
        lines.append(f"  {parameter:<28} {told}")
    return _cut(lines)


def told_values(item: Mapping[str, Any]) -> str:
    """The values that a rate counts, in words."""
    return " or ".join(str(v).lower() if isinstance(v, bool) else str(v) for v in item["is"])


def rate_text(entry: Mapping[str, Any]) -> str:
    """A rate with its interval."""
    if not entry["cases"]:
        return "no cases"
    percent, low, high = interval(100.0 * entry["rate"], *(100.0 * end for end in entry["interval"]))
    return f"{entry['count']} of {entry['cases']} ({percent} %, 95 % from {low} % to {high} %)"


def _cut(lines: list[str]) -> list[str]:
    more = len(lines) - MOST_ROWS
    return lines if more <= 0 else [*lines[:MOST_ROWS], f"  ... and {more} more"]


def change_lines(comparison: Comparison) -> list[str]:
    """What got better or worse."""
    told = [change for change in comparison.changes if change.verdict != "same"]
    counts = ", ".join(f"{len(comparison.of(kind))} {kind}" for kind in ("worse", "better", "changed", "same"))
    how = "runs of the same number are pairs" if comparison.paired else "two samples of runs"
    lines = [f"{len(comparison.changes)} scalars compared ({how}): {counts}"]
    for change in sorted(told, key=lambda c: (c.verdict != "worse", c.verdict, c.name)):
        before, after = ("no value" if value is None else digits(value, 6) for value in (change.before, change.after))
        lines.append(
            f"  {change.verdict:<8} {change.name:<28} {change.what}: {before} -> {after}  (p {digits(change.p, 2)})"
        )
    return lines


WHAT = {
    "calibration": "static calibrations",
    "attitude": "attitude runs",
    "simulation": "simulations of a scenario",
    "hidden": "cases of hidden effects",
}
MOST_VALUES = 12
"""Of a list of values that are shown."""
LISTED = 200
"""Rows of one table on the page."""
SALTELLI = "Saltelli et al., Computer Physics Communications 181 (2010), 259–270: Sobol indices"


def write_campaign_page(folder: Path, path: Path | None = None, comparison: Comparison | None = None) -> Path:
    """Write the page of the campaign that a folder holds; returns its file, <folder>/index.html by default."""
    store, manifest = open_result(folder)
    page = folder / PAGE if path is None else path
    write_page(page, campaign_page(store, manifest, comparison))
    return page


def campaign_page(store: Store, manifest: Mapping[str, Any], comparison: Comparison | None = None) -> Page:
    """The page of a campaign that is complete, as `trihedron.tools.campaign.store.open_result` gives it."""
    campaign, results = store.campaign, Results(store)
    summary = summarise(store)
    sections = [] if comparison is None else [_changes(comparison)]
    sections += [_about(campaign), *_computed(summary.computed, results)]
    if (kept := results.records()) is not None:
        sections += spread_over_time(kept[0], f"Records of {kept[1]} runs: quantiles over the runs at each time.")
    if summary.failures:
        rows = [[entry.runs, entry.first_run, entry.message] for entry in summary.failures]
        sections.append(Section("Runs that failed", table=Table(["runs", "first run", "message"], rows)))
    verdict = [f"{campaign.runs} {WHAT[campaign.kind]}, {summary.failed or 'none'} failed.", *counted(summary)]
    worse = False
    if comparison is not None:
        changed = {word: len(comparison.of(word)) for word in ("worse", "better")}
        worse, said = changed["worse"] > 0, ", ".join(f"{count} {word}" for word, count in changed.items() if count)
        verdict.append(f"Beyond chance got {said}." if said else "Nothing got better or worse beyond chance.")
    sobol = campaign.sampling.method == "saltelli" and any(item.sensitivity for item in campaign.compute)
    return Page(
        campaign.title or f"Campaign of {WHAT[campaign.kind]}",
        " ".join(verdict),
        sections,
        tone="attention" if summary.failed or worse else "good" if comparison is not None else "neutral",
        provenance={
            "campaign, SHA-256": manifest["order_sha256"],
            "code, SHA-256": manifest["code_sha256"],
            "seed": campaign.seed,
            **versions(),
        },
        sources=[SALTELLI] if sobol else [],
        zoom=kept is not None,
    )


def counted(summary: CampaignResult) -> list[str]:
    """The rates of the whole campaign, each as a sentence."""
    return [
        f"{item['rate'].capitalize()} was {told_values(item)} in {entry['count'] or 'none'} of {entry['cases']}."
        for item in summary.computed
        if "rate" in item and "against" not in item
        for entry in item["result"][:1]
        if entry["cases"]
    ]


def _changes(comparison: Comparison) -> Section:
    order = {"worse": 0, "better": 1, "changed": 2, "same": 3}
    changes = sorted(comparison.changes, key=lambda c: (order[c.verdict], 1.0 if c.p is None else c.p))
    rows = [
        [c.name, c.verdict, c.what, digits(c.before, 6), digits(c.after, 6), digits(c.p, 2), c.runs]
        for c in changes[:LISTED]
    ]
    pairs = "Runs of the same number are held against each other: " if comparison.paired else "Two samples of runs: "
    test = "Wilcoxon's and McNemar's tests." if comparison.paired else "the tests of Mann and Whitney, and of Fisher."
    return Section(
        "Against the other campaign",
        [f"{pairs}{test} p is corrected for the number of scalars (Holm); beyond chance is p ≤ {exactly(CHANCE)}."],
        table=Table(["scalar", "verdict", "what", "before", "after", "p", "runs"], rows),
    )


def _about(campaign: Campaign) -> Section:
    how = {
        "random": "drawn at random",
        "latin-hypercube": "drawn from a Latin hypercube",
        "sobol": "a Sobol sequence",
        "saltelli": "Saltelli's arrangement of a Sobol sequence",
    }[campaign.sampling.method]
    said = [f"{campaign.runs} {WHAT[campaign.kind]}; the seed of the campaign is {campaign.seed}."]
    if campaign.hidden is not None and campaign.hidden.suite is not None:
        suite = campaign.hidden.suite
        said = [f"The first {campaign.runs} cases of the suite {suite}, seed {named_suite(suite).seed}."]
    if campaign.distributions:
        said.append(f"{campaign.samples} points, {how}.")
    if campaign.repeats > 1 and campaign.hidden is None:
        said.append(f"Each is run {campaign.repeats} times with other random errors.")
    rows: list[list[str]] = []
    for name, axis in campaign.parameters.items():
        ((form, value),) = axis.model_dump(exclude_none=True).items()
        shown = ", ".join(exactly(v) if isinstance(v, float) else str(v) for v in value[:MOST_VALUES])
        rows.append([name, form.replace("_", " "), minus(shown) + (", ..." if len(value) > MOST_VALUES else "")])
    table = Table(["parameter", "distribution", "of"], rows) if rows else None
    return Section("What was run", [" ".join(said)], table=table)


def _computed(items: Sequence[Mapping[str, Any]], results: Results) -> list[Section]:
    sections: list[Section] = []
    curves: dict[str, dict[str, Any]] = {}
    for item in items:
        found = item["result"]
        if "quantiles" in item:
            sections.append(_quantiles(item, results))
        elif "against" in item:
            label = f"{item['rate']}: {told_values(item)}"
            curves.setdefault(item["against"], {})[label] = found
        elif "rate" in item:
            title = f"How often {item['rate']} is {told_values(item)}"
            sections.append(Section(title, [rate_text(found[0]) + "."]))
        elif "confusion" in item:
            title = f"{item['of']}, and what {item['confusion']} was"
            sections.append(Section(title, svg=suites.confusion_picture(found), caption=f"Rows: {item['of']}."))
        else:
            sections += [
                Section(
                    f"What {name} depends on",
                    svg=suites.sensitivity_picture(name, entry, runs),
                    caption=_method(entry, runs),
                )
                for name, entry in found.items()
                for runs in [int(np.isfinite(results.numbers(name)).sum())]
            ]
    return [*(_rates(against, found) for against, found in curves.items()), *sections]


def _method(entry: Mapping[str, Any], runs: int) -> str:
    if entry["method"] == "sobol":
        without = f" {entry['rows_with_failures']} had a run that failed." if entry["rows_with_failures"] else ""
        indices = f"First-order and total Sobol indices from {entry['rows']} rows"
        return f"{indices}, with bootstrapped intervals of 95 %.{without}"
    return (
        f"Spearman's rank correlation with each parameter. With no connection 95 % of the correlations of {runs} runs "
        f"lie in the band, ±{upwards(suites.chance_of(runs))}."
    )


def _rates(against: str, curves: Mapping[str, Sequence[Mapping[str, Any]]]) -> Section:
    first = next(iter(curves.values()))
    header = ["from", "to", "runs", *curves]
    rows: list[list[Cell]] = []
    for k, entry in enumerate(first):
        found = [ranges[k] for ranges in curves.values()]
        if any(of["cases"] for of in found):
            ends = (digits(entry[end], 6) for end in ("low", "high"))
            rows.append([*ends, entry["cases"], *(str(of["count"]) for of in found)])
    return Section(
        f"Rates against {against}",
        svg=suites.rates_picture(curves, against),
        caption="Lines are intervals of 95 % (Wilson).",
        table=Table(header, rows),
    )


def _quantiles(item: Mapping[str, Any], results: Results) -> Section:
    found = item["result"]
    there = {name: entry for name, entry in found.items() if entry["runs"]}
    at = next((entry["quantiles"] for entry in there.values()), [])
    header = [
        "scalar",
        "meaning",
        "unit",
        "runs",
        "mean",
        *(f"{exactly(round(100.0 * q['at'], 9))} %" for q in at),
        "largest",
    ]
    rows: list[list[Cell]] = []
    for name, entry in there.items():
        figures = (entry["mean"], *(q["value"] for q in entry["quantiles"]))
        numbers = [*(digits(figure, 4) for figure in figures), upwards(entry["largest"], 4)]
        rows.append([name, *scalar_words(name), entry["runs"], *numbers])
    columns = {scalar_words(name): np.asarray(results.numbers(name)) for name in there}
    marks = {scalar_words(name): [q["value"] for q in entry["quantiles"]] for name, entry in there.items()}
    title = "Distributions" if len(found) > 1 else f"Distribution of {next(iter(found))}"
    svg = suites.distributions_picture(columns, marks)
    return Section(
        title, svg=svg, caption="Runs over values; dashed lines are the quantiles.", table=Table(header, rows).told()
    )


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
    """A scalar or a parameter of a campaign in words, and its unit where the name tells it."""
    symbol, _, what = name.rpartition("_")
    if symbol in NAMES and what in OF_TARGETS:
        known, unit = NAMES[symbol]
        return OF_TARGETS[what].format(physical_words(known)), unit_text(unit)
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
"""What each mode hides, in words."""
WHOSE = "an effect of all records and one of a record alone"
CAPTION = (
    "Rows: what was hidden. Columns: what was made of it. Blue is right, grey left open with the truth among the "
    "candidates."
)


def write_suite(suite: Suite, folder: Path) -> list[Path]:
    """Write suite.json, cases.csv and the page index.html into a folder; returns the files."""
    files = [folder / "suite.json", folder / "cases.csv", folder / "index.html"]
    write_text(files[0], json.dumps(suite.to_json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(files[1], cases_csv(suite))
    write_page(files[2], suite_page(suite))
    return files


def suite_lines(suite: Suite) -> list[str]:
    """What a person is told."""
    bench = not suite.strapdown
    of_each = "" if suite.records is None else f" of {suite.records} records"
    what = f"cases{of_each} ({suite.mode})" if bench else "strapdown records"
    made = ", ".join(f"{kind} {number}" for kind, number in suite.outcomes.items())
    lines = [f"{suite.cases} {what}, seed {suite.seed}: {made}"]
    if bench and suite.redrawn:
        lines.append(f"{suite.redrawn} effects were put aside, as no possible size would do at their positions")
    alarms = suite.false_alarms
    if alarms["clean"]:
        lines.append(f"false alarms on clean records: {alarms['alarms']} of {alarms['clean']}")
    if alarms["clean"] < suite.cases:
        width = 44 if bench else 28
        lines += ["", f"{'hidden':<{width}} {'cases':>5}  what was made of it"]
        for name, row in confusion(suite.results).items():
            made = ", ".join(f"{'right' if k == name else k} {n}" for k, n in row.most_common())
            lines.append(f"{name:<{width}} {sum(row.values()):>5}  {made}")
    if bench and suite.detection:
        lines += ["", "size / sure detection   cases  falsified  named"]
        lines += [
            f"{digits(b.low):>6} to {digits(math.inf if b.high is None else b.high):>6}        {b.cases:>6}  "
            f"{digits(100.0 * b.detected / b.cases):>7} %  {digits(100.0 * b.named / b.cases):>3} %"
            for b in suite.detection
        ]
    errors: Any = suite.size_errors
    if errors["estimates"]:
        mean = f"mean error {digits(100.0 * errors['mean'])} %, rms" if bench else "rms error"
        rms, largest = digits(100.0 * errors["rms"]), upwards(100.0 * errors["largest"], 3)
        lines += [
            "",
            f"estimated sizes: {mean} {rms} %, largest {largest} %; inside their intervals "
            f"{errors['inside_intervals']} of {errors['cases_with_intervals']}",
        ]
    failures = KINDS[2:] if suite.strapdown else ("part", "wrong")
    told = [outcome for outcome in suite.results if outcome.outcome in failures]
    lines += [""] if told else []
    for outcome in told[:MOST_LISTED]:
        hidden = outcome.titles(named=False, between=" and ") or NOTHING
        named = outcome.titles(named=True, between=" and ")
        where = f" ({outcome.reference})" if suite.strapdown else ""
        made = f"{outcome.verdict}: {named}" if bench or named else outcome.verdict
        lines.append(f"case {outcome.case}: hidden {hidden}{where}; {made}")
    return lines


def suite_page(suite: Suite) -> Page:
    """The page: what was hidden, the table of confusion, errors of the sizes, every case that was not named rightly."""
    bench = not suite.strapdown
    told = ", ".join(f"{number} {kind}" for kind, number in suite.outcomes.items())
    hidden = any(outcome.places for outcome in suite.results)
    picture = suites.confusion_picture(confusion(suite.results)) if hidden else None
    about = _about_bench(suite, told) if bench else _about_block(suite, hidden=hidden)
    sections = [Section("What was made of the records", about, picture, CAPTION), *(_sizes(suite) if bench else ())]
    rows: list[list[Any]] = []
    for outcome in suite.results:
        if outcome.outcome != "right":
            of = [outcome.case, outcome.positions, outcome.reference, outcome.titles(named=False) or NOTHING]
            rows.append([*of, outcome.verdict, outcome.outcome, outcome.titles(named=True), outcome.why])
    if rows:
        header = ["case", "positions", "reference", "hidden", "verdict", "outcome", "named", "what it says"]
        sections.append(Section("Cases that were not named rightly", table=Table(header, rows).told()))
    return Page(
        f"Hidden effects: {suite.mode}" if bench else "Hidden effects in strapdown records",
        f"Of {suite.cases} {'cases' if bench else 'records'} {told}.",
        sections,
        tone="attention" if "wrong" in suite.outcomes else "good",
        provenance={"trihedron": versions()["trihedron"], "seed": suite.seed} | ({"mode": suite.mode} if bench else {}),
    )


def _about_bench(suite: Suite, told: str) -> list[str]:
    what = SHOWN[suite.mode] if suite.size is None else "effects of drawn sizes"
    if suite.records is not None:
        what = f"{suite.records} records of one instrument each, " + what.replace("two effects", WHOSE)
    fewest, most = suite.positions
    return [
        f"{suite.cases} cases: {what}; {fewest} to {most} positions in random order, noise {suite.noise}.",
        "The bench runs in time, with its slews, dwells and temperature; the diagnosis gets the record, σ and the "
        f"mountings, and nothing else. {told.capitalize()}.",
        f"{suite.redrawn} drawn effects were put aside, as no possible size would do at their positions.",
    ]


def _about_block(suite: Suite, *, hidden: bool) -> list[str]:
    sizes = "Nothing is hidden."
    if hidden and suite.size is not None:
        least, greatest = map(exactly, suite.size)
        sizes = f"Effects are {least} to {greatest} times the size from which a record surely disproves the model."
    return [
        "A block is moved by hand from rest to rest; gyro and accelerometer block read, with white and flicker noise. "
        "Every second record has the true attitude, the others have gravity at their rests alone. The diagnosis gets "
        "the record and nothing else.",
        sizes,
    ]


def _sizes(suite: Suite) -> list[Section]:
    """From which size effects are seen, and how right the estimated sizes are."""
    sections, errors = [], suite.size_errors
    if suite.detection:
        curves: dict[str, list[dict[str, Any]]] = {"falsified": [], "named rightly": []}
        for b in suite.detection:
            high = b.low * 1.19**2 if b.high is None else b.high
            for label, count in zip(curves, (b.detected, b.named), strict=True):
                counted = rate(np.arange(b.cases) < count)
                curves[label].append({"low": max(b.low, 0.18), "high": high, **counted})
        sections.append(
            Section(
                "From which size it is seen",
                [],
                suites.rates_picture(curves, "size over that of sure detection", "cases", "surely detected from here"),
                "Sizes are relative to that from which the effect is surely detected at its positions, whatever the "
                "noise within σ.",
            )
        )
    pairs = [
        (secret.relative_size, error)
        for outcome in suite.results
        if len(outcome.errors) == len(outcome.secrets)
        for secret, error in zip(outcome.secrets, outcome.errors, strict=True)
    ]
    if pairs:
        sections.append(
            Section(
                "How right the sizes are",
                f"In {errors['inside_intervals']} of {errors['cases_with_intervals']} cases named by their own "
                "name the true parameters are inside their intervals.",
                suites.size_errors_picture(*zip(*pairs, strict=True)),
                "Relative error of each estimated size; the band is the mean with twice its standard error.",
            )
        )
    return sections
