"""A whole bench diagnosed: what effects do to the turns, two witnesses of one cause, at a terminal."""

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
from trihedron.tools.bounded.programmes import chebyshev_radius
from trihedron.tools.bounded.sets import Work
from trihedron.tools.calibration import UNTOLD, fit_record, fit_whole
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import Diagnosis
from trihedron.tools.diagnosis.dependence import dependence
from trihedron.tools.diagnosis.hypothesis import answered, places_of
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import bench_in_motion
from trihedron.tools.evidence.bench_again import simulated_turns
from trihedron.tools.evidence.bench_in_motion import whole_evidence
from trihedron.tools.evidence.observation import Travel, approached
from trihedron.tools.evidence.pairs import Form
from trihedron.tools.evidence.rows import reading_at
from trihedron.tools.records import BenchRecord, PositionRecord, write_record
from trihedron.tools.trials import Hidden, draw_whole
from trihedron.tools.trials.bench import TrialBench

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
    whole = fit_whole(fit_record(record, SIGMA), record, bench().place, SIGMA)
    assert isinstance(record.raw, BenchRecord)
    return whole, Travel.of(record.raw, whole, bench().place.encoder_within(SIGMA), 9.80665)


def test_the_extended_gyro_block_gives_the_record_again(clean):
    """Its FMU, driven by the table's motion with what was hidden, integrates as the record's gyros did."""
    whole, _ = clean
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
        read = simulated_turns(raw, moved, travel, whole.point, effects)
        left = np.abs((moved.turns.integral - read) / bound).max()
        assert least <= left <= most


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
    """The same seed, with the effect and without: what the gyros integrate differs by the columns, to second order."""
    whole, travel = clean
    record = approached(measured(Hidden(place, values)), 1e-4)
    moved = fit_whole(fit_record(record, SIGMA), record, bench().place, SIGMA).turns
    targets, gyros = whole.parametrisation.selection[0] @ whole.point[: whole.own], whole.point[whole.own :]
    seen = moved.residual(targets, gyros) - whole.turns.residual(targets, gyros)
    coefficients = values
    if place.definition.parameters[0].name.endswith("amplitude"):
        pairs = np.reshape(values, (-1, 2))
        coefficients = np.stack([pairs[:, 0] * np.cos(pairs[:, 1]), pairs[:, 0] * np.sin(pairs[:, 1])], 1).ravel()
    told = travel.columns(place) @ np.asarray(coefficients)
    assert np.abs(told).max() > 5e-5
    assert np.abs(seen - told).max() < 0.02 * np.abs(told).max()


def test_turns_from_row_to_row_hold_the_coning_that_increments_lack(clean):
    """A computer that takes rates' integrals for the body's turns lacks 1/12 of γ' × γ.

    About the inner axis, where angles at rows tell it: what axes that speed up add within a row is across.
    """
    whole, travel = clean
    record = measured().raw
    assert isinstance(record, BenchRecord)
    alpha, beta = np.unwrap(record.alpha), np.unwrap(record.beta)
    body = Rotation.from_euler("XZ", np.stack([alpha, beta], axis=1))
    turns = (body[:-1].inv() * body[1:]).as_rotvec()
    integrals = np.diff(moments_of(record.time_s, alpha, beta)[:, :4], axis=0)[:, [0, 1, 3]] * [1.0, -1.0, 1.0]
    lacks = np.vstack([np.zeros(3), np.cumsum(turns - integrals, axis=0)])
    seen = (lacks[whole.turns.last] - lacks[whole.turns.first])[:, 2]
    told = -travel.columns(UNDERSAMPLING).reshape(-1, 3)[:, 2] / 12.0
    assert np.abs(seen).max() > 5e-5
    assert np.abs(seen - told).max() < 0.02 * np.abs(seen).max()


@pytest.fixture(scope="module")
def faultless():
    return whole_evidence(measured(), bench().place, noise_bound=SIGMA).model


@pytest.mark.parametrize("effect", ["backlash", "hysteresis"])
def test_a_sense_is_that_of_the_last_move_in_motion_too(faultless, effect):
    """With true sizes the readings stand, where one axis comes before the other, and as an input passes its largest.

    Where no sense is told an error may be as large as the effect, and only there.
    """
    places = CATALOGUE[effect].places
    found = whole_evidence(measured(*(Hidden(place, (1e-4,)) for place in places)), bench().place, noise_bound=SIGMA)
    sizes, point = np.full(len(places), 1e-4), faultless.point
    before = np.abs(faultless.at((), point, np.zeros(0))[0][: faultless.of_readings]).max()
    for used, stands in ((sizes, True), (-sizes, False), (0.0 * sizes, False)):
        left, _, rate = (values[: found.model.of_readings] for values in found.model.at(places, point, used))
        assert (np.abs(left) <= before + 0.1 + rate[:, len(point) :] @ sizes).all() == stands
    assert found.model.moving.read.contexts.sense_told.mean() > 0.7


