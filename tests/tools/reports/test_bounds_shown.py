"""No document shows a bound better than it is: one module writes all numbers, each bound rounded to its side."""

import ast
import json
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign_runs import CALIBRATION, written
from generator.carried import drawn_motion, strapdown_record
from page_text import clean, shown, text_of
from planning_tasks import planned, stored, tables_task
from shown_bounds import BOTH, DOWN, UP, Watched, shown_too_well, wrong_on_page
from trihedron.tools import library, measured
from trihedron.tools.calibration import calibrate, correction_of, face_readings, levelling
from trihedron.tools.campaign import open_result
from trihedron.tools.document import html
from trihedron.tools.planning import PositionPlan, SettingCheck, check_settings
from trihedron.tools.reports import campaign_page, operator_page, page_of
from trihedron.tools.result import Result
from trihedron.tools.rounding import Stated, digits, exactly, interval, upwards
from trihedron.tools.trials import NOISE_BOUND

TOOLS = Path(library.__file__).parent
SHOWN = ("reports", "document", "cli")
"""Packages that show numbers to people and may not format numbers themselves."""
NUMERIC = re.compile(r"[^{}]*[eEfFgGn%]")
DATA = {
    "rounding.py",
    "foreign/workbook.py",
    "live/run_view.py",
    "records/kinds.py",
    "papers/reproduction.py",
    "document/notation.py",
    "reports/pictures/__init__.py",
}
"""Modules that round, and modules that write figures for programs: records, JSON, coordinates of a picture."""
OWN = {"bias", "compensated", "cost", "gap", "high", "limit", "low", "ratio", "worst"}
"""Names that other figures share; the watch covers the figures of results."""


@cache
def trees() -> tuple[tuple[str, ast.Module], ...]:
    named = ((path.relative_to(TOOLS).as_posix(), path) for path in sorted(TOOLS.rglob("*.py")))
    return tuple((name, ast.parse(path.read_text(encoding="utf-8"))) for name, path in named if name not in DATA)


def formats(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Return the formats of numbers: in f-strings, by `format`, by %, and templates that hold them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FormattedValue) and isinstance(node.format_spec, ast.JoinedStr):
            form = "".join(str(part.value) for part in node.format_spec.values if isinstance(part, ast.Constant))
            if NUMERIC.fullmatch(form):
                yield node.lineno, form
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            for form in re.findall(r"\{[^{}:]*:([-+<>z]*\d*\.?\d*[eEfFgG%])\}|(%\.?\d*[efgEFG])\b", node.value):
                yield node.lineno, "".join(form)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("format", "round"):
            yield node.lineno, node.func.id


@pytest.mark.first(1)
@pytest.mark.parametrize("package", SHOWN)
def test_what_is_shown_has_no_format_of_its_own(package):
    matches = [
        f"{name}:{line}: {form}"
        for name, tree in trees()
        if name.startswith(f"{package}/")
        for line, form in formats(tree)
        # To whole places before it is written exactly.
        if form != "round"
    ]
    assert matches == []


@pytest.mark.acceptance
def test_no_fixed_decimals_that_make_a_small_number_nothing():
    of_all = ((name, line, form) for name, tree in trees() for line, form in formats(tree))
    matches = [f"{name}:{line}: {form}" for name, line, form in of_all if form[-1] in "eEfF%"]
    assert matches == []


@pytest.mark.acceptance
def test_a_bound_is_not_rounded_to_nearest():
    bounds = (UP | DOWN | BOTH) - OWN
    matches = [
        f"{name}:{node.lineno}: {ast.unparse(node)}"
        for name, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "digits"
        for part in ast.walk(node)
        if (isinstance(part, ast.Attribute) and part.attr in bounds)
        or (isinstance(part, ast.Name) and part.id in bounds)
        or (isinstance(part, ast.Constant) and part.value in bounds)
    ]
    assert matches == []


@pytest.mark.parametrize(
    "source",
    [
        'f"{x:.3f}"',
        'f"{x:>+z13.7f}"',
        'f"{x:.{n}e}"',
        '"{width:.2e} g".format(width=x)',
        '"%.3g" % x',
        'format(x, "g")',
    ],
)
def test_a_format_by_hand_is_found(source):
    assert list(formats(ast.parse(source)))


