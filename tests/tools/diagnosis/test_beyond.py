"""Faults outside the catalogue: the band holds the truth, laws are named, the model is extended and exported."""

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from field_files import field_file
from generator import SIGMA
from generator import G as GRAVITY
from generator.positions import record_with
from generator.stands import random_bench, simulated
from generator.stands import record as position_record
from generator.unlisted import outside_case
from scenario_runs import run_of_file
from trihedron.models.effects import EffectPlace
from trihedron.models.effects.formula import Formula
from trihedron.models.effects.lookup import Table
from trihedron.tools.bounded import Work
from trihedron.tools.diagnosis import Beyond, Diagnosis, Possible, diagnose, export_extended
from trihedron.tools.diagnosis.dependence import NEAR, dependence
from trihedron.tools.evidence import Evidence, bench_evidence
from trihedron.tools.records import PositionRecord, read_record
from trihedron.tools.trials import NOISE_BOUND, draw_alone

COUNT = 36


def bench_of(seed: int, count: int = COUNT) -> tuple[np.random.Generator, np.ndarray, np.ndarray, np.ndarray]:
    """Return a generator, readings (N, 3) [g] of a bench at N random positions with noise, and their angles."""
    rng = np.random.default_rng([seed, 23])
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (count, 3))
    return rng, simulated(random_bench(rng), alpha, beta, noise).specific_force / GRAVITY, alpha, beta


def bump(angle: np.ndarray) -> np.ndarray:
    return 2e-4 * np.exp(-(((np.remainder(angle - 2.0 + np.pi, 2.0 * np.pi) - np.pi) / 0.8) ** 2))


@cache
def of_power(power: int) -> Beyond:
    """Return a record with a power of its own input in accelerometer 2."""
    _, reading, alpha, beta = bench_of(power)
    reading[:, 1] += 1.2e-4 * reading[:, 1] ** power
    return beyond_of(position_record(reading, alpha, beta))


def beyond_of(record: PositionRecord) -> Beyond:
    """Return the functions of the proven pair of a record, without the catalogue."""
    evidence = bench_evidence(record, noise_bound=NOISE_BOUND)
    function = dependence(evidence)
    assert function is not None
    assert function.proven is not None
    return Beyond(evidence, function.proven.pair, function.proven.form)


@cache
def of_bump() -> tuple[PositionRecord, Diagnosis]:
    """Return a record with an encoder that errs in one part of its circle."""
    _, reading, alpha, beta = bench_of(7)
    record = position_record(reading, np.remainder(alpha + bump(alpha), 2.0 * np.pi), beta)
    return record, diagnose(record, noise_bound=NOISE_BOUND)


