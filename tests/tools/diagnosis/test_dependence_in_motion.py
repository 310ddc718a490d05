"""Place and quantity of a carried block: the proofs for its gyros and accelerometers are true."""

from dataclasses import replace

import numpy as np
import pytest

from diagnoses import flowing
from generator.carried import camera_attitude, drawn_motion, strapdown_record
from trihedron.models.effects import EffectPlace
from trihedron.models.effects.lookup import Table
from trihedron.tools.diagnosis import Beyond, Diagnosis, Possible, diagnose
from trihedron.tools.diagnosis.dependence import Dependence, Standing, dependence
from trihedron.tools.diagnosis.rivals import Listed, Unlisted
from trihedron.tools.evidence import Carried, Form, Gravity, carried_evidence
from trihedron.tools.evidence.dependences import pairs_of_accelerometers
from trihedron.tools.records import StrapdownRecord
from trihedron.tools.reports.beyond import sections

PERIOD = 0.02
SIZE = 4e-3
"""[rad/s]"""


def filmed(add=None, *, seed: int = 4) -> StrapdownRecord:
    """Return a record before a camera; `add` (time (N,), rate (N, 3)) -> (N, 3) is the gyros' error [rad/s]."""
    rng = np.random.default_rng(seed)
    time, rate, n, attitude = drawn_motion(rng, moves=8, rest=2.0, period=PERIOD)
    readings = rate if add is None else rate + add(time, rate)
    return replace(
        strapdown_record((time, readings, n), seed=seed, rate_noise=7e-4), attitude=camera_attitude(rng, attitude, 1e-4)
    )


def between_rests(add=None, forces=None) -> StrapdownRecord:
    """Return a record between rests; `forces` is the accelerometers' error [g] at inputs (N, 3)."""
    time, rate, n, _ = drawn_motion(np.random.default_rng(4), moves=20, rest=2.0, period=PERIOD)
    readings = rate if add is None else rate + add(time, rate)
    return strapdown_record((time, readings, n if forces is None else n + forces(n)), rate_noise=7e-4)


def found_in(record: StrapdownRecord) -> Dependence:
    evidence = carried_evidence(record)
    assert isinstance(evidence.model, Carried)
    function = dependence(evidence)
    assert function is not None
    return function


def at_gyro(p: int, function):
    """Return the error of one gyro alone: `function` (time (N,), rate (N, 3)) -> (N,)."""

    def add(time, rate):
        added = np.zeros_like(rate)
        added[:, p - 1] = SIZE * function(time, rate)
        return added

    return add


def bump(time, rate):
    return 4.0 * np.exp(-(((rate[:, 1] - 0.4) / 0.15) ** 2))


def swing(time, rate):
    return np.sin(2.0 * np.pi * time / 17.0)


def of_third_rate(time, rate):
    return 3.0 * np.abs(rate[:, 2])


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("p", "function", "quantity", "record_of"),
    [
        (2, bump, "w2", filmed),
        (1, swing, "hours", filmed),
        pytest.param(2, of_third_rate, "w3", filmed, marks=pytest.mark.acceptance),
        (1, swing, "hours", between_rests),
    ],
)
def test_the_gyro_and_what_its_error_depends_on_are_found(p, function, quantity, record_of):
    function = found_in(record_of(at_gyro(p, function)))
    assert function.place == f"gyro-{p}"
    assert quantity in {standing.pair.quantity for standing in function.standing}
    # Between rests a weak fault leaves other quantities of the same gyro possible.
    assert function.proven is not None or record_of is between_rests
    assert function.proven is None or function.proven.pair.quantity == quantity


