"""What the page on choosing an attitude algorithm says is so."""

import math
import re
from pathlib import Path

import pytest

from choosing import (
    COMPARED,
    PAGE,
    RATES,
    SITUATIONS,
    Situation,
    aliasing,
    between_marks,
    coning_drift,
    make_page,
    operations_per_sample,
    order_table,
    relative_coning_drift,
    situation_errors,
)
from trihedron.models.attitude_algorithms import ALGORITHMS
from trihedron.tools.motion.attitude import algorithm_named

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.acceptance
def test_operations_of_22_by_hand():
    """Two squares 10, two factors 22, two scaled vectors 12, a cross product 15, the quaternion 22, the product 28."""
    assert operations_per_sample(algorithm_named("two-sample-rodrigues")) == (10 + 22 + 12 + 15 + 22 + 28) / 2


@pytest.mark.parametrize("phase", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("name", ["two-sample-rodrigues", "one-sample-rodrigues"])
def test_coning_drift_is_the_fourth_power_over_thirty(name, phase):
    found = relative_coning_drift(algorithm_named(name), phase)
    assert found == pytest.approx(phase**4 / 30.0, rel=0.3 * phase**2 + 1e-3)


def test_coning_drift_of_the_mean_rate_is_exact():
    """(7.18) sees the chord for the arc: 1 - drift = sin(x)/x of the cone's projection, but for the cone's size."""
    phase = 0.8
    expected = 1.0 - math.sin(phase) / phase
    assert relative_coning_drift(algorithm_named("mean-rate"), phase) == pytest.approx(expected, rel=1e-3)


def test_table_of_orders_in_the_page_is_that_of_the_algorithms():
    page = (DOCS / PAGE).read_text(encoding="utf-8")
    assert between_marks(page, "orders", order_table()) == page


WORDS = {2: "second", 3: "third", 4: "fourth"}


@pytest.mark.parametrize(
    ("said", "names"),
    [
        (r"in general motion they are of (\w+) order", [a.name for a in ALGORITHMS if "for coning" in a.title]),
        (r"\(23\) is of (\w+) order", ["two-sample-rodrigues-second-iterate"]),
        (r"\(7\.22\) is of (\w+), not", ["two-sample-quaternion"]),
    ],
)
def test_orders_in_the_text_of_the_page_are_those_that_were_measured(said, names):
    text = " ".join((DOCS / PAGE).read_text(encoding="utf-8").split())
    assert names
    assert set(re.findall(said, text)) == {WORDS[algorithm_named(name).order] for name in names}


def test_page_names_pictures_and_algorithms_that_exist():
    page = (DOCS / PAGE).read_text(encoding="utf-8")
    for name in ("accuracy", "coning", "aliasing"):
        assert f"pictures/attitude-{name}.svg" in page
        assert (DOCS / "pictures" / f"attitude-{name}.svg").is_file()
    for name in COMPARED:
        assert f"`{name}`" in page


def test_pictures_are_the_same_bytes_each_time():
    assert coning_drift(["a"], [0.1, 0.2], [[1e-5, 1e-4]]) == coning_drift(["a"], [0.1, 0.2], [[1e-5, 1e-4]])
    assert "<svg" in aliasing(["a"], [500.0, 1000.0], [[1e-5], [1e-4]], 420.0)


@pytest.mark.acceptance
def test_page_says_what_comes_out(tmp_path):
    """The page made again is the page; what its text says of the numbers is so."""
    page = (DOCS / PAGE).read_text(encoding="utf-8")
    (tmp_path / PAGE).write_text(page, encoding="utf-8")
    for file in make_page(tmp_path):
        kept = (DOCS / file.relative_to(tmp_path)).read_text(encoding="utf-8")
        if file.suffix == ".md":
            assert file.read_text(encoding="utf-8") == kept
    algorithms = [algorithm_named(name) for name in COMPARED]
    errors = [dict(zip(COMPARED, situation_errors(s, algorithms), strict=True)) for s in SITUATIONS]
    for found in errors:
        pair = [found[name] for name in ("two-sample-rodrigues", "two-sample-quaternion", "two-sample-rotation-vector")]
        assert max(pair) < 1.4 * min(pair)
        assert found["adaptive-degree"] < 1.05 * found["two-sample-rodrigues"]
        assert found["panov-series"] > found["two-sample-rodrigues"]
        assert found["four-sample-coning"] > 1000.0 * found["two-sample-rodrigues"]
    assert errors[0]["functional-iteration-8"] < 1e-6 * errors[0]["two-sample-rodrigues"]
    # Near the limit of aliasing high degrees do harm, well above it they pay.
    assert errors[2]["functional-iteration-8"] > 10.0 * errors[2]["two-sample-rodrigues"]
    chosen = [algorithm_named(name) for name in ("two-sample-rodrigues", "functional-iteration-8")]
    low, high = situation_errors(Situation("second", 4000.0, ""), chosen)
    assert high < 0.02 * low
    assert min(RATES) < 840.0
