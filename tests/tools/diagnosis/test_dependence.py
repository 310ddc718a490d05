"""Place and quantity are proven where no other would do, whatever the law; nothing is where something else would."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generator import SIGMA
from generator.positions import Session, errors
from generator.unlisted import SHAPES, Known, encoder_bump, fifth_power, of_temperature, one_jump, outside_case
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded.sets import Work
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.beyond import Beyond
from trihedron.tools.diagnosis.dependence import Dependence, Search, dependence, is_same, most_of_rivals
from trihedron.tools.diagnosis.laws import Laws
from trihedron.tools.diagnosis.rivals import NOT_COMPARED, ROUGHLY, Listed, Unlisted, complexity_of
from trihedron.tools.diagnosis.search import search
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.records import read_record

SMOOTH = [SHAPES.index(shape) for shape in (encoder_bump, fifth_power, of_temperature, one_jump)]
NAMES = {"time": "hours"}


def found_of(path: Path, noise_bound: float = SIGMA, work: Work | None = None) -> Dependence | None:
    record: Any = read_record(path)
    return dependence(bench_evidence(record, noise_bound=noise_bound), work)


def diagnosed_file(path: Path) -> Any:
    record: Any = read_record(path)
    return diagnose(record, noise_bound=SIGMA, rerun=False)


def written(path: Path, rng: np.random.Generator, session: Session, reading: np.ndarray, noise: float = 1.0) -> Path:
    session.write(path, (session.alpha, session.beta), reading + noise * errors(rng, len(reading))[0], rng)
    return path


@pytest.mark.parametrize(
    "index", [*SMOOTH, *(pytest.param(k + len(SHAPES), marks=pytest.mark.acceptance) for k in SMOOTH)]
)
def test_what_is_proven_of_a_fault_outside_the_catalogue_is_true(index: int, tmp_path: Path):
    case = outside_case(tmp_path, 3, index)
    found = found_of(tmp_path / case.file)
    assert found is not None
    assert found.place == case.place
    true = {(place, NAMES.get(quantity, quantity)) for place, quantity, _ in case.same}
    assert any((one.pair.where, one.pair.quantity) in true for one in found.standing)
    if found.proven:
        assert (found.proven.pair.where, found.proven.pair.quantity) in true


@pytest.mark.parametrize("index", [61, 166])
def test_a_quantity_is_found_though_every_error_is_at_its_bound(index: int, tmp_path: Path):
    """Then no function that is only about the true one stands: it takes many coefficients."""
    case = outside_case(tmp_path, 17, index)
    found = found_of(tmp_path / case.file)
    assert found is not None
    assert found.proven is not None
    assert (found.proven.pair.where, found.proven.pair.quantity) == (case.place, case.quantity)


@pytest.mark.parametrize(("size", "says"), [(3e-4, None), (1e-2, ROUGHLY), (1.6e-2, NOT_COMPARED)])
def test_that_functions_were_compared_roughly_or_not_at_all_is_said(size: float, says: str | None, tmp_path: Path):
    """The linear model by which they are compared is wrong by the square of the misfit: a bound, or a third of one."""
    rng = np.random.default_rng([6, 41])
    session = Session.drawn(rng, 36)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    reading[:, 1] += size * n[:, 1] ** 2
    record: Any = read_record(written(tmp_path / "large.positions.csv", rng, session, reading))
    evidence = bench_evidence(record, noise_bound=SIGMA)
    low, high = {None: (0.0, 0.3), ROUGHLY: (0.3, 1.0), NOT_COMPARED: (1.0, np.inf)}[says]
    assert low < evidence.second_order < high
    fit = evidence.refit([EffectPlace("quadratic", "accelerometer-2")])
    assert fit.radius <= evidence.limit
    told = Unlisted.of(dependence(evidence), Listed(evidence), fit)
    assert [text for text in told.caution if text in (ROUGHLY, NOT_COMPARED)] == ([] if says is None else [says])
    # What stands only by a linear model that may be wrong is no rival.
    assert says is None or told.rivals == ()


def test_many_forms_at_once_are_bounded_as_each_by_itself(tmp_path: Path):
    """Each bound is what weighted least squares leaves with the form beside the model; no programme leaves less."""
    case = outside_case(tmp_path, 3, SMOOTH[0])
    record: Any = read_record(tmp_path / case.file)
    search = Search(evidence := bench_evidence(record, noise_bound=SIGMA), evidence.pairs(), Work())
    assert search.weights.sum() == pytest.approx(1.0)
    root = np.sqrt(search.weights)
    for pair in search.pairs[::7]:
        blocks = pair.columns_of(list(pair.single()))
        assert len({block.shape[1] for block in blocks}) > pair.circle
        bounds = search.bounds(blocks)
        for k, (block, bound) in enumerate(zip(blocks, bounds, strict=True)):
            matrix = np.hstack((search.problem.nominal, block / evidence.bound[:, None]))
            weighted = root[:, None] * matrix / np.linalg.norm(root[:, None] * matrix, axis=0)
            residual = root * search.problem.residual
            left = residual - weighted @ np.linalg.lstsq(weighted, residual)[0]
            assert bound == pytest.approx(np.linalg.norm(left), abs=1e-9)
            if k % 10 == 0:
                assert bound <= search.radius(matrix) + 1e-9


@pytest.mark.parametrize("larger", [1.05, 1.15, 1.25])
def test_noise_beyond_its_bound_proves_no_place(larger: float, tmp_path: Path):
    """Any function makes such a record a little better; a larger noise bound does, too."""
    for seed in range(4):
        rng = np.random.default_rng([5, seed])
        session = Session.drawn(rng, 30)
        reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
        found = found_of(written(tmp_path / f"{seed}.positions.csv", rng, session, reading, larger))
        assert found is None or (found.place is None and found.proven is None)


def test_faults_at_two_places_are_at_no_single_one(tmp_path: Path):
    for seed in range(3):
        rng = np.random.default_rng([6, seed])
        session = Session.drawn(rng, 36)
        known = Known.of(session)
        reading = session.stand.readings(known.n)
        reading[:, 0] += 3e-4 * known.n[:, 0] ** 4
        reading[:, 1] += 2e-4 * known.part("time") ** 2
        found = found_of(written(tmp_path / f"{seed}.positions.csv", rng, session, reading))
        assert found is not None
        assert (found.place, found.proven, found.standing) == (None, None, ())


def test_time_and_a_temperature_that_rises_with_it_are_one_quantity(tmp_path: Path):
    rng = np.random.default_rng(7)
    session = Session.drawn(rng, 24)
    part = (session.hours - session.hours[0]) / np.ptp(session.hours)
    session = replace(session, temperature=18.0 + 4.0 * part + 0.5 * part**2)
    reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
    reading[:, 2] += 2e-4 * part**2
    found = found_of(written(tmp_path / "slow.positions.csv", rng, session, reading))
    assert found is not None
    assert found.proven is not None
    assert set(found.quantities) == {"hours", "temperature"}


@pytest.mark.parametrize("count", [36, 100])
def test_quantities_are_the_same_where_one_is_a_function_of_the_other(count: int, tmp_path: Path):
    """n3 = cos α, and a temperature that rises and falls is a function of time though time is none of it."""
    rng = np.random.default_rng([13, count])
    session = Session.drawn(rng, count)
    part = session.hours / session.hours[-1]
    session = replace(session, temperature=np.round(20.0 + 5.0 * np.sin(4.0 * part), 4))
    reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
    record: Any = read_record(written(tmp_path / "same.positions.csv", rng, session, reading))
    pairs = bench_evidence(record, noise_bound=SIGMA).pairs()
    of = {pair.quantity: pair for pair in pairs if pair.where == "accelerometer-1" and not pair.factor}
    same = [("n3", "alpha"), ("temperature", "hours")]
    other = [("n3", "beta"), ("n1", "n3"), ("n1", "beta"), ("n1", "hours"), ("temperature", "alpha")]
    assert [is_same(of[a], of[b]) for a, b in same] == [is_same(of[b], of[a]) for a, b in same] == [True, True]
    assert not any(is_same(of[a], of[b]) for a, b in other)


def test_a_function_of_an_input_that_is_one_of_an_angle_is_proven_by_both(tmp_path: Path):
    rng = np.random.default_rng([13, 1])
    session = Session.drawn(rng, 48)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    reading[:, 0] += 2e-4 * n[:, 2] ** 3
    found = found_of(written(tmp_path / "cosine.positions.csv", rng, session, reading))
    assert found is not None
    assert found.proven is not None
    assert found.quantities == ("n3", "alpha")


def test_a_wander_of_the_catalogue_is_a_function_of_time_by_its_law(tmp_path: Path):
    rng = np.random.default_rng([13, 0])
    session = Session.drawn(rng, 36)
    part = session.hours / session.hours[-1]
    session = replace(session, temperature=np.round(20.0 + 5.0 * np.sin(4.0 * part), 4))
    reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
    reading[:, 0] += 1.2e-4 * np.exp(-2.0 * ((session.temperature - 21.1) / 3.0) ** 2)
    record: Any = read_record(written(tmp_path / "wander.positions.csv", rng, session, reading))
    evidence = bench_evidence(record, noise_bound=SIGMA)
    listed, (wander,) = Listed(evidence), search(evidence).fits
    assert wander.places[0].effect == "bias-wander"
    of = {pair.name for pair in evidence.pairs() if listed.is_of(wander, pair)}
    assert "hours" in of
    assert not of & {"n1", "n2", "n3", "alpha", "beta"}


@pytest.mark.acceptance
def test_sets_of_several_effects_that_are_less_simple_are_no_rivals_of_one_function(tmp_path: Path):
    rng = np.random.default_rng([14, 3])
    session = Session.drawn(rng, 36)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    reading[:, 0] += 1.5e-4 * np.tanh(n[:, 0] / 0.35)
    record: Any = read_record(written(tmp_path / "bent.positions.csv", rng, session, reading))
    evidence = bench_evidence(record, noise_bound=SIGMA)
    found, listed, sets = dependence(evidence), Listed(evidence), search(evidence).fits
    assert found is not None
    assert found.least is not None
    others = [fit for fit in sets if not any(listed.is_of(fit, one.pair) for one in found.standing)]
    assert others
    assert found.least < min(complexity_of(fit.places) for fit in others) <= most_of_rivals(found.least)
    proven = listed.beside(found, sets).proven
    assert proven is not None
    assert (proven.pair.where, proven.pair.name) == ("accelerometer-1", "n1")


def test_the_work_of_a_hundred_positions_is_small(tmp_path: Path):
    rng, work = np.random.default_rng(8), Work()
    session = Session.drawn(rng, 100)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    reading[:, 0] += 3e-4 * n[:, 0] ** 5
    found = found_of(written(tmp_path / "long.positions.csv", rng, session, reading), work=work)
    assert found is not None
    assert found.proven is not None
    assert (found.proven.pair.where, found.proven.pair.name) == ("accelerometer-1", "n1")
    assert work.done < 2e6


@pytest.mark.acceptance
def test_what_several_effects_do_together_is_one_function_of_one_quantity(tmp_path: Path):
    """A bump in an encoder, which harmonics imitate: the quantity is proven, of which laws it is made is not."""
    rng = np.random.default_rng([9, 0])
    session = Session.drawn(rng, 24)
    off = np.remainder(session.alpha - 2.0 + np.pi, 2.0 * np.pi) - np.pi
    reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
    angles = (session.alpha + 1.2e-4 * np.exp(-0.5 * (off / 0.7) ** 2), session.beta)
    session.write(tmp_path / "bump.positions.csv", angles, reading + errors(rng, 24)[0], rng)
    found = diagnosed_file(tmp_path / "bump.positions.csv")
    assert (found.proven.place, found.proven.quantity) == ("outer-axis", "alpha")
    if found.verdict == "explained":
        assert found.level == "quantity"
        assert "a function of the outer angle at the outer axis" in found.caution[0]
    else:
        assert found.verdict == "unexplained"
        assert found.depends_on == ("alpha",)
    told = str(found)
    assert "roven, whatever the law: a function of the outer angle at the outer axis suffices" in told


def test_one_effect_of_the_catalogue_is_explained_and_has_no_rival(tmp_path: Path):
    rng = np.random.default_rng([10, 0])
    session = Session.drawn(rng, 36)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    reading[:, 0] += 2e-4 * n[:, 0] * n[:, 1]
    path = written(tmp_path / "one.positions.csv", rng, session, reading)
    found = diagnosed_file(path)
    assert (found.verdict, [cause.place.title for cause in found.causes]) == (
        "explained",
        ["cross-product accelerometer-1 axes 1 2"],
    )
    assert (found.proven.place, found.proven.quantity) == ("accelerometer-1", "n1 n2")


def test_a_jump_in_a_temperature_that_jumps_once_is_not_told_from_a_step_in_time(tmp_path: Path):
    rng = np.random.default_rng([11, 0])
    session = Session.drawn(rng, 24)
    late = np.arange(24) >= 11
    session = replace(session, temperature=np.round(20.0 + 5.0 * late + rng.uniform(-0.5, 0.5, 24), 4))
    reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
    reading[:, 1] += 3e-4 * late
    path = written(tmp_path / "step.positions.csv", rng, session, reading)
    found = diagnosed_file(path)
    assert found.proven.place == "accelerometer-2"
    assert {"hours", "temperature"} <= {*found.proven.not_excluded}
    assert any("does not tell" in text for text in found.caution)


@pytest.mark.parametrize("seed", [2, 7])
def test_a_single_reading_that_is_off_is_a_function_of_no_quantity(seed: int, tmp_path: Path):
    """With few positions a function with a spike where it was read would do as much; a reading is simpler."""
    rng = np.random.default_rng([13, seed])
    session = Session.drawn(rng, 16)
    reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
    reading[5, 2] += 8e-5
    found = diagnosed_file(written(tmp_path / "off.positions.csv", rng, session, reading))
    assert EffectPlace("outlier", "position-6", axes=(3,)) in [cause.place for cause in found.causes]
    assert found.band is None
    if found.proven is not None:
        assert (found.proven.place, found.proven.quantity) == ("accelerometer-3", None)


def test_complexity_counts_what_is_searched_for():
    quadratic, wave = EffectPlace("quadratic", "accelerometer-1"), EffectPlace("encoder-harmonic", "outer-axis", 3)
    outlier = EffectPlace("outlier", "position-4", axes=(2,))
    step = EffectPlace("bias-step", "accelerometer-1")
    assert [complexity_of([place]) for place in (quadratic, wave, outlier, step)] == [1, 3, 2, 2]
    assert complexity_of([quadratic, wave]) == 6


def test_a_rival_is_a_table_of_knots_with_which_the_exact_model_stands(tmp_path: Path):
    """So that further positions can be found that tell it from what is listed."""
    rng = np.random.default_rng([12, 0])
    session = Session.drawn(rng, 20)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    reading[:, 0] += 2e-4 * np.tanh(3.0 * n[:, 1])
    record: Any = read_record(written(tmp_path / "other.positions.csv", rng, session, reading))
    evidence = bench_evidence(record, noise_bound=SIGMA)
    found = dependence(evidence)
    assert found is not None
    unlisted = Unlisted(found.standing[:1], None, None)
    (fit,) = unlisted.fits(evidence)
    assert fit.radius <= evidence.limit
    assert (fit.places[0].effect, fit.places[0].where) == ("lookup", "accelerometer-1")
    assert unlisted.caution == (
        "as simple, and in no catalogue: a function of the input of accelerometer 2 at accelerometer 1 would do",
    )


@pytest.mark.first(1)
@pytest.mark.parametrize(("saturates", "size"), [(True, 2.2e-4), (False, 2e-3)])
def test_an_odd_quadratic_is_said_alone_only_where_an_input_that_saturates_is_excluded(
    saturates: bool, size: float, tmp_path: Path
):
    rng = np.random.default_rng([15, 1])
    session = Session.drawn(rng, 30)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    x = n[:, 0]
    reading[:, 0] += size * (np.tanh(x / 0.5) if saturates else x * np.abs(x))
    found = diagnosed_file(written(tmp_path / "saturates.positions.csv", rng, session, reading))
    assert [cause.place.title for cause in found.causes] == ["odd-quadratic accelerometer-1"]
    assert (found.verdict, found.level) == ("explained", "quantity" if saturates else "law")
    shapes = [law.shape for law in found.laws if "exp" in law.words]
    if saturates:
        # A hyperbolic tangent of n / 0.5 is a logistic function of n / 0.25.
        assert any(low <= 0.25 <= high for low, high in shapes)
    else:
        assert not found.caution
        assert not shapes


def test_laws_that_were_not_all_tried_leave_none_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng([16, 0])
    session = Session.drawn(rng, 36)
    n = session.stand.inputs(session.alpha, session.beta)
    reading = session.stand.readings(n)
    reading[:, 1] += 4e-4 * n[:, 1] ** 5
    record: Any = read_record(written(tmp_path / "fifth.positions.csv", rng, session, reading))
    evidence = bench_evidence(record, noise_bound=SIGMA)
    found = dependence(evidence)
    assert found is not None
    assert found.proven is not None
    whole = Beyond(evidence, found.proven.pair, found.proven.form)
    assert [law.words for law in whole.laws] == ["c n2⁵"]
    assert whole.is_one_law
    work = Work()
    Laws(evidence, whole.pair, whole.each, work).standing([])
    # The sixth and the seventh power come last.
    monkeypatch.setattr("trihedron.tools.diagnosis.beyond.MOST_WORK", 0.9 * work.done)
    short = Beyond(evidence, found.proven.pair, found.proven.form)
    assert [law.words for law in short.laws] == ["c n2⁵"]
    assert not short.is_one_law
