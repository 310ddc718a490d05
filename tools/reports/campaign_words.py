"""What a person is told of a campaign, on a terminal."""

from collections.abc import Mapping
from typing import Any

from ..campaign.compare import Comparison
from ..campaign.summary import CampaignResult

MOST_ROWS = 24
"""Lines of one table on a terminal; the page has all."""


def campaign_lines(result: CampaignResult) -> list[str]:
    """What was computed over all runs, and what it took."""
    lines = [f"{result.runs} runs, {result.failed} failed"]
    lines += [
        f"  failed {entry.runs} times, first run {entry.first_run}: {entry.message}" for entry in result.failures[:5]
    ]
    for item in result.computed:
        lines += ["", *_computed(item)]
    return lines if result.cost is None else [*lines, "", str(result.cost)]


def _computed(item: Mapping[str, Any]) -> list[str]:
    result = item["result"]
    if "quantiles" in item:
        return _cut(_quantiles(result))
    if "rate" in item:
        head = f"{item['rate']} is {told_values(item)}"
        if "against" not in item:
            return [f"{head}: {rate_text(result[0])}"]
        rows = [f"  {r['low']:>10.4g} to {r['high']:>10.4g}  {rate_text(r)}" for r in result if r["cases"]]
        return _cut([f"{head}, by {item['against']}:", *rows])
    if "confusion" in item:
        rows = []
        for true, row in result.items():
            told = sorted(row.items(), key=lambda pair: -pair[1])
            rows.append(f"  {true:<44} {', '.join(f'{n} {count}' for n, count in told)}")
        return _cut([f"{item['of']}, and what {item['confusion']} was:", *rows])
    lines = []
    for name, found in result.items():
        lines += _sensitivity(name, found)
    return lines


def _quantiles(result: Mapping[str, Any]) -> list[str]:
    at = next((entry["quantiles"] for entry in result.values() if entry["runs"]), [])
    lines = [f"{'':<24} {'mean':>11} " + " ".join(f"{q['at']:>10.4g}q" for q in at)]
    for name, entry in result.items():
        if entry["runs"]:
            values = " ".join(f"{q['value']:>11.4g}" for q in entry["quantiles"])
            lines.append(f"{name:<24} {entry['mean']:>11.4g} {values}")
        else:
            lines.append(f"{name:<24} no values")
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
            (low, high), (below, above) = entry["first_interval"], entry["total_interval"]
            told = f"{entry['first']:7.3f} [{low:.3f}, {high:.3f}]  {entry['total']:7.3f} [{below:.3f}, {above:.3f}]"
        else:
            told = f"{entry['correlation']:+.3f}  (p {entry['p']:.2g})"
        lines.append(f"  {parameter:<28} {told}")
    return _cut(lines)


def told_values(item: Mapping[str, Any]) -> str:
    """The values that a rate counts, in words."""
    return " or ".join(str(v).lower() if isinstance(v, bool) else str(v) for v in item["is"])


def rate_text(entry: Mapping[str, Any]) -> str:
    """A rate with its interval."""
    if not entry["cases"]:
        return "no cases"
    low, high = entry["interval"]
    return f"{entry['count']} of {entry['cases']} ({entry['rate']:.2%}, 95 % from {low:.2%} to {high:.2%})"


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
        before, after = ("no value" if value is None else f"{value:.6g}" for value in (change.before, change.after))
        lines.append(f"  {change.verdict:<8} {change.name:<28} {change.what}: {before} -> {after}  (p {change.p:.2g})")
    return lines
