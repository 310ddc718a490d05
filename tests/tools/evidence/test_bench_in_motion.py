"""A whole bench diagnosed: effects on the turns, two witnesses of one cause, output at a terminal."""

import re
import shutil
from dataclasses import replace
from functools import cache
from unittest import mock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trihedron.models.bench import moments_of
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.models.effects.formula import Formula
from trihedron.tools.bounded import Work, chebyshev_radius
from trihedron.tools.calibration import UNTOLD, fit_record, fit_whole
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import Diagnosis
from trihedron.tools.diagnosis.dependence import dependence
from trihedron.tools.diagnosis.hypothesis import answered, places_of
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import Form, Travel, bench_in_motion, whole_evidence
from trihedron.tools.evidence.bench_in_time import simulated_turns
from trihedron.tools.evidence.observation import approached
from trihedron.tools.evidence.rows import reading_at
from trihedron.tools.records import BenchRecord, PositionRecord, write_record
from trihedron.tools.trials import Hidden, TrialBench, draw_whole

SIGMA = 1e-5
HARMONIC = EffectPlace("encoder-harmonic", "outer-axis", 3)
UNDERSAMPLING = EffectPlace("undersampling", "attitude-computer")


@cache
def bench() -> TrialBench:
    drawn = draw_whole(np.random.default_rng([5, 5]))
    return replace(drawn, alpha=drawn.alpha[-28:], beta=drawn.beta[-28:])


def measured(*hidden: Hidden) -> PositionRecord:
    return bench().measured(5, None, hidden)


@pytest.fixture(scope="module")
def clean():
    record = approached(measured(), 1e-4)
    fit = fit_whole(fit_record(record, SIGMA), record, bench().place, SIGMA)
    assert isinstance(record.raw, BenchRecord)
    return fit, Travel.of(record.raw, fit, bench().place.encoder_within(SIGMA), 9.80665)


@pytest.mark.acceptance
def test_the_extended_gyro_block_gives_the_record_again(clean):
    """Its FMU, driven by the table's motion with the hidden effects, integrates like the record's gyros."""
    fit, _ = clean
    rate_squared = EffectPlace("gyro-rate-squared", "gyro-block")
    hidden = Hidden(HARMONIC, (6e-5, 1.0)), Hidden(rate_squared, (2e-4, -1e-4, 5e-5))
    record = approached(measured(*hidden), 1e-4)
    raw = record.raw
    assert isinstance(raw, BenchRecord)
    moved = fit_whole(fit_record(record, SIGMA), record, bench().place, SIGMA)
    travel = Travel.of(raw, moved, bench().place.encoder_within(SIGMA), 9.80665)
    sizes = {HARMONIC: 6e-5 * np.array([np.cos(1.0), np.sin(1.0)]), rate_squared: np.array(hidden[1].values)}
    bound = moved.bound[len(moved.reading) * 3 :].reshape(-1, 3)
    for effects, least, most in ((sizes, 0.0, 1.0), ({}, 3.0, np.inf)):
        integrals = simulated_turns(raw, moved, travel, fit.point, effects)
        worst = np.abs((moved.turns.integral - integrals) / bound).max()
        assert least <= worst <= most


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("place", "values"),
    [
        (EffectPlace("axis-wobble", "inner-axis", 2), (1e-4, 0.4, 7e-5, -1.0)),
        (EffectPlace("encoder-harmonic", "inner-axis", 3), (1e-4, 2.0)),
        (EffectPlace("backlash", "outer-axis"), (1e-4,)),
        (EffectPlace("gyro-rate-squared", "gyro-block"), (2e-4, -1e-4, 5e-5)),
        (UNDERSAMPLING, (0.5,)),
    ],
    ids=lambda value: value.title if isinstance(value, EffectPlace) else "",
)
def test_turns_change_as_the_extended_components_say(clean, place, values):
    """With the same seed, the gyros' integrals with and without the effect differ by the columns, to second order."""
    fit, travel = clean
    record = approached(measured(Hidden(place, values)), 1e-4)
    moved = fit_whole(fit_record(record, SIGMA), record, bench().place, SIGMA).turns
    targets, gyros = fit.parametrisation.selection[0] @ fit.point[: fit.own], fit.point[fit.own :]
    observed = moved.residual(targets, gyros) - fit.turns.residual(targets, gyros)
    coefficients = values
    if place.definition.parameters[0].name.endswith("amplitude"):
        pairs = np.reshape(values, (-1, 2))
        coefficients = np.stack([pairs[:, 0] * np.cos(pairs[:, 1]), pairs[:, 0] * np.sin(pairs[:, 1])], 1).ravel()
    predicted = travel.columns(place) @ np.asarray(coefficients)
    assert np.abs(predicted).max() > 5e-5
    assert np.abs(observed - predicted).max() < 0.02 * np.abs(predicted).max()


