"""Effects of a diagnosis and the parameters, solved in one programme: the intervals hold, and are no wider."""

import json
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import trihedron as th
from diagnoses import diagnosed
from generator import SIGMA
from generator.positions import Session, of_one_instrument
from trihedron.models.effects import EffectPlace
from trihedron.tools.errors import InputError
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.records import PositionRecord, write_record

COUNT = 40
SEEDS = [seed if seed < 4 else pytest.param(seed, marks=pytest.mark.acceptance) for seed in range(COUNT)]
SYMBOLS = ("X1", "X3", "X4", "X9", "X15", "X6+X8", "X11+X13", "X13", "X16", "X18")
QUADRATIC = EffectPlace("quadratic", "accelerometer-2")


@dataclass(frozen=True)
class Drawn:
    """A record with one effect and errors of ±σ that are the worst for one target; its diagnosis, and the truth."""

    record: PositionRecord
    diagnosis: Any
    truth: dict[str, float]
    place: EffectPlace
    worst: str


def drawn_effect(rng: np.random.Generator) -> tuple[EffectPlace, tuple[float, ...]]:
    """Draw an effect of 25 to 60 σ; those of a time or a temperature in their units."""
    p, size = int(rng.integers(1, 4)), float(rng.choice([-1.0, 1.0]) * SIGMA * rng.uniform(25.0, 60.0))
    block, phase = f"accelerometer-{p}", float(rng.uniform(0.0, 6.0))
    axis, others = str(rng.choice(["outer-axis", "inner-axis"])), tuple(sorted({1, 2, 3} - {p}))
    return (
        (EffectPlace("quadratic", block), (size,)),
        (EffectPlace("cubic", block), (size,)),
        (EffectPlace("cross-product", block, None, others), (size,)),
        (EffectPlace("bias-drift", block), (size,)),
        (EffectPlace("scale-drift", block), (size,)),
        (EffectPlace("temperature-bias", block), (size / 5.0,)),
        (EffectPlace("encoder-harmonic", axis, int(rng.integers(2, 5))), (abs(size), phase)),
        (EffectPlace("sag", "outer-axis"), (abs(size), phase)),
        (EffectPlace("bias-step", block), (size, 0.3)),
        (EffectPlace("outlier", "position-7", None, (p,)), (size,)),
    )[rng.integers(10)]


def worst_signs(record: PositionRecord, place: EffectPlace, symbol: str) -> np.ndarray:
    """Return the signs (N, 3) of the errors by which a target and an effect's sizes together are known worst; 0 of
    others."""
    model = bench_evidence(record, noise_bound=SIGMA).model
    columns = np.hstack((model.rows.nominal, model.columns_of([place])))
    wanted = np.zeros(columns.shape[1])
    wanted[list(model.here.symbols).index(symbol)] = 1.0
    both = np.hstack((columns.T, -columns.T))
    scale = np.abs(both).max(axis=1)
    weights = linprog(np.ones(both.shape[1]), A_eq=both / scale[:, None], b_eq=wanted / scale)
    phi = weights.x[: len(columns)] - weights.x[len(columns) :]
    return np.where(np.abs(phi) > 1e-9, np.sign(phi), 0.0).reshape(-1, 3)


@cache
def drawn(seed: int) -> Drawn:
    """Return the first record of a seed whose effect is explained."""
    for attempt in range(6):
        rng = np.random.default_rng([seed, attempt])
        place, sizes = drawn_effect(rng)
        session = Session.drawn(rng, 40)
        symbol = str(rng.choice(SYMBOLS))
        signs = rng.choice([-1.0, 1.0], (40, 3))
        if place.definition.linear and place.effect != "outlier":
            worst = worst_signs(session.record([(place, sizes)]), place, symbol)
            signs = np.where(worst != 0.0, worst, signs)
        record = session.record([(place, sizes)], SIGMA * signs)
        diagnosis = diagnosed(record).model_copy(update={"made_of": record})
        if diagnosis.verdict == "explained" and [cause.place for cause in diagnosis.causes] == [place]:
            return Drawn(record, diagnosis, session.stand.targets(), place, symbol)
    raise AssertionError(f"nothing explained with seed {seed}")


def missed(result: Any, truth: dict[str, float]) -> list[str]:
    """Return the targets whose intervals miss the truth."""
    return [symbol for symbol, value in truth.items() if not result[symbol].low <= value <= result[symbol].high]


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_every_true_target_lies_in_its_interval(seed):
    case = drawn(seed)
    result: Any = th.calibrate(case.record, explained_by=case.diagnosis)
    assert result.verdict == "consistent"
    assert result.sigma.kind == "bound"
    assert missed(result, case.truth) == []
    assert [effect.effect for effect in result.effects] == [case.place.title]


