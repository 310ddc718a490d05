"""Ambiguous and unexplained diagnoses: the record is calibrated all the same, marked, with the σ each set needs."""

import json
from typing import Any

import numpy as np
import pytest

import trihedron as th
from diagnoses import diagnosed
from generator import SIGMA
from generator.positions import Session
from trihedron.models.effects import EffectPlace
from trihedron.tools.records import write_record

QUADRATIC = EffectPlace("quadratic", "accelerometer-2")
CUBIC = EffectPlace("cubic", "accelerometer-2")
STEP = EffectPlace("bias-step", "accelerometer-2")
DRIFT = EffectPlace("bias-drift", "accelerometer-2")


def faint(seed: int, place: EffectPlace, sizes: tuple[float, ...]) -> tuple[Session, Any]:
    """Return a session of few positions with a weak effect, and its record."""
    rng = np.random.default_rng([seed, 45])
    session = Session.drawn(rng, 16)
    return session, session.record([(place, sizes)], rng.uniform(-SIGMA, SIGMA, (16, 3)))


def missed(result: Any, session: Session) -> list[str]:
    """Return the targets whose intervals miss the truth."""
    targets = session.stand.targets()
    return [symbol for symbol, value in targets.items() if not result[symbol].possible(value)]


@pytest.mark.parametrize(
    ("seed", "place", "sizes"),
    [
        *(pytest.param(seed, DRIFT, (9e-5,), marks=pytest.mark.acceptance) for seed in range(8)),
        *(pytest.param(seed, STEP, (8e-5, 0.3), marks=pytest.mark.acceptance) for seed in range(8)),
        *(pytest.param(seed, CUBIC, (1e-4,), marks=pytest.mark.acceptance) for seed in range(1, 8)),
    ],
)
def test_an_ambiguous_record_is_calibrated_with_each_explanation_that_remains(seed, place, sizes):
    session, record = faint(seed, place, sizes)
    diagnosis = diagnosed(record).model_copy(update={"made_of": record})
    if diagnosis.verdict != "ambiguous":
        pytest.skip(f"the draw is {diagnosis.verdict}")
    result: Any = th.calibrate(record, explained_by=diagnosis)
    assert "the diagnosis is ambiguous" in result.warnings[0]
    assert len(result.sets) >= 1
    assert all(p.estimate is not None for p in result.parameters)
    laws = [one for one in diagnosis.explanations if one.kind == "function" and not one.causes]
    assert missed(result, session) == []
    if laws:
        assert "No interval is given" in result.warnings[0]
        assert not any(p.bounded for p in result.parameters)
        return
    if result.verdict == "insufficient":
        assert result.missing
        assert result.open
        return
    assert all(p.bounded for p in result.targets)
    for one in result.sets:
        assert one.stands_with_sigma <= SIGMA * 1.01
    # No set leaves wider intervals than all together.
    for one in diagnosis.explanations:
        only = {"verdict": "explained", "explanations": (one,), "causes": one.causes, "alternatives": None}
        alone: Any = th.calibrate(record, explained_by=diagnosis.model_copy(update=only))
        for p in result.targets:
            assert p.low <= alone[p.symbol].low
            assert p.high >= alone[p.symbol].high


def unexplained(tmp_path) -> tuple[Session, Any, Any]:
    """Return a session with a quadratic effect, the file of its record, and a diagnosis that does not name it."""
    session, record = faint(3, QUADRATIC, (6e-4,))
    path = tmp_path / "r.csv"
    write_record(record, path)
    read = th.read_record(path)
    diagnosis = diagnosed(read)
    assert diagnosis.verdict == "explained"
    needed = [
        {"effects": (), "noise_bound": 6.1e-5, "option": "--noise-bound 6.1e-5"},
        {"effects": ({"effect": "quadratic", "where": "accelerometer-2"},), "noise_bound": 9.9e-6, "option": "x"},
        {"effects": ({"effect": "cubic", "where": "accelerometer-2"},), "noise_bound": 4e-5, "option": "y"},
    ]
    content = {**diagnosis.to_json(), "verdict": "unexplained", "causes": [], "explanations": [], "stands_with": needed}
    file = tmp_path / "d.json"
    file.write_text(json.dumps(content), encoding="utf-8")
    return session, read, file


@pytest.mark.acceptance
def test_an_unexplained_record_gives_estimates_without_effects_and_the_options_that_would_stand(tmp_path):
    _, record, file = unexplained(tmp_path)
    result = th.calibrate(record, explained_by=file)
    plain = th.calibrate(record, noise_bound=SIGMA)
    assert result.verdict == plain.verdict == "falsified"
    assert [p.estimate for p in result.parameters] == [p.estimate for p in plain.parameters]
    assert "names no effect" in result.warnings[0]
    assert "--noise-bound 6.1e-5 with no effect" in result.warnings[0]


@pytest.mark.acceptance
def test_an_unexplained_record_is_calibrated_with_the_sets_that_stand_with_a_given_sigma(tmp_path):
    session, record, file = unexplained(tmp_path)
    one: Any = th.calibrate(record, explained_by=file, noise_bound=1e-5)
    assert [entry.effects for entry in one.sets] == [["quadratic accelerometer-2"]]
    assert missed(one, session) == []
    (size,) = one.effects[0].parameters
    assert size.low <= 6e-4 <= size.high


@pytest.mark.acceptance
def test_a_falsified_calibration_states_the_option_with_which_it_stands():
    for seed in range(6):
        _, record = faint(seed, QUADRATIC, (3e-4,))
        result = th.calibrate(record, noise_bound=SIGMA)
        assert result.verdict == "falsified"
        assert f"The model would stand with `{result.option_to_stand}`." in str(result)
        assert "No estimate" not in str(result)
        bound = float(result.option_to_stand.removeprefix("--noise-bound "))
        assert th.calibrate(record, noise_bound=bound).verdict == "consistent"
        assert th.calibrate(record, noise_bound=0.97 * bound).verdict == "falsified"


def test_a_consistent_diagnosis_is_no_hindrance():
    rng = np.random.default_rng(1)
    record = Session.drawn(rng, 20).record((), rng.uniform(-SIGMA, SIGMA, (20, 3)))
    result = th.calibrate(record, explained_by=diagnosed(record))
    assert result.verdict == "consistent"
    assert "names no effect" in result.warnings[0]
    assert result.targets[0].low == th.calibrate(record, noise_bound=SIGMA).targets[0].low


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(6))
def test_with_the_option_of_an_effect_the_record_stands_with_it(seed):
    rng = np.random.default_rng([seed, 46])
    session = Session.drawn(rng, 24)
    hidden = [(QUADRATIC, (9e-5,)), (EffectPlace("cubic", "accelerometer-1"), (-9e-5,)), (DRIFT, (8e-5,))]
    record = session.record(hidden, rng.uniform(-SIGMA, SIGMA, (24, 3)))
    diagnosis = diagnosed(record).model_copy(update={"made_of": record})
    if diagnosis.verdict != "unexplained":
        pytest.skip(f"the draw is {diagnosis.verdict}")
    alone, *others = diagnosis.stands_with
    assert others
    assert th.calibrate(record, noise_bound=float(alone.option.split()[1])).verdict == "consistent"
    for entry in others:
        bound = float(entry.option.split()[1])
        result = th.calibrate(record, explained_by=diagnosis, noise_bound=bound)
        assert result.verdict == "consistent"
        assert [effect.title for effect in entry.effects] in [one.effects for one in result.sets]