def test_turns_from_row_to_row_hold_the_coning_that_increments_lack(clean):
    """A computer that takes rates' integrals for the body's turns lacks 1/12 of γ' × γ.

    Angles at rows show it about the inner axis: the addition of accelerating axes within a row is across.
    """
    fit, travel = clean
    record = measured().raw
    assert isinstance(record, BenchRecord)
    alpha, beta = np.unwrap(record.alpha), np.unwrap(record.beta)
    body = Rotation.from_euler("XZ", np.stack([alpha, beta], axis=1))
    turns = (body[:-1].inv() * body[1:]).as_rotvec()
    integrals = np.diff(moments_of(record.time_s, alpha, beta)[:, :4], axis=0)[:, [0, 1, 3]] * [1.0, -1.0, 1.0]
    lacks = np.vstack([np.zeros(3), np.cumsum(turns - integrals, axis=0)])
    observed = (lacks[fit.turns.last] - lacks[fit.turns.first])[:, 2]
    predicted = -travel.columns(UNDERSAMPLING).reshape(-1, 3)[:, 2] / 12.0
    assert np.abs(observed).max() > 5e-5
    assert np.abs(observed - predicted).max() < 0.02 * np.abs(observed).max()


@pytest.fixture(scope="module")
def faultless():
    return whole_evidence(measured(), bench().place, noise_bound=SIGMA).model


@pytest.mark.first(1)
@pytest.mark.parametrize("effect", ["backlash", "hysteresis"])
def test_a_sense_is_that_of_the_last_move_in_motion_too(faultless, effect):
    """With true sizes the readings stand if one axis comes before the other, and as an input passes its largest.

    If the sense is unknown, an error may be as large as the effect, and only there.
    """
    places = CATALOGUE[effect].places
    evidence = whole_evidence(measured(*(Hidden(place, (1e-4,)) for place in places)), bench().place, noise_bound=SIGMA)
    sizes, point = np.full(len(places), 1e-4), faultless.point
    before = np.abs(faultless.at((), point, np.zeros(0))[0][: faultless.of_readings]).max()
    for coefficients, stands in ((sizes, True), (-sizes, False), (0.0 * sizes, False)):
        residual, _, rate = (
            values[: evidence.model.of_readings] for values in evidence.model.at(places, point, coefficients)
        )
        assert (np.abs(residual) <= before + 0.1 + rate[:, len(point) :] @ sizes).all() == stands
    assert evidence.model.moving.read.contexts.sense_told.mean() > 0.7


@pytest.mark.acceptance
def test_a_reading_in_motion_says_nothing_where_its_input_may_change_its_sign(faultless):
    """As the table turns about an accelerometer its input stays near zero: effects of its sign are unknown."""
    places, sizes = CATALOGUE["bias-asymmetry"].places, np.full(3, 1e-3)
    evidence = whole_evidence(measured(*(Hidden(place, (1e-3,)) for place in places)), bench().place, noise_bound=SIGMA)
    residual = evidence.model.at(places, faultless.point, sizes)[0][: evidence.model.of_readings].reshape(-1, 3)
    untold = evidence.model.moving.seen.bound == UNTOLD
    # A bound of noise, and the errors of the encoder and of a parabola.
    assert np.abs(residual).max() < 1.5
    assert untold.sum() > 3
    assert (np.abs(evidence.model.moving.read.contexts.n) < 0.02)[untold].all()


