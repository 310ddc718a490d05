"""Place and quantity are proven for any law if no other pair would do, and otherwise not."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from diagnoses import assert_named, diagnosed, flowing
from generator import SIGMA
from generator.positions import record_with
from generator.unlisted import SHAPES, encoder_bump, fifth_power, of_temperature, one_jump, outside_case
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded import Work
from trihedron.tools.diagnosis import Beyond
from trihedron.tools.diagnosis.dependence import Search, dependence, is_same, most_of_rivals
from trihedron.tools.diagnosis.laws import Laws
from trihedron.tools.diagnosis.rivals import NOT_COMPARED, ROUGHLY, Listed, Unlisted, complexity_of
from trihedron.tools.diagnosis.search import search
from trihedron.tools.evidence import bench_evidence
from trihedron.tools.records import PositionRecord, read_record

SMOOTH = [SHAPES.index(shape) for shape in (encoder_bump, fifth_power, of_temperature, one_jump)]
evidence_of = partial(bench_evidence, noise_bound=SIGMA)


def depending(record: Any, work: Work | None = None) -> Any:
    """Return the place and the quantity of the function that a record lacks."""
    return dependence(evidence_of(record), work)


def proven_by(result: Any) -> tuple[str, str] | None:
    """Return the proven place and quantity, with its factor."""
    return result.proven and (result.proven.pair.where, result.proven.pair.name)


def part_of(visits: Any) -> np.ndarray:
    """Return the part of the time, from 0 to 1."""
    return visits.hours / visits.hours[-1]


def rising_and_falling(part: np.ndarray) -> np.ndarray:
    return 20.0 + 5.0 * np.sin(4.0 * part)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "index", [*SMOOTH, *(pytest.param(k + len(SHAPES), marks=pytest.mark.acceptance) for k in SMOOTH)]
)
def test_what_is_proven_of_a_fault_outside_the_catalogue_is_true(index, tmp_path):
    case = outside_case(tmp_path, 3, index)
    result = depending(read_record(tmp_path / case.file))
    assert result.place == case.place
    true = {(place, quantity.replace("time", "hours")) for place, quantity, _ in case.same}
    standing = {(function.pair.where, function.pair.quantity) for function in result.standing}
    assert standing & true
    assert result.proven is None or (result.proven.pair.where, result.proven.pair.quantity) in true


@pytest.mark.acceptance
@pytest.mark.parametrize("index", [61, 166])
def test_a_quantity_is_found_though_every_error_is_at_its_bound(index, tmp_path):
    """Then no function that is only near the true one fits: it takes many coefficients."""
    case = outside_case(tmp_path, 17, index)
    assert proven_by(depending(read_record(tmp_path / case.file))) == (case.place, case.quantity)


@pytest.mark.parametrize(("size", "says"), [(3e-4, None), (1e-2, ROUGHLY), (1.6e-2, NOT_COMPARED)])
def test_that_functions_were_compared_roughly_or_not_at_all_is_said(size, says):
    """The linear model for the comparison is wrong by the square of the misfit: a bound, or a third of one."""
    evidence = evidence_of(record_with([6, 41], {"f2": lambda v: size * v.n[:, 1] ** 2}))
    low, high = {None: (0.0, 0.3), ROUGHLY: (0.3, 1.0), NOT_COMPARED: (1.0, np.inf)}[says]
    assert low < evidence.model.second_order < high
    fit = evidence.model.refit([EffectPlace("quadratic", "accelerometer-2")])
    assert fit.radius <= evidence.model.limit
    unlisted = Unlisted.of(dependence(evidence), Listed(evidence), fit)
    assert [text for text in unlisted.caution if text in (ROUGHLY, NOT_COMPARED)] == ([] if says is None else [says])
    # A pair that stands only within the error of the linear model is not a rival.
    assert says is None or unlisted.rivals == ()


@pytest.mark.acceptance
def test_many_forms_at_once_are_bounded_as_each_by_itself(tmp_path):
    """Each bound is the weighted least-squares remainder with the form beside the model; no programme leaves less."""
    case = outside_case(tmp_path, 3, SMOOTH[0])
    evidence = evidence_of(read_record(tmp_path / case.file, PositionRecord))
    forms = Search(evidence, evidence.reader.pairs, Work())
    assert forms.weights.sum() == pytest.approx(1.0)
    root = np.sqrt(forms.weights)
    for pair in forms.pairs[::7]:
        blocks = pair.columns_of(list(pair.single()))
        assert len({block.shape[1] for block in blocks}) > pair.circle
        for k, (block, bound) in enumerate(zip(blocks, forms.bounds(blocks), strict=True)):
            matrix = np.hstack((forms.problem.nominal, block / evidence.rows.bound[:, None]))
            weighted = root[:, None] * matrix / np.linalg.norm(root[:, None] * matrix, axis=0)
            residual = root * forms.problem.residual
            remaining = residual - weighted @ np.linalg.lstsq(weighted, residual)[0]
            assert bound == pytest.approx(np.linalg.norm(remaining), abs=1e-9)
            if k % 10 == 0:
                assert bound <= forms.radius(matrix) + 1e-9


@pytest.mark.acceptance
def test_noise_beyond_its_bound_and_faults_at_two_places_prove_no_single_place():
    """Any function improves the one a little; a larger noise bound does, too."""
    for larger in (1.05, 1.15, 1.25):
        for seed in range(4):
            result = depending(record_with([5, seed], {}, 30, larger=larger))
            assert result is None or (result.place, result.proven) == (None, None)
    faults = {"f1": lambda v: 3e-4 * v.n[:, 0] ** 4, "f2": lambda v: 2e-4 * part_of(v) ** 2}
    for seed in range(3):
        result = depending(record_with([6, seed], faults))
        assert (result.place, result.proven, result.standing) == (None, None, ())


@pytest.mark.parametrize("count", [36, 100])
def test_quantities_are_the_same_where_one_is_a_function_of_the_other(count):
    """n3 = cos α; and a temperature that rises and falls is a function of time, though not conversely."""
    pairs = evidence_of(record_with([13, count], {}, count, temperature=rising_and_falling)).reader.pairs
    of = {pair.quantity: pair for pair in pairs if pair.where == "accelerometer-1" and not pair.factor}
    for first, second, same in (
        *(("n3", "alpha", True), ("temperature", "hours", True), ("n3", "beta", False), ("n1", "n3", False)),
        *(("n1", "beta", False), ("n1", "hours", False), ("temperature", "alpha", False)),
    ):
        assert is_same(of[first], of[second]) is is_same(of[second], of[first]) is same


@pytest.mark.parametrize(
    ("seed", "faults", "count", "warmth", "quantities"),
    [
        # n3 is the cosine of the outer angle.
        ([13, 1], {"f1": lambda v: 2e-4 * v.n[:, 2] ** 3}, 48, None, ("n3", "alpha")),
        # A temperature that rises with time is one quantity with it.
        (
            7,
            {"f3": lambda v: 2e-4 * part_of(v) ** 2},
            24,
            lambda part: 18.0 + 4.0 * part + 0.5 * part**2,
            ("hours", "temperature"),
        ),
    ],
    ids=["input and angle", "time and temperature"],
)
def test_what_is_a_function_of_two_quantities_is_proven_by_both(seed, faults, count, warmth, quantities):
    result = depending(record_with(seed, faults, count, temperature=warmth))
    assert result.proven is not None
    assert set(result.quantities) == set(quantities)


@pytest.mark.acceptance
def test_a_wander_of_the_catalogue_is_a_function_of_time_by_its_law():
    def wandering(visits):
        return 1.2e-4 * np.exp(-2.0 * ((visits.temperature - 21.1) / 3.0) ** 2)

    evidence = evidence_of(record_with([13, 0], {"f1": wandering}, temperature=rising_and_falling))
    listed, (wander,) = Listed(evidence), search(evidence.model).fits
    assert wander.places[0].effect == "bias-wander"
    names = {pair.name for pair in evidence.reader.pairs if listed.is_of(wander, pair)}
    assert "hours" in names
    assert not names & {"n1", "n2", "n3", "alpha", "beta"}


@pytest.mark.acceptance
def test_sets_of_several_effects_that_are_less_simple_are_no_rivals_of_one_function():
    evidence = evidence_of(record_with([14, 3], {"f1": lambda v: 1.5e-4 * np.tanh(v.n[:, 0] / 0.35)}))
    result: Any = dependence(evidence)
    listed, sets = Listed(evidence), search(evidence.model).fits
    complexities = []
    for fit in sets:
        if not any(listed.is_of(fit, function.pair) for function in result.standing):
            complexities.append(complexity_of(fit.places))
    assert result.least < min(complexities) <= most_of_rivals(result.least)
    assert proven_by(listed.beside(result, sets)) == ("accelerometer-1", "n1")


def test_the_work_of_a_hundred_positions_is_small():
    work = Work()
    record = record_with(8, {"f1": lambda v: 3e-4 * v.n[:, 0] ** 5}, 100)
    assert proven_by(depending(record, work)) == ("accelerometer-1", "n1")
    assert work.done < 2e6


@pytest.mark.acceptance
def test_what_several_effects_do_together_is_one_function_of_one_quantity():
    """A bump in an encoder, which harmonics imitate: the quantity is proven, its laws are not."""

    def bump(visits):
        off = np.remainder(visits.alpha - 2.0 + np.pi, 2.0 * np.pi) - np.pi
        return 1.2e-4 * np.exp(-0.5 * (off / 0.7) ** 2)

    result = diagnosed(record_with([9, 0], {"alpha": bump}, 24))
    assert (result.proven.place, result.proven.quantity) == ("outer-axis", "alpha")
    if result.verdict == "explained":
        assert result.level == "quantity"
        assert "a function of the outer angle at the outer axis" in result.caution[0]
    else:
        assert (result.verdict, result.depends_on) == ("unexplained", ("alpha",))
    assert "roven: a function of the outer angle at the outer axis explains the record" in flowing(result)


def test_one_effect_of_the_catalogue_is_explained_and_has_no_rival():
    result = diagnosed(record_with([10, 0], {"f1": lambda v: 2e-4 * v.n[:, 0] * v.n[:, 1]}))
    assert_named(result, {EffectPlace("cross-product", "accelerometer-1", axes=(1, 2)): (2e-4,)})
    assert (result.proven.place, result.proven.quantity) == ("accelerometer-1", "n1 n2")


@pytest.mark.acceptance
def test_a_jump_in_a_temperature_that_jumps_once_is_not_told_from_a_step_in_time():
    noise = np.random.default_rng(11).uniform(-0.5, 0.5, 24)
    record = record_with(
        [11, 0],
        {"f2": lambda v: 3e-4 * (np.arange(24) >= 11)},
        24,
        temperature=lambda _: 20.0 + 5.0 * (np.arange(24) >= 11) + noise,
    )
    result = diagnosed(record)
    assert result.proven.place == "accelerometer-2"
    assert {"hours", "temperature"} <= {*result.proven.not_excluded}
    named = {cause.place.effect for causes in result.alternatives for cause in causes}
    assert (result.verdict, named) == ("ambiguous", {"bias-step", "temperature-bias-cubic"})


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [2, 7])
def test_a_single_reading_that_is_off_is_a_function_of_no_quantity(seed):
    """With few positions a function with a spike at its place would do as much; a reading is simpler.

    Where the senses of many inputs are unknown, a hysteresis of the same accelerometer may fit as well.
    """
    result = diagnosed(record_with([13, seed], {"f3": lambda v: 8e-5 * (np.arange(16) == 5)}, 16))
    outlier = EffectPlace("outlier", "position-6", axes=(3,))
    sets = [[cause.place for cause in explanation.causes] for explanation in result.explanations]
    assert [outlier] in sets
    assert all(place == outlier or place.where == "accelerometer-3" for places in sets for place in places)
    assert result.band is None
    assert result.proven is None or (result.proven.place, result.proven.quantity) == ("accelerometer-3", None)


def test_complexity_counts_what_is_searched_for():
    quadratic, wave = EffectPlace("quadratic", "accelerometer-1"), EffectPlace("encoder-harmonic", "outer-axis", 3)
    outlier, step = EffectPlace("outlier", "position-4", axes=(2,)), EffectPlace("bias-step", "accelerometer-1")
    assert [complexity_of([place]) for place in (quadratic, wave, outlier, step)] == [1, 3, 2, 2]
    assert complexity_of([quadratic, wave]) == 6


@pytest.mark.acceptance
def test_a_rival_is_a_table_of_knots_with_which_the_exact_model_stands():
    """Further positions can then be found that separate it from the listed effects."""
    evidence = evidence_of(record_with([12, 0], {"f1": lambda v: 2e-4 * np.tanh(3.0 * v.n[:, 1])}, 20))
    result: Any = dependence(evidence)
    unlisted = Unlisted(result.standing[:1], None, None)
    (fit,) = unlisted.fits(evidence)
    assert fit.radius <= evidence.model.limit
    assert (fit.places[0].effect, fit.places[0].where) == ("lookup", "accelerometer-1")
    assert unlisted.caution == (
        "equally simple, outside the catalogue: a function of the input of accelerometer 2 at accelerometer 1",
    )


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("law", "level"),
    [(lambda x: 2.2e-4 * np.tanh(x / 0.5), "quantity"), (lambda x: 2e-3 * x * np.abs(x), "law")],
    ids=["saturates", "odd quadratic"],
)
def test_an_odd_quadratic_is_said_alone_only_where_an_input_that_saturates_is_excluded(law, level):
    result = diagnosed(record_with([15, 1], {"f1": lambda v: law(v.n[:, 0])}, 30))
    assert [cause.title for cause in result.causes] == ["odd-quadratic accelerometer-1"]
    assert (result.verdict, result.level) == ("explained", level)
    shapes = [statement.shape for statement in result.laws if "exp" in statement.words]
    if level == "quantity":
        # A hyperbolic tangent of n / 0.5 is a logistic function of n / 0.25.
        assert any(low <= 0.25 <= high for low, high in shapes)
    else:
        assert (tuple(result.caution), shapes) == ((), [])


@pytest.mark.acceptance
def test_laws_that_were_not_all_tried_leave_none_alone(monkeypatch):
    evidence = evidence_of(record_with([16, 0], {"f2": lambda v: 4e-4 * v.n[:, 1] ** 5}))
    result: Any = dependence(evidence)
    proven = result.proven
    complete, work = Beyond(evidence, proven.pair, proven.form), Work()
    assert ([law.words for law in complete.laws], complete.is_one_law) == (["c n2⁵"], True)
    Laws(evidence, complete.pair, complete.each, work).standing([])
    # The sixth and the seventh power come last.
    monkeypatch.setattr("trihedron.tools.diagnosis.beyond.MOST_WORK", 0.9 * work.done)
    short = Beyond(evidence, proven.pair, proven.form)
    assert ([law.words for law in short.laws], short.is_one_law) == (["c n2⁵"], False)
