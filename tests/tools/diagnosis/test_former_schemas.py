"""Diagnoses of former schemas are read like the present one, by `check` and by all their users."""

import json
from typing import Any

import pytest

from trihedron.tools.check import check
from trihedron.tools.diagnosis import read_diagnosis

SIZE = {"name": "coefficient", "unit": "1/g", "estimate": 4e-4, "low": 3.9e-4, "high": 4.2e-4}
QUADRATIC = {"effect": "quadratic", "where": "accelerometer-2"}
CUBIC = {"effect": "cubic", "where": "accelerometer-1"}
REPEATED = {
    "name": "X4",
    "unit": "1",
    "of": "instrument",
    "records": [
        {"record": "a", "estimate": 1e-3, "low": 0.0, "high": 2e-3},
        {"record": "b", "estimate": None, "low": None, "high": None},
    ],
    "at_least": 0.0,
    "at_most": 2e-3,
}
CAUSE = {**QUADRATIC, "equivalents": [], "parameters": [SIZE]}
OTHER = {**CUBIC, "equivalents": [], "parameters": [{**SIZE, "unit": "1/g2"}]}


def of_one(**changed: Any) -> dict[str, Any]:
    """Return the diagnosis of a position record in schema 2."""
    return {
        "schema": "trihedron.diagnosis/2",
        "verdict": "explained",
        "noise_bound": 1e-5,
        "noise_bound_basis": "given",
        "baseline_model": "asymmetric",
        "baseline": {"radius": 3.1, "falsified": True, "witness": [{"position": 7, "accelerometer": 2}]},
        "causes": [CAUSE],
        "extended": {"radius": 0.7},
        "gain": None,
        "targets": [{"symbol": "X4", "before": 1e-3, "after": 2e-3, "low": 1e-3, "high": 3e-3}],
        **changed,
    }


def of_several() -> dict[str, Any]:
    """Return the diagnosis of several records in its former schema: a cause of all, a parameter that differs in one."""
    nothing = {"equivalents": ["bias-drift accelerometer-1"], "parameters": [SIZE]}
    shared = {"title": "quadratic", "of": "instrument", "record": None, "effect": QUADRATIC, "parameter": None}
    of_run = {"title": "X4 differs in b", "of": "run", "record": "b", "effect": None, "parameter": "X4"}
    records = [{"record": label, "sha256": "", "left_out": None, "diagnosis": of_one()} for label in "ab"]
    return {
        "schema": "trihedron.several/1",
        "verdict": "explained",
        "records": records,
        "radius": 5.0,
        "radius_with_causes": 0.8,
        "causes": [{**shared, **nothing}, {**of_run, **nothing}],
        "alternatives": [],
        "parameters": [{"name": "X9", "unit": "1", "estimate": 0.0, "low": -1e-3, "high": 1e-3}],
        "gains": [],
        "witnesses": [],
        "repeatability": [REPEATED],
    }


@pytest.mark.parametrize("schema", ["trihedron.diagnosis/1", "trihedron.diagnosis/2"])
def test_a_record_keeps_its_causes_radii_and_bound(schema, tmp_path):
    file = tmp_path / "d.json"
    file.write_text(json.dumps(of_one(schema=schema)), encoding="utf-8")
    assert check(file).summary == ("explained: quadratic accelerometer-2",)
    diagnosis = read_diagnosis(file)
    assert diagnosis is not None
    assert (diagnosis.noise_bound, diagnosis.radius, diagnosis.calibration.verdict) == (1e-5, 3.1, "falsified")
    assert diagnosis.best is not None
    assert diagnosis.best.radius == 0.7
    assert diagnosis.stated["X4"].low == 1e-3
    assert [cause.intervals for cause in diagnosis.causes] == [((3.9e-4, 4.2e-4),)]
    assert json.loads(diagnosis.json_text())["schema"] == "trihedron.diagnosis/3"


def test_sets_that_remain_are_explanations(tmp_path):
    file = tmp_path / "d.json"
    file.write_text(json.dumps(of_one(verdict="ambiguous", alternatives=[[OTHER]])), encoding="utf-8")
    assert check(file).summary == ("ambiguous: quadratic accelerometer-2",)
    diagnosis = read_diagnosis(file)
    assert diagnosis is not None
    assert diagnosis.causes == ()
    assert [[cause.title for cause in causes] for causes in diagnosis.sets] == [
        ["quadratic accelerometer-2"],
        ["cubic accelerometer-1"],
    ]


def test_of_several_records_whose_a_cause_is(tmp_path):
    file = tmp_path / "s.json"
    file.write_text(json.dumps(of_several()), encoding="utf-8")
    assert check(file).summary == ("2 records, explained: quadratic accelerometer-2; X4 differs in b",)
    diagnosis = read_diagnosis(file)
    assert diagnosis is not None
    assert [(cause.title, cause.record) for cause in diagnosis.causes] == [
        ("quadratic accelerometer-2", None),
        ("X4 differs in b", "b"),
    ]
    assert (diagnosis.radius, diagnosis.noise_bound, diagnosis.judged) == (5.0, 1e-5, ("a", "b"))
    assert diagnosis.stated["X9"].high == 1e-3
    assert diagnosis.repeatability is not None
    assert diagnosis.repeatability.each("X4")["a"].ends == (0.0, 2e-3)
    assert [change.at_most for change in diagnosis.repeatability.changes] == [2e-3]


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"baseline": 3}, "calibration: "),
        ({"causes": [{"effect": "quadratic"}]}, "causes[1].where: is missing"),
        ({"causes": 3}, "causes: "),
        ({"extended": {"radius": "much"}}, "explanations[1].radius: "),
    ],
)
def test_what_is_wrong_with_one_is_said(changed, says, tmp_path):
    file = tmp_path / "d.json"
    file.write_text(json.dumps(of_one(**changed)), encoding="utf-8")
    problems = [problem.text for problem in check(file).problems]
    assert any(text.startswith(says) for text in problems), problems
