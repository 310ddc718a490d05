"""The bounds of a result as a document shows them: each is rounded to its own side, everywhere.

All shown numbers go through `trihedron.tools.rounding`; `Watched` records its inputs and outputs while a document is
made. Bounds of the result are known by their keys in its JSON. `rows_of_page` reads the tables of a page as a person
does, from its HTML alone.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from html.parser import HTMLParser
from typing import Any
from unittest import mock

from trihedron.tools import rounding

UP = {
    *("guaranteed_error", "error_bound", "noise_bound", "noise_bound_arcmin", "above", "high", "limit"),
    *("cost", "gap", "costs", "optima", "ratio", "worst_ratio", "mean_ratio", "worst", "largest_error_deg", "planned"),
    *("bias", "compensated", "solved", "force_bound", "rate_bound", "distance_at_most", "max_arcmin", "clearance"),
    *("held_out_max_before", "held_out_max_after", "max_before", "max_after", "maximum", "largest"),
    "bridged_bound",
}
"""Keys of upper bounds."""
DOWN = {"low", "lower_bound", "distance_before", "distance_after", "apart_g"}
"""Keys of lower bounds."""
BOTH = {"radius"}
"""Keys of bounds that are upper up to 1 and lower above 1."""
UNITS = (1.0, 100.0, 60.0, 3600.0, 180.0 / math.pi, 10800.0 / math.pi, 648000.0 / math.pi)
"""Multiples in which a figure of the JSON may be shown."""


@dataclass
class Watched:
    """Rounded values: the number, the direction, the text."""

    seen: list[tuple[float, str, str]] = field(default_factory=list)

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Record every number that is rounded."""
        names = ("_significant", "_placed")

        def watched(make: Any) -> Any:
            def made(value: float | None, *rest: Any) -> rounding.Number:
                text = make(value, *rest)
                if value is not None and math.isfinite(value):
                    self.seen.append((float(value), rest[-1], str(text)))
                return text

            return made

        with mock.patch.multiple(rounding, **{name: watched(getattr(rounding, name)) for name in names}):
            yield


def bounds_of(content: Any, key: str = "") -> Iterator[tuple[str, float]]:
    """Return every bound of a JSON object, with its key; numbers in lists and maps have the key of these."""
    if isinstance(content, dict):
        for name, value in content.items():
            yield from bounds_of(value, name if not isinstance(value, int | float) or name in UP | DOWN | BOTH else key)
    elif isinstance(content, list):
        for value in content:
            yield from bounds_of(value, key)
    elif isinstance(content, float) and math.isfinite(content) and content != 0.0:
        yield key, content


def _key(value: float) -> str:
    """Return one key for figures that differ by the rounding of a conversion."""
    return f"about {value:.12e}"


def shown_too_well(content: Any, watched: Watched) -> list[str]:
    """Return the bounds that are shown on their wrong side, and texts on the wrong side of their number."""
    bounds = list(bounds_of(json.loads(json.dumps(content))))
    unbounded = {value for key, value in bounds if key not in UP | DOWN | BOTH}
    roundings: dict[str, set[str]] = {}
    for key, value in bounds:
        up = key in UP or (key in BOTH and value <= 1.0)
        if key in UP | DOWN | BOTH and value not in unbounded:
            for unit in UNITS:
                # A figure that is both kinds of bound may be shown as either.
                shown_as = repr(value) if unit == 1.0 else _key(value * unit)
                roundings.setdefault(shown_as, set()).add(ROUND_CEILING if up else ROUND_FLOOR)
    wrong = []
    for value, how, text in watched.seen:
        exact, printed = Decimal(repr(value)), Decimal(text)
        if (how == ROUND_CEILING and printed < exact) or (how == ROUND_FLOOR and printed > exact):
            wrong.append(f"{text} of {value!r}")
        ways = roundings.get(repr(value)) or roundings.get(_key(value), {how})
        if how not in ways and printed != exact:
            wrong.append(f"{text} is shown of the bound {value!r}, which is to be rounded by {ways}")
    return wrong