@pytest.mark.acceptance
def test_a_harmonic_of_an_encoder_has_two_witnesses(tmp_path, monkeypatch, capsys):
    """The harmonic is named at a terminal with page and components; each witness alone agrees."""
    monkeypatch.chdir(tmp_path)
    record = measured(Hidden(HARMONIC, (6e-5, 1.0)))
    assert record.raw is not None
    write_record(record.raw, tmp_path / "bench.csv")
    place = bench().place
    given_options = {
        "--latitude-deg": place.latitude_deg,
        "--azimuth-deg": place.azimuth_deg,
        "--gyro-noise": place.gyro_noise,
    }
    given_options |= {"--encoder-bound": place.encoder_bound, "--noise-bound": SIGMA}
    options = [text for name, value in given_options.items() for text in (name, str(value))]
    files = ["--json", "found.json", "--report", "found.html", "--export", "extended"]
    assert main(["diagnose", "bench.csv", *options, *files]) == 0
    printed = capsys.readouterr().out
    assert "the encoder of the outer axis errs by" in printed
    page = (tmp_path / "found.html").read_text(encoding="utf-8")
    assert "Turns, as the gyros saw them" in page
    witnesses = re.search(r"Two witnesses.*?radius (\S+) → (\S+); gyros.*?radius (\S+) → ([\d.]+\d)", page)
    assert witnesses is not None
    accelerometers, gyros = witnesses.groups()[:2], witnesses.groups()[2:]
    assert float(gyros[0]) > 1.5
    assert float(accelerometers[0]) > 1.5
    assert max(float(gyros[1]), float(accelerometers[1])) < 1.0
    assert (tmp_path / "extended" / "GyroCompensation.ssv").exists()
    diagnosis = Diagnosis.model_validate_json((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert [cause.place for cause in diagnosis.causes] == [HARMONIC]
    assert "place of accelerometer 3 along axis 3" in str(diagnosis.stated)
    (low, high), _ = diagnosis.causes[0].intervals
    assert low <= 6e-5 <= high
    assert main(["diagnose", "bench.csv", "--noise-bound", "1e-5", "--latitude-deg", "10"]) == 2
    shutil.copy("bench.csv", "again.csv")
    assert main(["diagnose", "bench.csv", "again.csv", *options]) == 2
    assert "--latitude-deg: is of one record; give one" in capsys.readouterr().err


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("place", "values"),
    [
        (EffectPlace("accelerometer-lag", "accelerometer-3"), (9e-5,)),
        (EffectPlace("accelerometer-lag", "accelerometer-1"), (6e-5,)),
        (EffectPlace("encoder-lag", "outer-axis"), (-6e-5,)),
    ],
    ids=lambda value: value.title if isinstance(value, EffectPlace) else "",
)
def test_what_only_motion_shows_is_named_with_its_size_inside(place, values):
    """The rests alone are consistent; the readings in motion are so only with the effects hidden in the components."""
    record = measured(Hidden(place, values))
    evidence = whole_evidence(record, bench().place, noise_bound=SIGMA)
    assert evidence.model.calibration.verdict == "consistent" or place.effect == "encoder-lag"
    assert evidence.model.falsified
    fit = evidence.model.refit([place])
    assert fit.radius <= 1.0
    for value, (low, high) in zip(values, fit.intervals()[0], strict=True):
        assert low <= value <= high
        assert high - low < 2.0 * abs(value)
    rivals = {EffectPlace("accelerometer-lag", f"accelerometer-{p}") for p in (1, 2, 3)} - {place}
    assert all(evidence.model.refit([rival]).radius > 1.0 for rival in rivals)


@pytest.mark.first(1)
@pytest.mark.parametrize(("late", "squared"), [(6e-4, 1e-4), (1e-7, 2e-3), (6e-4, 0.0)])
def test_the_radius_of_the_verdict_is_that_of_the_witness_that_errs_most(late, squared):
    """Accelerometers show that one of them is late, gyros a square of rates; both may falsify the model."""
    hidden = [Hidden(EffectPlace("accelerometer-lag", "accelerometer-2"), (late,))]
    hidden.append(Hidden(EffectPlace("gyro-rate-squared", "gyro-block"), (squared, 0.0, -squared)))
    reader = whole_evidence(measured(*hidden), bench().place, noise_bound=SIGMA).reader
    assert isinstance(reader, bench_in_motion.WholeReader)
    turns = reader.turns_of(None)
    assert turns is not None
    alone = [before for before, _ in turns.alone]
    assert [radius > 1.0 for radius in alone] == [late > 1e-5, squared > 0.0]
    assert turns.readings > len(reader.numbers)
    # An error of accelerometers is none of turns.
    assert (np.abs(turns.before).max() > 2.0) == (squared > 0.0)
    calibration = reader.calibration_of(None)
    assert calibration.verdict == "falsified"
    assert calibration.radius is not None
    # Each witness alone is judged by the linear model.
    assert max(alone) <= calibration.radius * (1.0 + 1e-3)


def bumped(size: float) -> Hidden:
    """Return a bench whose outer encoder errs only near 2 rad."""
    knots = np.round(np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False), 6)
    values = size * np.exp(-0.5 * ((knots - 2.0) / 0.4) ** 2)
    law = f"alpha around {' '.join(map(repr, knots.tolist()))}"
    return Hidden(EffectPlace("lookup", "outer-axis", law=law), tuple(values.tolist()))