def truth_and_ends(beyond: Beyond, truth) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the true function at the knots of the band, less the part that the model imitates; lower and upper
    ends."""
    possible, (band,) = beyond.possible, beyond.bands
    truths = possible.every.told(truth(possible.knots))
    at = np.array([knot["at"] for knot in band.knots])
    ends = np.array([(knot["low"], knot["high"]) for knot in band.knots])
    return truths[np.searchsorted(possible.knots, at)], ends[:, 0], ends[:, 1]


@pytest.mark.acceptance
@pytest.mark.parametrize("power", [3, 5])
def test_the_truth_is_in_the_band_and_among_the_laws(power: int):
    beyond = of_power(power)
    truth, low, high = truth_and_ends(beyond, lambda n: 1.2e-4 * n**power)
    room = 1e-9
    assert (low - room <= truth).all()
    assert (truth <= high + room).all()
    # It is a band: it excludes more than it contains.
    assert np.median(high - low) < np.ptp(truth)
    laws = {law.words: beyond.stated(law) for law in beyond.laws}
    law = laws[{3: "c n2³", 5: "c n2⁵"}[power]]
    assert law.intervals[0][0] <= 1.2e-4 <= law.intervals[0][1]
    assert Formula.of(law.law or "").place == law.place
    # Neighbouring powers cannot be separated at this size: none is named alone.
    assert len(laws) > 1
    (caution,) = beyond.caution
    assert "n2⁵" in caution


@cache
def with_temperature() -> Evidence:
    """Return a clean record with temperatures."""
    rng, reading, alpha, beta = bench_of(12)
    record = dataclasses.replace(position_record(reading, alpha, beta), temperature=rng.uniform(15.0, 30.0, COUNT))
    return bench_evidence(record, noise_bound=NOISE_BOUND)


def test_what_the_search_can_prove_a_table_says_with_a_kernel():
    """Test every place and quantity, with its factor; effects of a sense are in the catalogue."""
    evidence = with_temperature()
    pairs = [pair for pair in evidence.reader.pairs if not pair.told]
    assert {pair.factor for pair in pairs} >= {"sin alpha", "outer tilt", "tilt", "hours", "temperature", "n1", ""}
    for pair in pairs:
        possible = Possible(evidence, pair)
        knots = np.linspace(possible.knots[0], possible.knots[-1], 5)
        kind = "around" if pair.circle else "at"
        table = Table(pair.quantity.replace(" ", "*"), kind, tuple(knots.tolist()), pair.factor)
        place = EffectPlace("lookup", pair.where, law=table.law)
        of_kernel, proven = evidence.rows.columns_of([place]), possible.functions(knots).unknown.columns
        # A search takes factors over their largest value.
        scale = np.vdot(of_kernel, proven) / np.vdot(of_kernel, of_kernel)
        assert scale > 0.0
        assert np.abs(scale * of_kernel - proven).max() < 1e-9 * np.abs(proven).max()
        assert pair.factor in ("hours", "temperature") or scale == pytest.approx(1.0)
        assert place.definition.kernel is not None


@pytest.mark.acceptance
def test_where_every_error_is_at_its_bound_a_table_is_told_with_the_noise_bound_that_it_needs(tmp_path: Path):
    """No straight pieces fit a smooth function then; its intervals hold the truth, and it predicts."""
    case = outside_case(tmp_path, 17, 165)
    record = read_record(tmp_path / case.file)
    assert isinstance(record, PositionRecord)
    beyond = beyond_of(record)
    assert beyond.table is None
    assert [law for law in beyond.laws if not law.is_listed] == []
    extension = beyond.extension(rerun=True)
    assert extension is not None
    assert 1.0 < extension.radius < NEAR
    assert extension.noise_bound_needed is not None
    assert extension.noise_bound_needed == pytest.approx(extension.radius * SIGMA)
    assert extension.left_out_rms is not None
    assert extension.left_out_rms < 1.5
    assert extension.gain is not None
    assert extension.gain.held_out_rms_after < 1.5 * SIGMA
    # The table needs only a slightly larger bound; a slightly smaller one is too small.
    wider, narrower = (
        bench_evidence(record, noise_bound=extension.noise_bound_needed * part).model.mended([extension.place], Work())
        for part in (1.001, 0.999)
    )
    assert len(wider) == 1
    assert list(narrower) == []
    for value, (low, high) in zip(extension.values, extension.intervals, strict=True):
        assert low < value < high


@pytest.mark.acceptance
def test_a_function_times_a_sine_of_an_angle_is_told_by_its_formula_and_extends_the_model(tmp_path: Path):
    """The fault is an elastic turn about the inner axis by the load, twice a turn: a law outside the catalogue."""
    _, _, alpha, beta = bench_of(2)
    bench = random_bench(np.random.default_rng(2))
    turned = beta + 1.5e-4 * np.sin(alpha) * np.sin(2.0 * beta + 1.0)
    noise = np.random.default_rng(9).uniform(-NOISE_BOUND, NOISE_BOUND, (COUNT, 3))
    record = position_record(simulated(bench, alpha, turned, noise).specific_force / GRAVITY, alpha, beta)
    result = diagnose(record, noise_bound=NOISE_BOUND, rerun=False)
    assert result.proven is not None
    assert (result.proven.place, result.proven.on) == ("inner-axis", "sin alpha times beta")
    extension = result.extension
    assert extension is not None
    assert extension.kind == "formula"
    assert extension.law == "beta += sin(alpha) * (a * cos(2 * beta) + b * sin(2 * beta))"
    assert Formula.of(extension.law).law == extension.law
    # An encoder that reads too much turns the table too little.
    for (low, high), part in zip(extension.intervals, (np.sin(1.0), np.cos(1.0)), strict=True):
        assert low <= -1.5e-4 * part <= high
    export_extended(result, tmp_path)
    again = run_of_file(tmp_path / "scenario.toml").position_record()
    assert (
        np.abs(again.specific_force - record.specific_force).max()
        <= GRAVITY * NOISE_BOUND * result.evidence.model.limit
    )


@pytest.mark.acceptance
def test_without_a_proof_there_is_no_band():
    _, reading, alpha, beta = bench_of(11)
    clean = diagnose(position_record(reading, alpha, beta), noise_bound=NOISE_BOUND, rerun=False)
    assert (clean.verdict, clean.band, clean.laws, clean.extension) == ("consistent", None, None, None)


@pytest.mark.acceptance
def test_what_is_in_no_catalogue_extends_the_model_and_is_no_cause():
    _, result = of_bump()
    assert result.verdict == "unexplained"
    assert result.causes == ()
    extension = result.extension
    assert extension is not None
    assert (extension.where, extension.quantity, extension.kind) == ("outer-axis", "alpha", "lookup")
    assert extension.radius <= result.evidence.model.limit
    truth, low, high = truth_and_ends(result.beyond, bump)
    assert (low - 1e-7 <= truth).all()
    assert (truth <= high + 1e-7).all()
    # It predicts unused positions to within the noise.
    assert extension.left_out_rms is not None
    assert extension.left_out_rms < 1.5
    assert extension.gain is not None
    assert extension.gain.held_out_rms_after < 1.5 * NOISE_BOUND
    assert extension.gain.improves


@pytest.mark.acceptance
def test_at_its_knots_a_table_is_what_its_parameters_say_and_its_intervals_hold_the_truth():
    _, result = of_bump()
    extension = result.extension
    assert extension is not None
    assert extension.knots is not None
    stated = {knot["at"]: knot["estimate"] for knot in extension.knots}
    assert len(stated) == len(extension.parameters) + sum(value == 0.0 for value in stated.values())
    zero = next(at for at, value in stated.items() if value == 0.0)
    for knot in extension.knots:
        true = bump(np.array([knot["at"]]))[0] - bump(np.array([zero]))[0]
        # The bump is not a table: it bends between knots.
        assert knot["low"] is None or knot["low"] - 1.5e-5 <= true
        assert knot["high"] is None or true <= knot["high"] + 1.5e-5


def test_it_is_exported_and_run_gives_the_record_again(tmp_path: Path):
    record, result = of_bump()
    files = export_extended(result, tmp_path)
    assert {file.suffix for file in files} >= {".fmu", ".ssv", ".toml"}
    again = run_of_file(tmp_path / "scenario.toml").position_record()
    assert (
        np.abs(again.specific_force - record.specific_force).max()
        <= GRAVITY * NOISE_BOUND * result.evidence.model.limit
    )


@pytest.mark.acceptance
def test_a_person_may_have_the_model_extended_though_the_catalogue_has_a_cause():
    _, reading, alpha, beta = bench_of(3)
    reading[:, 1] += 1.2e-4 * reading[:, 1] ** 3
    record = position_record(reading, alpha, beta)
    result = diagnose(record, noise_bound=NOISE_BOUND, rerun=False, extend=True)
    assert result.alternatives
    assert result.extension is not None
    assert result.extension.kind in ("formula", "lookup")


@pytest.mark.acceptance
def test_where_a_ramp_begins_is_within_its_interval():
    _, reading, alpha, beta = bench_of(5)
    record = position_record(reading, alpha, beta)
    hours = (record.time_s - record.time_s[0]) / 3600.0
    start = 0.55 * hours[-1]
    reading[:, 0] += 2e-4 * np.maximum(0.0, hours - start) / (hours[-1] - start)
    record = dataclasses.replace(record, specific_force=GRAVITY * reading)
    ramps = [law.shape for law in beyond_of(record).laws if law.shape and law.words.startswith("c (")]
    assert any(low <= start <= high for low, high in ramps)


@pytest.mark.acceptance
def test_a_jump_in_temperature_is_told_where_it_is():
    rng, reading, alpha, beta = bench_of(6)
    record = position_record(reading, alpha, beta)
    temperature = np.round(23.0 + 4.0 * np.sin(np.linspace(0.0, 9.0, COUNT)) + rng.uniform(-0.5, 0.5, COUNT), 3)
    reading[:, 0] += 1.5e-4 * (temperature > 24.2)
    record = dataclasses.replace(record, specific_force=GRAVITY * reading, temperature=temperature)
    beyond = beyond_of(record)
    assert (beyond.possible.pair.where, beyond.possible.pair.quantity) == ("accelerometer-1", "temperature")
    (jump,) = [law for law in beyond.laws if law.shape and law.words.startswith("c step(")]
    assert jump.shape is not None
    assert jump.shape[0] <= 24.2 <= jump.shape[1]


def test_a_function_of_a_sense_has_no_formula():
    """Its two values have no order, so there is no formula of them; the catalogue's hysteresis is one."""
    case = draw_alone(1, effects=["hysteresis"])
    evidence = bench_evidence(case.measured(), noise_bound=NOISE_BOUND)
    pair = next(p for p in evidence.reader.pairs if p.told and p.where == case.places[0].where)
    beyond = Beyond(evidence, pair, next(iter(pair.ladders()))[0], (evidence.model.refit(case.places),))
    assert [law.fit.places for law in beyond.laws] == [tuple(case.places)]


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("x06_quintic_36.csv", "f1 += c * n1 ** 5"),
        pytest.param("f08_16.csv", "beta += a * cos(9 * beta) + b * sin(9 * beta)", marks=pytest.mark.acceptance),
    ],
)
def test_a_formula_of_fewer_numbers_comes_before_sets_of_the_catalogue(name, law, tmp_path):
    result = th.diagnose(field_file(name, tmp_path), noise_bound=SIGMA)
    assert (result.verdict, [cause.place.law for cause in result.causes]) == ("explained", [law])
    assert result.explanations[0].kind == "formula"
    assert all(other.numbers > result.explanations[0].numbers + 1 for other in result.explanations[1:])
    assert result.stated.verdict == "consistent"


@pytest.mark.acceptance
def test_a_square_of_temperature_is_the_effect_of_that_name(tmp_path):
    result = th.diagnose(field_file("x09_quadT_36.csv", tmp_path), noise_bound=SIGMA)
    (cause,) = result.causes
    assert (result.verdict, cause.place.title) == ("explained", "temperature-bias-quadratic accelerometer-2")
    assert cause.intervals[1][0] > 0.0
    assert "the coefficient at x²: 0.000776" in " ".join(str(result).split())


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [2, pytest.param(1, marks=pytest.mark.acceptance)])
def test_a_fifth_power_is_no_pair_of_other_laws(seed):
    """The quantity is certain even if other powers do as well, the power is not; no sum of two laws comes before."""
    record = record_with(seed, {"f2": lambda v: 2e-4 * v.n[:, 1] ** 5}, 36)
    result = diagnose(record, noise_bound=SIGMA, rerun=False)
    assert (result.verdict, result.level) == ("ambiguous", "quantity")
    assert "f2 += c * n2 ** 5" in {cause.place.law for causes in result.sets for cause in causes}
    assert {explanation.kind for explanation in result.explanations if explanation.numbers < 4} == {"formula"}
    assert "c * n2 ** 5" in str(result)
