"""Faults of a record that a diagnosis names: the calibration beside them holds the truth, with close bounds."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import trihedron as th
from diagnoses import diagnosed
from field_files import field_file
from generator import SIGMA
from generator.broken import NUMBERS, changed, joined_readings, sizes
from generator.carried import strapdown_record
from generator.positions import Session, errors
from generator.wrong_rows import SPOILED
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded.work import Work
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.records import PositionRecord, write_record
from trihedron.tools.sieve.breaks import BreakSearch

COUNT = 40
SEEDS = [seed if seed < 5 else pytest.param(seed, marks=pytest.mark.acceptance) for seed in range(COUNT)]
SYMBOLS = ("X1", "X3", "X4", "X9", "X15", "X6+X8", "X11+X13", "X13", "X16", "X18")
KINDS = ("row", "stretch", "break", "row and effect", "break and row")
PARTS = {
    "biases": ("bias_",),
    "scale factors": ("scale_factor_",),
    "outer zero": ("alpha_zero_",),
    "biases and mounting": ("bias_", "mounting_"),
}
"""Changes that are in no catalogue, with the beginnings of their parts' keys."""
EFFECT = EffectPlace("quadratic", "accelerometer-2")


@dataclass(frozen=True)
class Faulty:
    """A record with faults, its diagnosis, the true parameters before any break, and the target known worst."""

    record: PositionRecord
    diagnosis: Any
    truth: dict[str, float]
    after: dict[str, float]
    worst: str


def worst_errors(session: Session, places: Sequence[EffectPlace], kept: np.ndarray, symbol: str) -> np.ndarray:
    """Return errors (N, 3) of ±σ by which a target is known worst beside effects, from the kept rows; 0 of others."""
    model = bench_evidence(session.record(), noise_bound=SIGMA).model
    readings = np.repeat(kept, 3)
    columns = np.hstack((model.rows.nominal, model.columns_of(list(places))))[readings]
    wanted = np.zeros(columns.shape[1])
    wanted[list(model.here.symbols).index(symbol)] = 1.0
    both = np.hstack((columns.T, -columns.T))
    scale = np.abs(both).max(axis=1)
    weights = linprog(np.ones(both.shape[1]), A_eq=both / scale[:, None], b_eq=wanted / scale).x
    error = np.zeros(len(readings))
    error[readings] = SIGMA * np.sign(np.round(weights[: len(columns)] - weights[len(columns) :], 9))
    return error.reshape(-1, 3)