def test_a_reading_in_motion_says_nothing_where_its_input_may_change_its_sign(faultless):
    """As the table turns about an accelerometer its input stays near zero: what depends on its sign is not told."""
    places, sizes = CATALOGUE["bias-asymmetry"].places, np.full(3, 1e-3)
    found = whole_evidence(measured(*(Hidden(place, (1e-3,)) for place in places)), bench().place, noise_bound=SIGMA)
    left = found.model.at(places, faultless.point, sizes)[0][: found.model.of_readings].reshape(-1, 3)
    untold = found.model.moving.seen.bound == UNTOLD
    # A bound of noise, and what the encoder and a parabola are off.
    assert np.abs(left).max() < 1.5
    assert untold.sum() > 3
    assert (np.abs(found.model.moving.read.contexts.n) < 0.02)[untold].all()


@pytest.mark.acceptance
def test_a_harmonic_of_an_encoder_has_two_witnesses(tmp_path, monkeypatch, capsys):
    """Named at a terminal with page and components; each witness by itself is satisfied."""
    monkeypatch.chdir(tmp_path)
    record = measured(Hidden(HARMONIC, (6e-5, 1.0)))
    assert record.raw is not None
    write_record(record.raw, tmp_path / "bench.csv")
    place = bench().place
    told = {"--latitude-deg": place.latitude_deg, "--azimuth-deg": place.azimuth_deg, "--gyro-noise": place.gyro_noise}
    told |= {"--encoder-bound": place.encoder_bound, "--noise-bound": SIGMA}
    options = [text for name, value in told.items() for text in (name, str(value))]
    files = ["--json", "found.json", "--report", "found.html", "--export", "extended"]
    assert main(["diagnose", "bench.csv", *options, *files]) == 0
    said = capsys.readouterr().out
    assert "the encoder of the outer axis errs by" in said
    (line,) = [line for line in said.splitlines() if line.startswith("two witnesses")]
    accelerometers, gyros = (part.rpartition("radius ")[2].split(" -> ") for part in line.split(";"))
    assert float(gyros[0]) > 1.5
    assert float(accelerometers[0]) > 1.5
    assert max(float(gyros[1]), float(accelerometers[1])) < 1.0
    assert "Turns, as the gyros saw them" in (tmp_path / "found.html").read_text(encoding="utf-8")
    assert (tmp_path / "extended" / "GyroCompensation.ssv").exists()
    found = Diagnosis.model_validate_json((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert [cause.place for cause in found.causes] == [HARMONIC]
    (low, high), _ = found.causes[0].intervals
    assert low <= 6e-5 <= high
    assert main(["diagnose", "bench.csv", "--noise-bound", "1e-5", "--latitude-deg", "10"]) == 2
    shutil.copy("bench.csv", "again.csv")
    assert main(["diagnose", "bench.csv", "again.csv", *options]) == 2
    assert "--latitude-deg: is of one record; give one" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("place", "values"),
    [
        (EffectPlace("lever-arm", "accelerometer-2"), (4e-4, -3e-4, 5e-4)),
        (EffectPlace("accelerometer-lag", "accelerometer-1"), (6e-5,)),
        (EffectPlace("encoder-lag", "outer-axis"), (-6e-5,)),
    ],
    ids=lambda value: value.title if isinstance(value, EffectPlace) else "",
)
def test_what_only_motion_shows_is_named_with_its_size_inside(place, values):
    """The rests by themselves stand; the readings in motion do not, but with what was hidden in the components."""
    record = measured(Hidden(place, values))
    evidence = whole_evidence(record, bench().place, noise_bound=SIGMA)
    assert evidence.model.calibration.verdict == "consistent" or place.effect == "encoder-lag"
    assert evidence.model.falsified
    fit = evidence.model.refit([place])
    assert fit.radius <= 1.0
    for value, (low, high) in zip(values, fit.intervals()[0], strict=True):
        assert low <= value <= high
        assert high - low < 2.0 * abs(value)
    rivals = [EffectPlace("lever-arm", "accelerometer-1"), EffectPlace("accelerometer-lag", "accelerometer-3")]
    assert all(evidence.model.refit([other]).radius > 1.0 for other in rivals)


def bumped(size: float) -> Hidden:
    """An encoder of the outer axis that errs about 2 rad alone."""
    knots = np.round(np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False), 6)
    values = size * np.exp(-0.5 * ((knots - 2.0) / 0.4) ** 2)
    law = f"alpha around {' '.join(map(repr, knots.tolist()))}"
    return Hidden(EffectPlace("lookup", "outer-axis", law=law), tuple(values.tolist()))