@pytest.mark.acceptance
def test_a_function_of_the_angular_acceleration_has_laws_and_a_table():
    def square(time, rate):
        growing = np.gradient(rate[:, 1], time)
        return 4.0 * (growing / np.abs(growing).max()) ** 2

    evidence = carried_evidence(filmed(at_gyro(2, square)))
    assert isinstance(evidence.model, Carried)
    (pair,) = (p for p in evidence.reader.pairs if (p.where, p.quantity, p.factor) == ("gyro-2", "dw2", ""))
    beyond = Beyond(evidence, pair, Form("pieces", 2))
    assert [law.words for law in beyond.laws] == ["c dw2²"]
    table = pair.table("dw2 at -2.0 0.5 3.0")
    of_kernel, on_nodes = (
        evidence.including([table]).rows.columns_of([table]),
        pair.spread(Table.of(table.law).columns(pair.values)),
    )
    # It bends between two nodes.
    assert of_kernel == pytest.approx(on_nodes, abs=0.01 * np.abs(of_kernel).max())


@pytest.mark.acceptance
def test_functions_that_bend_between_nodes_differ_from_straight_ones_by_what_is_said():
    """Compare rows of the exact table, with knots that are not nodes: they are within the bound of the straight
    ones."""
    evidence, rng = carried_evidence(filmed()), np.random.default_rng(5)
    assert isinstance(evidence.model, Carried)
    for quantity in ("w2", "hours"):
        (pair,) = (p for p in evidence.reader.pairs if (p.where, p.quantity, p.factor) == ("gyro-2", quantity, ""))
        possible = Possible(evidence, pair)
        assert pair.missed is not None
        low, high = pair.values[[0, -1]]
        knots = np.concatenate([[low], np.sort(rng.uniform(low, high, 12)), [high]])
        table = Table(quantity, "at", tuple(knots.tolist()))
        place, values = pair.table(table.law), rng.normal(size=14)
        exact = evidence.including([place]).rows.columns_of([place]) @ values
        interpolated = np.interp(possible.knots, knots, values)
        straight = pair.spread(possible.hats(possible.knots) @ interpolated)
        bends = float(np.abs(np.diff(np.diff(values) / np.diff(knots))).sum())
        off, most = np.abs(exact - straight), bends * pair.missed(possible.knots)
        assert (off <= most + 1e-9 * np.abs(exact).max()).all()
        assert off.max() > 0.01 * most.max()


@pytest.mark.acceptance
def test_gyros_that_all_swing_are_one_place_with_several_functions():
    def all_swing(time, rate):
        return SIZE * np.sin(2.0 * np.pi * time[:, None] / 17.0 + np.arange(3.0))

    function = found_in(filmed(all_swing))
    assert (function.place, function.proven and function.proven.pair.quantity) == ("gyro-block", "hours")


@pytest.mark.acceptance
def test_faults_of_two_gyros_in_different_quantities_are_proven_of_none():
    def of_both_gyros(time, rate):
        return at_gyro(2, bump)(time, rate) + at_gyro(1, lambda time, rate: swing(time, rate) * (time > 20.0))(
            time, rate
        )

    function = found_in(filmed(of_both_gyros))
    assert function.proven is None


@pytest.mark.acceptance
def test_an_accelerometer_that_bends_is_not_put_down_to_a_gyro():
    def bent(n):
        return np.column_stack([np.zeros((len(n), 2)), 1e-2 * np.sin(5.0 * n[:, 2])])

    result = diagnose(between_rests(forces=bent), rerun=False)
    assert isinstance(result, Diagnosis)
    assert (result.verdict, result.level) == ("unexplained", "quantity")
    assert result.proven is not None
    assert (result.proven.place, result.proven.quantity) == ("accelerometer-3", "n3")


