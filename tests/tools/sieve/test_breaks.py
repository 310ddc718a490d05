"""One change of bench or block between two rows is named: the gap, the changed quantity, and the size."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from diagnoses import diagnosed
from field_files import field_file
from generator import SIGMA
from generator.broken import Broken, broken_record
from trihedron import read_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.reports import page_of
from trihedron.tools.trials import Hidden, draw_whole

KEYS = {
    "outer zero": ("alpha_zero_rad",),
    "inner zero": ("beta_zero_rad",),
    "biases": ("bias_1_g", "bias_2_g", "bias_3_g"),
    "common scale": ("scale_factor",),
    "scale factors": ("scale_factor_1", "scale_factor_2", "scale_factor_3"),
    "biases and mounting": (
        *("bias_1_g", "bias_2_g", "bias_3_g"),
        *("mounting_1_rad", "mounting_2_rad", "mounting_3_rad"),
    ),
}
LISTED = {"bias": "bias-step", "scale factor": "scale-step", "mounting": "mounting-slip"}
"""Effects of the catalogue, which keep their names."""
SECOND = 5e-8
"""Turn of a small change by a large error of the mounting [rad]."""


def assert_broken(result: Any, broken: Broken) -> None:
    """Assert that the break alone explains the record, and that its intervals hold the change."""
    assert result.verdict == "explained", str(result)
    explanation = result.explanations[0]
    assert (explanation.kind, explanation.before_row, result.causes) == ("break", broken.before_row, ())
    assert tuple(explanation.change) == KEYS[broken.group]
    for key, size in zip(explanation.change, broken.change, strict=True):
        low, high = explanation.within[key]
        assert low - SECOND <= size <= high + SECOND
        assert low <= explanation.change[key] <= high
    assert explanation.calibration.verdict == "consistent"
    assert explanation.calibration.radius == explanation.radius <= 1.0 + 1e-6


CASES = [("outer zero", 1, 48), ("inner zero", 2, 36), ("biases", 3, 24), ("scale factors", 4, 48)]
CASES += [("biases and mounting", 5, 48), ("common scale", 6, 36)]


@pytest.mark.first(1)
@pytest.mark.parametrize(("group", "seed", "count"), CASES)
def test_a_break_is_named_with_its_gap_and_its_size(group, seed, count):
    broken = broken_record(seed, group, count, 8.0)
    assert_broken(diagnosed(broken.record), broken)


@pytest.mark.acceptance
@pytest.mark.parametrize("group", KEYS)
def test_breaks_of_drawn_records_are_named(group):
    named = 0
    for seed in range(8):
        broken = broken_record(100 + seed, group, (24, 48, 100)[seed % 3], 8.0)
        result = diagnosed(broken.record)
        if result.verdict == "explained":
            first = result.explanations[0]
            assert first.kind == "break", str(result)
            assert abs(first.before_row - broken.before_row) <= 1
            named += 1
    assert named >= 6


@pytest.mark.first(1)
@pytest.mark.parametrize("axis", [1, 2])
def test_one_angle_of_the_mounting_changes(axis):
    seed = {1: 11, 2: 13}[axis]
    broken = broken_record(seed, "mounting angle", 48, 8.0)
    explanation = diagnosed(broken.record).explanations[0]
    assert (explanation.kind, explanation.before_row) == ("break", broken.before_row)
    (size,) = explanation.change.values()
    assert abs(size - broken.change[0]) < 2.0 * SIGMA


@pytest.mark.first(1)
@pytest.mark.parametrize("group", LISTED)
def test_what_the_catalogue_lists_keeps_its_name(group):
    result = diagnosed(broken_record(21, group, 48, 12.0).record)
    assert [cause.effect for cause in result.causes] == [LISTED[group]]


@pytest.mark.parametrize(
    ("name", "row", "words"),
    [
        pytest.param("o18_remount_power.csv", 25, "mounting", marks=pytest.mark.acceptance),
        ("o19_power.csv", 31, "biases"),
    ],
)
def test_breaks_of_the_field_are_named(name, row, words, tmp_path):
    result = diagnosed(read_record(field_file(name, tmp_path)))
    assert result.verdict == "explained"
    explanation = result.explanations[0]
    assert (explanation.kind, explanation.before_row) == ("break", row)
    assert explanation.sentence.startswith(f"Between rows {row - 1} and {row} ")
    assert words in explanation.sentence


@pytest.mark.acceptance
def test_biases_of_the_field_changed_by_what_they_did(tmp_path):
    explanation = diagnosed(read_record(field_file("o19_power.csv", tmp_path))).explanations[0]
    for key, size in zip(("bias_1_g", "bias_2_g", "bias_3_g"), (4e-5, -3e-5, 5e-5), strict=True):
        low, high = explanation.within[key]
        assert low <= size <= high


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "whole", [False, pytest.param(True, marks=pytest.mark.acceptance)], ids=["rests", "with gyros"]
)
def test_biases_of_a_bench_record_change_at_a_time(whole):
    drawn = draw_whole(np.random.default_rng([5, 5]))
    bench = replace(drawn, alpha=drawn.alpha[-28:], beta=drawn.beta[-28:])
    hidden, sizes = [], (8e-5, -7e-5, 9e-5)
    for accelerometer, size in enumerate(sizes, start=1):
        hidden.append(Hidden(EffectPlace("bias-step", f"accelerometer-{accelerometer}"), (size, 0.04)))
    result = diagnosed(bench.measured(5, None, hidden), **({"bench": bench.place} if whole else {}))
    assert result.verdict == "explained"
    explanation = result.explanations[0]
    assert (explanation.kind, explanation.before_row) == ("break", None)
    assert 136.0 < explanation.time_s < 148.0
    for (low, high), size in zip(explanation.within.values(), sizes, strict=True):
        assert low <= size <= high


def test_a_break_stands_on_the_page_with_what_is_possible():
    record = broken_record(3, "biases", 24, 8.0).record
    page = page_of(diagnosed(record), record)
    assert page is not None
    section = next(section for section in page.answer if section.title == "The change")
    assert section.table is not None
    assert [row[0] for row in section.table.rows] == ["bias_1_g", "bias_2_g", "bias_3_g"]