def drawn(kind: str, rng: np.random.Generator) -> Faulty:
    """Return a record of a kind, with errors that are the worst for one target, and its diagnosis."""
    count = 48
    session, symbol = Session.drawn(rng, count), str(rng.choice(SYMBOLS))
    hidden = [(EFFECT, (float(rng.choice([-1.0, 1.0]) * rng.uniform(25.0, 60.0) * SIGMA),))] if "effect" in kind else []
    kept, stand, row = np.full(count, True), session.stand, int(rng.integers(count // 5, count - count // 5))
    places = [place for place, _ in hidden]
    angles, reading = session.read(hidden)
    if "break" in kind:
        group = str(rng.choice(list(PARTS)))
        stand = changed(stand, group, sizes(rng, NUMBERS.get(group, 1), 15.0), rng)
        reading = joined_readings(session, [stand], [row])
        search = BreakSearch(bench_evidence(session.record(), noise_bound=SIGMA), Work())
        (gap,) = [gap for gap in search.gaps if gap.after == row]
        parts = {part for one in search.every_group for part in one.parts if part.key.startswith(PARTS[group])}
        places += [part.jumping(gap.hours) for part in parts]
    if "row" in kind:
        wrong = int(rng.choice(np.setdiff1d(np.arange(count), [row - 1, row])))
        SPOILED[str(rng.choice(["angle", "angles exchanged", "disturbed"] if kind == "row" else ["disturbed"]))](
            angles, reading, wrong, rng
        )
        kept[wrong] = False
    if kind == "stretch":
        window = slice(row, row + 8)
        reading[window] = reading[window][:, [1, 0, 2]]
        kept[window] = False
    error = worst_errors(session, places, kept, symbol)
    error[error == 0.0] = errors(rng, count)[0][error == 0.0]
    record = session.recorded(angles, reading + error)
    diagnosis = diagnosed(record).model_copy(update={"made_of": record})
    return Faulty(record, diagnosis, session.stand.targets(), stand.targets(), symbol)


@cache
def faulty(seed: int) -> Faulty:
    """Return the first record of a seed whose diagnosis names faults."""
    kind = KINDS[seed % len(KINDS)]
    for attempt in range(12):
        case = drawn(kind, np.random.default_rng([seed, attempt, 42]))
        best = case.diagnosis.best
        named = case.diagnosis.verdict == "explained"
        if (
            named
            and best is not None
            and best.kind == {"row": "rows", "stretch": "stretch", "row and effect": "rows"}.get(kind, "break")
        ):
            return case
    raise AssertionError(f"{kind} is not named with seed {seed}")


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_every_true_parameter_lies_in_its_interval(seed):
    case = faulty(seed)
    result: Any = th.calibrate(case.record, explained_by=case.diagnosis)
    assert result.verdict == "consistent"
    assert result.sigma.kind == "bound"
    for symbol, value in case.truth.items():
        assert result[symbol].low <= value <= result[symbol].high, symbol
    after = [p for effect in result.effects for p in effect.parameters if p.name.endswith("after the break")]
    for parameter in after:
        assert parameter.low <= case.after[parameter.symbol] <= parameter.high, parameter
    named = case.diagnosis.best.change if case.diagnosis.best.kind == "break" else {}
    assert bool(after) == any(key.startswith(("bias", "scale")) for key in named)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_errors_of_one_bound_nearly_attain_the_interval(seed):
    case = faulty(seed)
    known: Any = th.calibrate(case.record, explained_by=case.diagnosis)[case.worst]
    value = case.truth[case.worst]
    assert min(abs(known.low - value), abs(known.high - value)) <= 0.05 * known.guaranteed_error
    assert abs(known.a_priori - value) <= known.guaranteed_error * 1.001


def noisy(seed: int, larger: float = 1.0, count: int = 40) -> tuple[Session, np.ndarray, np.ndarray]:
    """Return a drawn session with its angles, and readings whose errors are larger than σ by a factor."""
    rng = np.random.default_rng([seed, 420])
    session = Session.drawn(rng, count)
    return session, *session.read([], larger * rng.uniform(-SIGMA, SIGMA, (count, 3)))


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", range(3))
def test_a_larger_noise_bound_that_a_diagnosis_names_is_no_bound(seed):
    session, angles, reading = noisy(seed, 1.7)
    record = session.recorded(angles, reading)
    diagnosis = diagnosed(record).model_copy(update={"made_of": record})
    assert diagnosis.best.kind == "sigma"
    result: Any = th.calibrate(record, explained_by=diagnosis)
    assert result.verdict == "consistent"
    assert result.sigma.kind == "estimated"
    assert result.noise_bound == pytest.approx(diagnosis.best.change["noise_bound"])
    assert "guaranteed" not in str(result)
    given: Any = th.calibrate(record, explained_by=diagnosis, noise_bound=2.0 * SIGMA)
    assert (given.sigma.kind, given.noise_bound) == ("bound", 2.0 * SIGMA)
    for symbol, value in session.stand.targets().items():
        assert given[symbol].low <= value <= given[symbol].high


@pytest.mark.acceptance
def test_a_file_is_calibrated_without_the_rows_that_the_diagnosis_of_that_file_names(tmp_path):
    session, angles, reading = noisy(7)
    angles[12, 0] += 0.007
    path, diagnosis = tmp_path / "measured.csv", tmp_path / "diagnosis.json"
    write_record(session.recorded(angles, reading), path)
    diagnosis.write_text(json.dumps(th.diagnose(path, noise_bound=SIGMA).to_json()), encoding="utf-8")
    result: Any = th.calibrate(path, explained_by=diagnosis)
    assert result.positions == 39
    assert "without row 13, as the diagnosis names: Row 13 is wrong" in result.warnings[0]
    assert [line for line in result.to_json()["warnings"] if "row 13" in line]
    for symbol, value in session.stand.targets().items():
        assert result[symbol].low <= value <= result[symbol].high


@pytest.mark.acceptance
def test_a_diagnosis_that_was_edited_is_refused():
    session, angles, reading = noisy(7, 1.7)
    record = session.recorded(angles, reading)
    diagnosis = diagnosed(record).model_copy(update={"made_of": record})
    for changed_to, words in (({}, "its value is None"), ({"noise_bound": -1.0}, "its value is -1.0")):
        best = diagnosis.best.model_copy(update={"change": changed_to})
        with pytest.raises(InputError, match=words):
            th.calibrate(record, explained_by=diagnosis.model_copy(update={"explanations": (best,)}))
    rows = diagnosis.best.model_copy(update={"kind": "rows", "rows": (41,), "change": {}})
    with pytest.raises(InputError, match="names row 41, which record does not have"):
        th.calibrate(record, explained_by=diagnosis.model_copy(update={"explanations": (rows,)}))


@pytest.mark.acceptance
def test_rows_of_one_record_are_not_left_out_of_another():
    session, angles, reading = noisy(8)
    right = session.recorded(angles.copy(), reading)
    angles[12, 0] += 0.007
    wrong = session.recorded(angles, reading)
    diagnosis = diagnosed(wrong).model_copy(update={"made_of": wrong})
    with pytest.raises(InputError, match="is another record than the one that was diagnosed"):
        th.calibrate(right, explained_by=diagnosis)


@pytest.mark.acceptance
def test_what_names_nothing_says_the_way_on():
    session, angles, reading = noisy(9)
    record = session.recorded(angles, reading)
    result = th.calibrate(record, explained_by=diagnosed(record))
    assert result.verdict == "consistent"
    assert result.warnings[0] == "the diagnosis is consistent and names no effect: calibrated without it"


@pytest.mark.acceptance
def test_a_strapdown_record_is_calibrated_beside_an_effect_of_its_gyros():
    bias = np.array([2e-3, -1e-3, 1.5e-3])
    sensitivity = 1.5e-3 * np.random.default_rng(3).uniform(-1.0, 1.0, (3, 3))
    record = strapdown_record(seed=3, gyro_bias=bias, sensitivity=sensitivity)
    diagnosis = diagnosed(record).model_copy(update={"made_of": record})
    result: Any = th.calibrate(record, explained_by=diagnosis)
    assert result.verdict == "consistent"
    for k in range(3):
        parameter = result[f"gyro bias_{k + 1}"]
        assert parameter.low <= bias[k] <= parameter.high
    (effect,) = result.effects
    assert effect.effect == "gyro-g-sensitivity gyro-block"
    for parameter, value in zip(effect.parameters, sensitivity.ravel(), strict=True):
        assert parameter.low <= value <= parameter.high
    assert "gyro-g-sensitivity" in str(result)
    with pytest.raises(InputError, match="targets: is of a record of a table"):
        th.calibrate(record, explained_by=diagnosis, targets=["X4-X5"])


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [7, 8, 9])
def test_a_bench_record_is_calibrated_beside_a_drift_of_its_gyros(tmp_path, capsys, seed):
    path, answer, diagnosis_file = (tmp_path / name for name in ("bench.csv", "answer.json", "diagnosis.json"))
    hidden = ["--bench", "--seed", str(seed), "--effects", "gyro-bias-drift", "--answer", str(answer)]
    assert main(["hidden", str(path), *hidden]) == 0
    assert main(["diagnose", str(path), "--noise-bound", "1e-5", "--json", str(diagnosis_file)]) == 0
    result: Any = th.calibrate(path, explained_by=diagnosis_file)
    truth = json.loads(answer.read_text(encoding="utf-8"))
    for name, value in truth["hidden"]["parameters"].items():
        (parameter,) = [p for p in result.effects[0].parameters if p.name == name]
        assert parameter.low <= value <= parameter.high
    for k, value in enumerate(truth["truth"]["GyroBlock"]["bias"], start=1):
        assert result[f"B{k}"].low <= value <= result[f"B{k}"].high
    for k, value in enumerate(truth["truth"]["AccelerometerBlock"]["bias"], start=16):
        assert result[f"X{k}"].low <= value <= result[f"X{k}"].high
    assert "The gyros" in str(result)


@pytest.mark.acceptance
def test_an_effect_in_motion_is_calibrated_or_said_to_be_left_out(tmp_path):
    path = field_file("b4_bench_lag.csv", tmp_path)
    diagnosis = th.diagnose(path, noise_bound=1e-5)
    assert [cause.effect for cause in diagnosis.causes] == ["accelerometer-lag"]
    with_gyros: Any = th.calibrate(path, explained_by=diagnosis)
    assert with_gyros.verdict == "consistent"
    assert with_gyros.effects[0].parameters[0].low > 0.0
    at_rest: Any = th.calibrate(path, explained_by=diagnosis, targets=["X4-X5"])
    assert "acts on no reading at rest, and is left out" in at_rest.warnings[0]