@pytest.mark.acceptance
@pytest.mark.parametrize("record_of", [filmed, between_rests])
def test_the_linear_functions_of_a_pair_are_the_columns_of_the_catalogue(record_of):
    """A linear function of a rate is a scale factor or a misalignment, one of time a drift: exactly, in two ways."""
    evidence = carried_evidence(record_of(at_gyro(1, swing)))
    assert isinstance(evidence.model, Carried)
    pairs = {(pair.where, pair.name): pair for pair in evidence.reader.pairs}
    hours = evidence.rows.columns_of([EffectPlace("gyro-bias-drift", "gyro-block")])
    drift = evidence.rows.columns_of([EffectPlace("gyro-scale-drift", "gyro-block")])
    for p in (1, 2, 3):
        for column, name in ((hours, "hours"), (drift, f"w{p} times hours")):
            pair = pairs[f"gyro-{p}", name]
            by_functions = pair.spread(pair.values[:, None])[:, 0]
            assert np.abs(by_functions - column[:, p - 1]).max() <= 1e-6 * np.abs(column[:, p - 1]).max()
    if isinstance(evidence.model.reference, Gravity):
        accelerometer_pairs = pairs_of_accelerometers(
            evidence.rows.parts, evidence.model.reference, evidence.rows.point[:9], evidence.model.attitude
        )
        cubic = evidence.rows.columns_of([EffectPlace("cubic", "accelerometer-2")])[:, 0]
        pair = next(pair for pair in accelerometer_pairs if (pair.where, pair.quantity) == ("accelerometer-2", "n2"))
        assert np.abs(pair.spread(pair.values[:, None] ** 3)[:, 0] - cubic).max() <= 1e-9 * np.abs(cubic).max()


def test_large_errors_prove_nothing():
    """There is no result if the linear model errs by more than a bound."""
    evidence = carried_evidence(filmed(lambda time, rate: 60.0 * at_gyro(2, bump)(time, rate)))
    assert isinstance(evidence.model, Carried)
    assert evidence.model.second_order > 1.0
    assert dependence(evidence) is None


@pytest.mark.acceptance
def test_the_verdict_says_place_and_quantity():
    result = diagnose(filmed(at_gyro(1, swing)), rerun=False)
    assert isinstance(result, Diagnosis)
    assert (result.verdict, result.level) == ("unexplained", "quantity")
    assert result.proven is not None
    assert (result.proven.place, result.proven.quantity) == ("gyro-1", "hours")


def test_a_wave_has_a_place_among_forms():
    values = np.linspace(0.0, 2.0, 9)
    columns = Form("wave", at=1.5).columns(values)
    assert columns == pytest.approx(
        np.stack([np.cos(1.5 * np.pi * values), np.sin(1.5 * np.pi * values)], axis=1), abs=1e-12
    )


@pytest.mark.acceptance
def test_of_three_gyros_each_has_a_band_that_holds_its_function_and_together_they_extend_the_model():
    """The bias of each swings with a size of its own, which no catalogue lists."""
    sizes = SIZE * np.array([1.0, -0.8, 1.2])
    result = diagnose(filmed(lambda time, rate: swing(time, rate)[:, None] * sizes), rerun=False)
    assert isinstance(result, Diagnosis)
    assert (result.verdict, result.level, result.band) == ("unexplained", "quantity", None)
    assert result.proven is not None
    assert (result.proven.place, result.proven.quantity) == ("gyro-block", "hours")
    assert result.bands is not None
    assert [(band.where, band.quantity) for band in result.bands] == [(f"gyro-{p}", "hours") for p in (1, 2, 3)]
    swings = [
        size * np.sin(2.0 * np.pi * 3600.0 * possible.knots / 17.0)
        for size, possible in zip(sizes, result.beyond.each, strict=True)
    ]
    for p, (band, possible) in enumerate(zip(result.bands, result.beyond.each, strict=True)):
        swings_of_others = [values for q, values in enumerate(swings) if q != p]
        truths = possible.every.told(np.concatenate([swings[p], *swings_of_others]))[: len(possible.knots)]
        truths = truths[np.searchsorted(possible.knots, [knot["at"] for knot in band.knots])]
        ends = np.array([(knot["low"], knot["high"]) for knot in band.knots])
        assert (ends[:, 0] <= truths).all()
        assert (truths <= ends[:, 1]).all()
        # The band is wide for three functions at once, and still follows the function.
        assert np.corrcoef(ends.mean(axis=1)[1:-1], truths[1:-1])[0, 1] > 0.9
    assert result.extension is not None
    assert len(result.extension.causes) == 3
    assert len(sections(result)) == 3
    assert "for each gyro, functions of time" in flowing(result)


