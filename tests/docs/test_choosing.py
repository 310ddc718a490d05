"""The statements of the pages on attitude algorithms are true."""

import math
import re
from pathlib import Path

import pytest

from attitude_motions import operations_per_sample, paper_error, relative_coning_drift
from trihedron.models.attitude_algorithms import ALGORITHMS
from trihedron.tools.cli import main
from trihedron.tools.motion import algorithm_named, sample_motion
from trihedron.tools.papers import EXACT, paper_motion

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE_FILE = DOCS / "choose-an-attitude-algorithm.md"
PAGES = (PAGE_FILE, DOCS / "attitude-algorithms.md", DOCS / "figures.md")
PAGE = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
SITUATIONS = (("1", 100.0), ("first", 2000.0), ("second", 1000.0))
"""Motions of the paper and gyro sample rates [Hz] of the table of accuracy, in the order of its columns."""


def table(name: str) -> list[list[str]]:
    """Return the cells of a table of the pages, without its head."""
    text = PAGE[PAGE.index(f"<!-- {name} -->") : PAGE.index(f"<!-- end of {name} -->")]
    lines = text.splitlines()[3:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def shown(source: str) -> str:
    """Return a source as the table has it: an equation of the paper, or another paper."""
    paper = "Chelnokov et al. 2016, "
    return source.removeprefix(paper) if source.startswith(paper) else source.partition(",")[0]


def operations(name: str) -> float:
    """Return the operations for one gyro sample on the slow, large motion."""
    algorithm = algorithm_named(name)
    increments = sample_motion(paper_motion("1", EXACT), 0.01, 2 * algorithm.samples).increments
    return operations_per_sample(algorithm, increments)


@pytest.mark.acceptance
def test_operations_of_22_by_hand():
    """Two squares 10, two factors 22, two scaled vectors 12, a cross product 15, the quaternion 22, the product 28."""
    assert operations("two-sample-rodrigues") == (10 + 22 + 12 + 15 + 22 + 28) / 2


@pytest.mark.parametrize("phase", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("name", ["two-sample-rodrigues", "one-sample-rodrigues"])
def test_coning_drift_is_the_fourth_power_over_thirty(name, phase):
    result = relative_coning_drift(algorithm_named(name), phase)
    assert result == pytest.approx(phase**4 / 30.0, rel=0.3 * phase**2 + 1e-3)


def test_coning_drift_of_the_mean_rate_is_exact():
    """(7.18) takes the chord for the arc: 1 - drift = sin(x)/x of the cone's projection, except for the cone's size."""
    phase = 0.8
    expected = 1.0 - math.sin(phase) / phase
    assert relative_coning_drift(algorithm_named("mean-rate"), phase) == pytest.approx(expected, rel=1e-3)


def test_table_of_orders_in_the_page_is_that_of_the_algorithms():
    for algorithm, row in zip(ALGORITHMS, table("orders"), strict=True):
        before = " and those before" if algorithm.previous else ""
        assert row[:3] == [f"`{algorithm.name}`", shown(algorithm.source), f"{algorithm.samples}{before}"]
        assert row[3:] == [str(algorithm.order), str(algorithm.coning_order)]


WORDS = {2: "second", 3: "third", 4: "fourth"}


@pytest.mark.parametrize(
    ("printed", "names"),
    [
        (r"in general motion they are of (\w+) order", [a.name for a in ALGORITHMS if "for coning" in a.title]),
        (r"\(23\) is of (\w+) order", ["two-sample-rodrigues-second-iterate"]),
        (r"\(7\.22\) is of (\w+), not", ["two-sample-quaternion"]),
    ],
)
def test_orders_in_the_text_of_the_page_are_those_that_were_measured(printed, names):
    text = " ".join(PAGE.split())
    assert names
    assert set(re.findall(printed, text)) == {WORDS[algorithm_named(name).order] for name in names}


def test_the_command_that_chose_an_algorithm_names_what_takes_its_place(capsys):
    assert main(["choose", "vibration"]) == 2
    message = capsys.readouterr().err
    assert "--compare" in message
    assert f"docs/{PAGE_FILE.name}" in message
    assert message.count("\n") == 1


@pytest.mark.parametrize("name", ["accuracy", "coning", "aliasing"])
def test_page_shows_pictures_that_exist(name):
    assert f"pictures/attitude-{name}.svg" in PAGE
    assert (DOCS / "pictures" / f"attitude-{name}.svg").is_file()


@pytest.mark.acceptance
def test_tables_of_the_page_are_what_comes_out():
    errors = {}
    for row in table("accuracy"):
        name = row[0].split("`")[1]
        errors[name] = [paper_error(algorithm_named(name), *situation) for situation in SITUATIONS]
        assert row[1:] == [f"{operations(name):.0f}", *(f"{math.degrees(error):.1e}" for error in errors[name])]
    best = errors["two-sample-rodrigues"]
    for k in range(3):
        pair = [best[k], errors["two-sample-quaternion"][k], errors["two-sample-rotation-vector"][k]]
        assert max(pair) < 1.4 * min(pair)
        assert errors["adaptive-degree"][k] < 1.05 * best[k]
        assert errors["panov-series"][k] > best[k]
        assert errors["four-sample-coning"][k] > 1000.0 * best[k]
    assert errors["functional-iteration-8"][0] < 1e-6 * best[0]
    # Near the limit of aliasing high degrees do harm; well above it they help.
    assert errors["functional-iteration-8"][2] > 10.0 * best[2]
    high, low = (
        paper_error(algorithm_named(name), "second", 4000.0)
        for name in ("functional-iteration-8", "two-sample-rodrigues")
    )
    assert high < 0.02 * low