class _Tables(HTMLParser):
    """The tables of a page: heads of the columns, and the cells of each row."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[dict[str, str]] = []
        self._heads: list[str] = []
        self._cells: list[str] = []
        self._in: str = ""

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag == "table":
            self._heads = []
        elif tag == "tr":
            self._cells = []
        elif tag in ("th", "td"):
            self._in = tag
            (self._heads if tag == "th" else self._cells).append("")

    def handle_endtag(self, tag: str) -> None:
        if tag in ("th", "td"):
            self._in = ""
        elif tag == "tr" and len(self._cells) == len(self._heads):
            self.rows.append(dict(zip(self._heads, self._cells, strict=True)))

    def handle_data(self, data: str) -> None:
        if self._in:
            (self._heads if self._in == "th" else self._cells)[-1] += data


def rows_of_page(page: str) -> list[dict[str, str]]:
    """Return every row of every table of a page's HTML, by the heads of its columns, without their powers of ten."""
    tables = _Tables()
    tables.feed(page)
    return [dict(without_power(head, cell) for head, cell in row.items()) for row in tables.rows]


def without_power(head: str, cell: str) -> tuple[str, str]:
    """Return the head of a column without its power of ten, and a cell with it: "a [10⁻⁶ g]", "7.4" as "a [g]",
    "7.4e-6"."""
    match = re.fullmatch(r"(.*) \[10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+) ?(.*)\]", head)
    if match is None:
        return head, cell
    name, power, unit = match.groups()
    power = int(power.translate(_RAISED))
    return f"{name} [{unit}]" if unit else name, cell and str(Decimal(cell).scaleb(power))


def read_off_column(head: str, *cells: str) -> list[float | None]:
    """Return the numbers that a column shows."""
    return [read_off(without_power(head, cell)[1]) for cell in cells]


NAMED = ("explained", "ambiguous")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def read_off(cell: str) -> float | None:
    """Return the number that a cell shows, as 5.2, −0.001 or 3.1·10⁻⁵; None if it shows none."""
    mantissa, _, power = cell.strip().replace("\u2212", "-").partition("·10")
    try:
        return float(f"{mantissa}e{power.translate(_RAISED)}" if power else mantissa)
    except ValueError:
        return None


def sets_shown(content: Mapping[str, Any]) -> list[list[dict[str, Any]]]:
    """Return the sets of effects of a diagnosis, by its JSON, in the order of its page: the best, then the
    alternatives."""
    if content["verdict"] not in NAMED:
        return []
    return [content["causes"]] if content["causes"] else content.get("alternatives") or []


def wrong_on_page(page: str, content: Mapping[str, Any]) -> list[str]:
    """Return the ends of intervals shown inside those of the JSON, and estimates shown outside, on a diagnosis page."""
    rows = [row for row in rows_of_page(page) if {"low", "high"} <= set(row)]
    sizes = iter([p for causes in sets_shown(content) for cause in causes for p in cause["parameters"]])
    targets = {entry["symbol"]: entry for entry in content.get("targets") or []}
    wrong = []
    for row in rows:
        name = row.get("target") or row.get("parameter", "")
        low, high = read_off(row["low"]), read_off(row["high"])
        printed = read_off(row.get("estimate") or row.get("with the effects") or "")
        if printed is not None and ((low is not None and printed < low) or (high is not None and printed > high)):
            wrong.append(f"{name} on the page")
        stated = targets.get(name) if "target" in row else next(sizes, None) if "effect" in row else None
        if stated is None:
            continue
        if "effect" in row:
            assert stated["name"].startswith(name.partition(",")[0]), (name, stated["name"])
        if (stated["low"] is None) != (low is None) or (low is not None and low > stated["low"]):
            wrong.append(f"low end of {name} on the page")
        if (stated["high"] is None) != (high is None) or (high is not None and high < stated["high"]):
            wrong.append(f"high end of {name} on the page")
    return wrong