KINDS: dict[str, Callable[[], Result]] = {
    "inspection": lambda: measured.inspect(strapdown_record()),
    "attitude": lambda: measured.attitude_of_record(strapdown_record()),
    "positions": lambda: plan(),
    "setting": lambda: setting(),
    "one-sided": lambda: calibrate(clean(), noise_bound=NOISE_BOUND * 0.9, baseline="symmetric"),
}


@cache
def plan() -> PositionPlan:
    return planned(12, cuts=1)


def setting() -> SettingCheck:
    """Return actual positions of the table beside the planned ones."""
    places = stored(12)
    moved = np.radians(np.random.default_rng(2).uniform(-0.05, 0.05, places.angle.shape))
    return check_settings(tables_task(), places, places.at(places.angle + moved), 1e-5)


@pytest.mark.first(2)
@pytest.mark.parametrize("kind", KINDS)
def test_lines_show_no_bound_better_than_it_is(kind):
    result, watched = KINDS[kind](), Watched()
    with watched():
        lines = str(result).splitlines()
    assert lines
    assert watched.seen
    assert shown_too_well(result.to_json(), watched) == []


@pytest.mark.acceptance
def test_an_operators_page_with_its_proof_shows_no_bound_better_than_it_is():
    watched = Watched()
    with watched():
        page = html(operator_page(plan(), 10.0))
    assert str(upwards(plan().worst_ratio, 2))[:4] in page
    assert watched.seen
    assert shown_too_well(plan().to_json(), watched) == []


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures")
def test_a_campaigns_page_shows_no_bound_better_than_it_is(tmp_path: Path):
    """Check quantiles, largest values and rates with their intervals, of 4 calibrations."""
    more = '[[compute]]\nquantiles = ["X4_guaranteed"]\n[[compute]]\nrate = "verdict"\nis = ["consistent"]\n'
    few = CALIBRATION.replace("points = 7", "points = 2")
    done = library.run_campaign(written(tmp_path, few + more), tmp_path / "out", jobs=1)
    watched = Watched()
    with watched():
        lines = str(done).splitlines()
        page = html(campaign_page(*open_result(tmp_path / "out")))
    assert lines
    assert "X4_guaranteed" in page
    assert watched.seen
    assert any("quantiles" in item for item in done.computed)
    assert shown_too_well(without_statistics(done.to_json()), watched) == []


def without_statistics(content: Any) -> Any:
    """Return a JSON object without means and quantiles: those of bounds are not bounds."""
    if isinstance(content, dict):
        return {k: without_statistics(v) for k, v in content.items() if k not in ("mean", "quantiles")}
    return [without_statistics(v) for v in content] if isinstance(content, list) else content


def figures(pattern: str, lines: Iterable[str]) -> list[float]:
    """Return the numbers that a pattern finds in lines."""
    (matches,) = [match for line in lines if (match := re.search(pattern, line))]
    return [float(text) for text in matches.groups()]


def test_a_small_attitude_error_has_its_digits_and_its_unit():
    """3.9e-7 rad is 2.2e-5 degrees, not 0.000."""
    small = {"rms": 3.9e-7, "maximum": 1.2345e-6, "final": 5e-8, "drift": -2e-10, "bridged_bound": 7.77e-7}
    time_s, rate, specific_force, attitude = drawn_motion(np.random.default_rng(3), moves=2)
    true = attitude.as_quat()[:, [3, 0, 1, 2]]
    run = measured.attitude_of_record(strapdown_record((time_s, rate, specific_force), attitude=true)).model_copy(
        update=small
    )
    lines = str(run).splitlines()
    shown = figures(r"(\S+) deg rms, (\S+) deg at most, (\S+) deg at the end, drift (\S+) deg/min", lines)
    wanted = np.degrees([small["rms"], small["maximum"], small["final"], 60.0 * small["drift"]])
    assert shown == pytest.approx(wanted, rel=5e-3)
    assert shown[1] >= wanted[1]
    (bridged,) = figures(r"by at most (\S+) deg", lines)
    assert np.degrees(small["bridged_bound"]) <= bridged <= 1.01 * np.degrees(small["bridged_bound"])
    assert not re.search(r"(?<![0-9.])0\.0+ ", " ".join(lines))