@pytest.mark.first(2)
@pytest.mark.parametrize("seed", SEEDS)
def test_every_true_target_lies_in_the_intervals_of_a_corrected_record(seed):
    case = drawn(seed)
    applied = th.apply(case.diagnosis, case.record)
    if applied.record is None:
        pytest.skip(f"{case.place.title} is not taken out of readings")
    assert missed(th.calibrate(applied.record, noise_bound=SIGMA), case.truth) == []


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_errors_of_one_bound_attain_what_is_guaranteed(seed):
    case = drawn(seed)
    if not case.place.definition.linear or case.place.effect == "outlier":
        pytest.skip(f"{case.place.title} is not linear in all its parameters: no errors are known to be its worst")
    known: Any = th.calibrate(case.record, explained_by=case.diagnosis)[case.worst]
    error = abs(known.a_priori - case.truth[case.worst])
    assert 0.97 * known.guaranteed_error <= error <= known.guaranteed_error * 1.001
    nearest = min(abs(known.low - case.truth[case.worst]), abs(known.high - case.truth[case.worst]))
    assert nearest <= 0.01 * known.guaranteed_error


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.acceptance) for seed in (2, 3, 5))])
def test_another_record_is_calibrated_within_the_intervals_of_the_effect(seed):
    monday, tuesday = of_one_instrument(seed, 2, positions=32, shared=[(QUADRATIC, (4e-4,))])
    diagnosis = diagnosed(monday)
    assert diagnosis.verdict == "explained"
    assert th.calibrate(tuesday, noise_bound=SIGMA).verdict == "falsified"
    bounded: Any = th.calibrate(tuesday, explained_by=diagnosis, noise_bound=SIGMA)
    assert bounded.verdict == "consistent"
    (size,) = bounded.effects[0].parameters
    assert size.low <= 4e-4 <= size.high
    of_tuesday = diagnosed(tuesday).model_copy(update={"made_of": tuesday})
    alone: Any = th.calibrate(tuesday, explained_by=of_tuesday)
    for symbol in ("X9", "X10", "X17"):
        assert alone[symbol].low - 1e-9 <= bounded[symbol].low
        assert bounded[symbol].high <= alone[symbol].high + 1e-9


@pytest.mark.acceptance
def test_a_file_is_calibrated_with_the_diagnosis_of_that_file(tmp_path):
    monday, _ = of_one_instrument(4, 2, positions=32, shared=[(QUADRATIC, (4e-4,))])
    path, diagnosis_file = tmp_path / "monday.csv", tmp_path / "diagnosis.json"
    write_record(monday, path)
    diagnosis_file.write_text(json.dumps(th.diagnose(path, noise_bound=SIGMA).to_json()), encoding="utf-8")
    result: Any = th.calibrate(path, explained_by=diagnosis_file, targets=["X9-X10"], convention="A2")
    assert result.verdict == "consistent"
    assert result.effects[0].parameters[0].low <= 4e-4 <= result.effects[0].parameters[0].high
    assert result["X9-X10"].determined
    assert "quadratic accelerometer-2" in str(result)
    assert "Levelling" not in str(result)
    applied: Any = th.apply(result, path)
    assert any("stays in the readings" in reason for reason in applied.not_guaranteed)


@pytest.mark.acceptance
def test_a_formula_is_solved_with_the_parameters():
    """A fifth power is in no catalogue; the diagnosis names it by a formula."""
    rng = np.random.default_rng(4)
    session = Session.drawn(rng, 40)
    angles, reading = session.read([], rng.uniform(-SIGMA, SIGMA, (40, 3)))
    n = session.stand.inputs(session.alpha, session.beta)
    reading[:, 0] += 3e-4 * n[:, 0] ** 5
    record = session.recorded(angles, reading)
    diagnosis = diagnosed(record).model_copy(update={"made_of": record})
    assert [cause.effect for cause in diagnosis.causes] == ["formula"]
    result: Any = th.calibrate(record, explained_by=diagnosis)
    assert missed(result, session.stand.targets()) == []
    size = result.effects[0].parameters[0]
    assert size.low <= 3e-4 <= size.high


@pytest.mark.acceptance
def test_what_cannot_be_solved_together_is_refused(tmp_path):
    case = drawn(0)
    calibration = tmp_path / "calibration.json"
    calibration.write_text(json.dumps(th.calibrate(case.record, noise_bound=SIGMA).to_json()), encoding="utf-8")
    with pytest.raises(InputError, match="is not a diagnosis"):
        th.calibrate(case.record, explained_by=calibration)
    outlier = EffectPlace("outlier", "position-7", None, (1,))
    rng = np.random.default_rng(5)
    record = Session.drawn(rng, 40).record([(outlier, (5e-4,))], rng.uniform(-SIGMA, SIGMA, (40, 3)))
    with pytest.raises(InputError, match="is of the record that was diagnosed"):
        th.calibrate(case.record, explained_by=diagnosed(record))