def of_formula(text: str, size: float) -> Hidden:
    place = Formula.of(text).place
    assert place is not None
    return Hidden(place, (size,))


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("hidden", "where", "quantity"),
    [
        (of_formula("w3 += c*w3**5", 2e-4), "gyro-3", "w3"),
        pytest.param(bumped(8e-5), "outer-axis", "alpha", marks=pytest.mark.acceptance),
        pytest.param(of_formula("f1 += c*n1**5", 1.5e-4), "accelerometer-1", "n1", marks=pytest.mark.acceptance),
        pytest.param(of_formula("w1 += c*sin(6*w1)", 6e-5), "gyro-1", "w1", marks=pytest.mark.acceptance),
        pytest.param(of_formula("f2 += c*sin(5*n2)", 1e-4), "accelerometer-2", "n2", marks=pytest.mark.acceptance),
    ],
    ids=("fifth power of a rate", "bump", "fifth power of an input", "sine of a rate", "sine of an input"),
)
def test_what_no_catalogue_lists_has_its_place_and_quantity_proven(hidden, where, quantity):
    """The proof is the hidden fault; accelerometers and gyros alike sense a table's cause."""
    evidence = whole_evidence(measured(hidden), bench().place, noise_bound=SIGMA)
    function = dependence(evidence)
    assert function is not None
    assert function.proven is not None
    assert (function.place, function.proven.pair.quantity) == (where, quantity)
    alone = evidence.model.of_readings
    columns = np.abs(function.proven.pair.columns(function.proven.form)).max(axis=1)
    observed = columns > 1e-4 * columns.max()
    assert observed[:alone].any() == (not where.startswith("gyro"))
    assert observed[alone:].any() == (not where.startswith("accelerometer"))


@pytest.mark.acceptance
def test_of_what_one_move_alone_shows_no_quantity_is_proven():
    """For a small sine, one slow turn alone misfits, and a jump of a product of rates mends it with fewest numbers."""
    evidence = whole_evidence(measured(of_formula("w1 += c*sin(6*w1)", 5e-5)), bench().place, noise_bound=SIGMA)
    function = dependence(evidence)
    assert function is not None
    assert function.place == "gyro-1"
    assert function.proven is None
    assert "hours" in function.quantities


@pytest.mark.acceptance
def test_a_formula_of_a_gyro_stands_or_is_refuted():
    """The hidden formula stands with its number inside; for another gyro, or an accelerometer, it does not."""
    hidden = of_formula("w3 += c*w3**5", 2e-4)
    evidence = whole_evidence(measured(hidden), bench().place, noise_bound=SIGMA)
    texts = ("w3 += c*w3**5", "w1 += c*w1**5", "f1 += c*n1**5")
    places = places_of(texts, at_table=True, with_gyros=True)
    true, *false_answers = (answered(evidence, place, (), rerun=False) for place in places)
    assert true.answer == "stands"
    (parameter,) = true.parameters
    assert parameter.low is not None
    assert parameter.high is not None
    assert parameter.low <= 2e-4 <= parameter.high
    assert [answer.answer for answer in false_answers] == ["refuted", "refuted"]