def test_levelling_is_told_in_arcseconds_rounded_up():
    result = calibrate(clean(), noise_bound=NOISE_BOUND)
    correction = correction_of(result.to_json(), "calibration")
    before, after = levelling(correction, face_readings(correction)[1]).worst
    assert after is not None
    shown = figures(r"wrong by up to (\S+) arcsec, corrected by at most (\S+) \(", str(result).splitlines())
    for text, true in zip(shown, np.degrees((before, after)) * 3600.0, strict=True):
        assert true <= text <= 1.01 * true + 1.0


def test_bounds_of_means_at_rest_are_told_in_their_units_rounded_up():
    matches = measured.inspect(strapdown_record())
    assert matches.rests.force_bound is not None
    assert matches.rests.rate_bound is not None
    shown = figures(r"3 Allan deviations, .*: (\S+) g, (\S+) deg/s", str(matches).splitlines())
    report = matches.to_json()["rests"]
    force = np.median(report["force_bound_mps2"], axis=0).max() / matches.gravity
    rate = np.degrees(np.median(report["rate_bound_radps"], axis=0).max())
    for text, true in zip(shown, (force, rate), strict=True):
        assert true <= text <= 1.1 * true


@pytest.mark.parametrize(
    ("stated", "form", "shown"),
    [
        (Stated(1.23456e-3, 1.23450e-3, 1.23461e-3), "+.2e", "+1.2346e-03"),
        (1e3 * Stated(1.23456e-3, 1.23450e-3, 1.23461e-3), ".1f", "1.2346"),
        (-Stated(1.23456e-3, 1.23450e-3, 1.23461e-3), ".3g", "-0.0012346"),
        (Stated(2e-3, 1e-3, 3e-3), ".2e", "2.00e-03"),
        (Stated(5.0, 1.0, 2.0), ".2e", "5.00e+00"),
        (Stated(0.1, 0.1, 0.1), ".2g", "0.1"),
    ],
)
def test_what_a_sentence_states_is_not_seen_outside_its_interval(stated: Stated, form: str, shown: str):
    assert format(stated, form) == shown


@pytest.mark.parametrize(
    ("show", "wrong"),
    [
        (lambda: upwards(3.541e-5), 0),
        (lambda: digits(3.541e-5, 2), 1),
        (lambda: exactly(3.541e-5), 0),
        (lambda: interval(2e-3, 1.23456e-3, 3.45671e-3), 0),
        (lambda: interval(5e-3, 3.45671e-3, 9e-3), 1),
        (lambda: upwards(3.541e-5 * 648000.0 / np.pi), 0),
        (lambda: digits(3.541e-5 * 648000.0 / np.pi), 1),
    ],
)
def test_a_bound_on_its_wrong_side_is_found(show: Callable[[], Any], wrong: int):
    watched = Watched()
    with watched():
        show()
    content = {"parameters": [{"guaranteed_error": 3.541e-5, "low": 1.23456e-3, "high": 3.45671e-3}]}
    assert len(shown_too_well(content, watched)) == wrong


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("part", "end", "further"), [("causes", "low", -1e-6), ("causes", "high", 1e-6), ("targets", "low", -1e-7)]
)
def test_what_a_page_shows_inside_its_interval_is_found(part: str, end: str, further: float):
    """Read from the HTML alone, as a person does."""
    report = json.loads(shown("bench, explained")[0].json_text())
    assert wrong_on_page(text_of("bench, explained"), report) == []
    entry = report["causes"][0]["parameters"][0] if part == "causes" else report["targets"][3]
    entry[end] += 10.0 * further
    assert len(wrong_on_page(text_of("bench, explained"), report)) == 1


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures")
def test_headline_terminal_and_table_agree_on_the_bound():
    """With 3.541e-5 in JSON the headline said 3.5e-5, the terminal 3.5e-05 and the table 3.6e-5."""
    result = calibrate(clean(), noise_bound=1.7432e-5)
    largest = max(row.error_bound for row in result.parameters if row.error_bound is not None)
    page = page_of(result, clean())
    assert page is not None
    (shown,) = re.findall(r"to within ([-+0-9.e]+) or better", page.verdict)
    assert float(shown) >= largest
    assert re.search(rf"(?<![0-9.]){re.escape(shown)}(?![0-9])", str(result).partition("Targets")[2])
    (table,) = (section.table for section in page.sections if section.title == "Targets")
    assert table is not None
    assert shown in {str(cell) for row in table.rows for cell in row}