def of_formula(text: str, size: float) -> Hidden:
    place = Formula.of(text).place
    assert place is not None
    return Hidden(place, (size,))


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
    """What is proven is what was hidden; a table's cause is seen by accelerometers and gyros alike."""
    evidence = whole_evidence(measured(hidden), bench().place, noise_bound=SIGMA)
    found = dependence(evidence)
    assert found is not None
    assert found.proven is not None
    assert (found.place, found.proven.pair.quantity) == (where, quantity)
    alone = evidence.model.of_readings
    columns = np.abs(found.proven.pair.columns(found.proven.form)).max(axis=1)
    seen = columns > 1e-4 * columns.max()
    assert seen[:alone].any() == (not where.startswith("gyro"))
    assert seen[alone:].any() == (not where.startswith("accelerometer"))


@pytest.mark.acceptance
def test_of_what_one_move_alone_shows_no_quantity_is_proven():
    """Of so small a sine one slow turn alone misfits, and a jump of a product of rates mends it with fewest numbers."""
    evidence = whole_evidence(measured(of_formula("w1 += c*sin(6*w1)", 5e-5)), bench().place, noise_bound=SIGMA)
    found = dependence(evidence)
    assert found is not None
    assert found.place == "gyro-1"
    assert found.proven is None
    assert "hours" in found.quantities


@pytest.mark.acceptance
def test_a_formula_of_a_gyro_stands_or_is_refuted():
    """What was hidden stands with its number inside; of another gyro, or of an accelerometer, it does not."""
    hidden = of_formula("w3 += c*w3**5", 2e-4)
    evidence = whole_evidence(measured(hidden), bench().place, noise_bound=SIGMA)
    texts = ("w3 += c*w3**5", "w1 += c*w1**5", "f1 += c*n1**5")
    places = places_of(texts, at_table=True, with_gyros=True)
    true, *others = (answered(evidence, place, (), rerun=False) for place in places)
    assert true.answer == "stands"
    (own,) = true.parameters
    assert own.low is not None
    assert own.high is not None
    assert own.low <= 2e-4 <= own.high
    assert [other.answer for other in others] == ["refuted", "refuted"]


def test_a_formula_is_of_what_the_record_has():
    with pytest.raises(InputError, match="w1 is of a strapdown record, or of a bench record whose place is given"):
        places_of(["w1 += c*w1**3"], at_table=True, with_gyros=False)
    assert len(places_of(["w1 += c*w1**3", "alpha += c*sin(3*alpha)"], at_table=True, with_gyros=True)) == 2


def test_functions_of_a_pair_are_the_columns_of_the_catalogue():
    """By two ways: functions at nodes, and effects at every row; of the table on readings and on turns."""
    evidence = whole_evidence(measured(), bench().place, noise_bound=SIGMA)
    pairs = {(pair.where, pair.name): pair for pair in evidence.reader.pairs}
    harmonic, own = evidence.rows.columns_of([HARMONIC]), pairs["outer-axis", "alpha"]
    # The true angle is the reading less what an encoder errs by; an effect counts its sine first.
    mine = -own.columns(Form("harmonic", 3))[:, ::-1]
    squared = evidence.rows.columns_of([EffectPlace("gyro-rate-squared", "gyro-block")])[:, 1]
    rate = pairs["gyro-2", "w2"]
    for theirs, ours in ((harmonic, mine), (squared, rate.spread(rate.values[:, None] ** 2)[:, 0])):
        assert np.abs(theirs - ours).max() <= 3e-3 * np.abs(theirs).max()


def test_no_reading_in_motion_is_off_by_itself():
    """Beside an effect that is not linear one was a candidate, and then had no number of its position."""
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
        found = list(evidence.model.candidates(2, Work()))
    assert (hysteresis, still) in found
    assert (hysteresis, moving) not in found


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(6))
def test_of_a_gyro_that_swings_no_slow_temperature_is_proven_alone(seed):
    """It swings about twice as fast as the laboratory's temperature, whose functions are then nearly as simple."""
    rng = np.random.default_rng([75, 7 + seed])
    drawn, p, per_hour = draw_whole(rng), int(rng.integers(1, 4)), float(rng.uniform(11.0, 13.4))
    # About the hour at which the temperature is highest.
    phase = 0.5 * np.pi - 2.0 * np.pi * per_hour / 24.0 + float(rng.uniform(-0.4, 0.4))
    place = Formula.of(f"w{p} += c*sin({2.0 * np.pi * per_hour:.4f}*hours + {phase:.3f})").place
    clean = whole_evidence(drawn.measured(75, seed), drawn.place, noise_bound=SIGMA)
    unit = clean.rows.columns_of([place])[:, 0]
    seen = 2.0 / chebyshev_radius(clean.rows.nominal, unit, np.ones(len(unit)))[0]
    hidden = Hidden(place, (seen * float(rng.uniform(1.5, 6.0)),))
    found = dependence(whole_evidence(drawn.measured(75, seed, (hidden,)), drawn.place, noise_bound=SIGMA))
    assert found is not None
    assert found.place in (f"gyro-{p}", None)
    assert found.proven is None or "hours" in found.quantities