def test_a_formula_is_of_what_the_record_has():
    with pytest.raises(InputError, match="w1 is of a strapdown record, or of a bench record whose place is given"):
        places_of(["w1 += c*w1**3"], at_table=True, with_gyros=False)
    assert len(places_of(["w1 += c*w1**3", "alpha += c*sin(3*alpha)"], at_table=True, with_gyros=True)) == 2


@pytest.mark.acceptance
def test_functions_of_a_pair_are_the_columns_of_the_catalogue():
    """Compare functions at nodes with effects at every row, for the table on readings and on turns."""
    evidence = whole_evidence(measured(), bench().place, noise_bound=SIGMA)
    pairs = {(pair.where, pair.name): pair for pair in evidence.reader.pairs}
    harmonic, alpha_pair = evidence.rows.columns_of([HARMONIC]), pairs["outer-axis", "alpha"]
    # The true angle is the reading less the encoder's error; an effect uses its sine first.
    by_functions = -alpha_pair.columns(Form("harmonic", 3))[:, ::-1]
    squared = evidence.rows.columns_of([EffectPlace("gyro-rate-squared", "gyro-block")])[:, 1]
    rate = pairs["gyro-2", "w2"]
    for theirs, ours in ((harmonic, by_functions), (squared, rate.spread(rate.values[:, None] ** 2)[:, 0])):
        assert np.abs(theirs - ours).max() <= 3e-3 * np.abs(theirs).max()


@pytest.mark.acceptance
def test_no_reading_in_motion_is_off_by_itself():
    """Beside an effect that is not linear one was a candidate, and then had no position number."""
    evidence = whole_evidence(measured(), bench().place, noise_bound=SIGMA)
    still, moving = (
        reading_at(int(np.flatnonzero(evidence.model.moving.at_rest == at)[0]) * 3) for at in (True, False)
    )
    hysteresis = EffectPlace("hysteresis", "accelerometer-2")
    sets = [(hysteresis, still), (hysteresis, moving)]
    patch = mock.patch.object
    with (
        patch(bench_in_motion, "sets_of_size", return_value=[]),
        patch(type(evidence.model), "_turns_allow", return_value=True),
        patch(type(evidence.model.moving.read.search), "candidates", return_value=sets),
    ):
        candidates = list(evidence.model.candidates(2, Work()))
    assert (hysteresis, still) in candidates
    assert (hysteresis, moving) not in candidates


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(6))
def test_of_a_gyro_that_swings_no_slow_temperature_is_proven_alone(seed):
    """It swings about twice as fast as the laboratory's temperature, whose functions are then nearly as simple."""
    rng = np.random.default_rng([75, 7 + seed])
    drawn, p, per_hour = draw_whole(rng), int(rng.integers(1, 4)), float(rng.uniform(11.0, 13.4))
    # Near the hour of the highest temperature.
    phase = 0.5 * np.pi - 2.0 * np.pi * per_hour / 24.0 + float(rng.uniform(-0.4, 0.4))
    place = Formula.of(f"w{p} += c*sin({2.0 * np.pi * per_hour:.4f}*hours + {phase:.3f})").place
    clean = whole_evidence(drawn.measured(75, seed), drawn.place, noise_bound=SIGMA)
    unit = clean.rows.columns_of([place])[:, 0]
    detection = 2.0 / chebyshev_radius(clean.rows.nominal, unit, np.ones(len(unit)))[0]
    hidden = Hidden(place, (detection * float(rng.uniform(1.5, 6.0)),))
    function = dependence(whole_evidence(drawn.measured(75, seed, (hidden,)), drawn.place, noise_bound=SIGMA))
    assert function is not None
    assert function.place in (f"gyro-{p}", None)
    assert function.proven is None or "hours" in function.quantities