@pytest.mark.acceptance
def test_a_law_of_three_gyros_that_is_named_is_told_beside_those_that_do_as_well():
    """Each errs with the fifth power of its own rate: the cube of the catalogue fits, but is not the only one."""
    sizes = 0.05 * np.array([1.2e-3, -0.9e-3, 1.5e-3])
    result = diagnose(filmed(lambda time, rate: sizes * rate**5), rerun=False)
    assert isinstance(result, Diagnosis)
    assert [cause.effect for cause in result.causes] == ["gyro-rate-cubed"]
    assert (result.verdict, result.level) == ("explained", "quantity")
    assert result.bands is not None
    assert [(band.where, band.quantity) for band in result.bands] == [(f"gyro-{p}", f"w{p}") for p in (1, 2, 3)]
    assert "c w1⁵ with c w2⁵ with c w3⁵" in [law.words for law in result.laws or ()]
    assert "the exact law: any curve within the band" in flowing(result)


@pytest.mark.acceptance
def test_what_is_proven_is_no_rival_of_itself():
    """For a cube of the input at one gyro the formulas come first; effects of the catalogue need more numbers."""
    rng = np.random.default_rng(4)
    time, rate, n, attitude = drawn_motion(rng, moves=8, rest=2.0, period=PERIOD)
    rate[:, 0] += 6e-3 * n[:, 0] ** 3
    record = strapdown_record((time, rate, n), seed=4, rate_noise=7e-4)
    result = diagnose(replace(record, attitude=camera_attitude(rng, attitude, 1e-4)), rerun=False)
    assert isinstance(result, Diagnosis)
    first, *others, last = result.explanations
    assert (result.verdict, first.kind, first.numbers) == ("ambiguous", "formula", 2)
    assert "c * n1 ** 3" in first.sentence
    assert {other.kind for other in others} == {"formula"}
    assert (last.kind, len(last.causes)) == ("effect", 2)
    assert last.numbers > first.numbers + 1
    assert result.proven is not None
    assert (result.proven.place, result.proven.quantity) == ("gyro-1", "n1")
    assert not any("in no catalogue" in text for text in result.caution)
    assert "c n1³" in [law.words for law in result.laws or ()]


@pytest.mark.acceptance
@pytest.mark.parametrize(("effect", "elsewhere"), [("gyro-rate-squared", False), ("gyro-g-sensitivity", True)])
def test_what_is_proven_is_beside_a_set_that_acts_otherwise_and_beside_no_other(effect: str, elsewhere: bool):
    evidence = carried_evidence(filmed(at_gyro(2, lambda time, rate: rate[:, 1] ** 2)))
    assert isinstance(evidence.model, Carried)
    (pair,) = (p for p in evidence.reader.pairs if (p.where, p.quantity, p.factor) == ("gyro-2", "w2", ""))
    # The quantity is the same and the form differs from the effect's: an equal function is not its own rival.
    forms = [Standing(pair, Form("pieces", 2), 2, 0.9), Standing(pair, Form("jump", at=0.4), 2, 0.9)]
    place = EffectPlace(effect, "gyro-block")
    unlisted = Unlisted.of(
        Dependence(tuple(forms), (), ("gyro-2",), 3.0), Listed(evidence), evidence.model.refit([place])
    )
    assert unlisted.rivals == (tuple(forms[:1]) if elsewhere else ())
    assert [text for text in unlisted.caution if "catalogue" in text] == []
    assert any("the proven function" in text for text in unlisted.caution) == elsewhere
