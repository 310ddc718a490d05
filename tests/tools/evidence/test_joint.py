"""Several records as one evidence: halves of a record together give the result of the whole, shared or not."""

from dataclasses import replace

import numpy as np
import pytest

from generator.positions import of_one_instrument
from generator.stands import random_bench, simulated
from instrument_records import at_a_table_and_by_hand
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import members_of
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import (
    Differs,
    bench_evidence,
    carried_evidence,
    in_record,
    is_of_instrument,
    join,
    mended,
    rms_size,
)
from trihedron.tools.trials import Hidden, draw_clean_block

SIGMA = 1e-5
ENCODER = EffectPlace("encoder-harmonic", "outer-axis", 2)
G_SENSITIVITY = EffectPlace("gyro-g-sensitivity", "gyro-block")
TRUE_G = (2e-3, 0.0, 0.0, 0.0, -1e-3, 0.0, 0.0, 0.0, 1.5e-3)


@pytest.fixture(scope="module")
def full_record():
    """Return a record of 40 positions, with a large effect on an encoder: its second order counts."""
    (record,) = of_one_instrument(3, 1, positions=40, shared=[(ENCODER, (3e-3, 0.4))])
    return record


@pytest.fixture(scope="module")
def halves(full_record):
    rows = np.arange(len(full_record))
    parts = {"even": rows[::2], "odd": rows[1::2]}
    return {
        label: bench_evidence(full_record.selected(rows_of_half), noise_bound=SIGMA)
        for label, rows_of_half in parts.items()
    }


@pytest.mark.acceptance
def test_halves_that_share_everything_are_the_whole_record(full_record, halves):
    """Compare fits, radius and intervals in the exact model, without an effect and with one beyond its first order."""
    alone, joint = bench_evidence(full_record, noise_bound=SIGMA), join(halves, shared=["*"])
    assert joint.rows.names == alone.rows.names
    assert joint.model.baseline.radius == pytest.approx(alone.model.refit(()).radius, rel=1e-6)
    whole_fit, joint_fit = alone.model.refit([ENCODER]), joint.model.refit([ENCODER])
    assert joint_fit.radius == pytest.approx(whole_fit.radius, rel=1e-6)
    assert joint_fit.radius < 1.0 < alone.model.radius
    np.testing.assert_allclose(joint_fit.ends(), whole_fit.ends(), rtol=1e-6, atol=1e-10)


@pytest.mark.acceptance
def test_halves_that_share_nothing_are_two_records(halves):
    """The radius of both is the larger of the two, and an interval is that of its own record."""
    apart = join(halves, own=["*"])
    assert apart.model.shared == ()
    fits = {label: half.model.refit([ENCODER]) for label, half in halves.items()}
    of_each = [in_record(ENCODER, label) for label in halves]
    together = apart.model.refit(of_each)
    assert together.radius == pytest.approx(max(fit.radius for fit in fits.values()), rel=1e-6)
    ends = {name: pair for (name, _), pair in zip(apart.rows.names, together.ends(), strict=True)}
    for label, fit in fits.items():
        for symbol, pair in zip(halves[label].model.here.symbols, fit.ends(), strict=True):
            np.testing.assert_allclose(ends[f"{symbol} in {label}"], pair, rtol=1e-6, atol=1e-10)


@pytest.mark.acceptance
def test_a_record_about_what_mends_it_by_itself_stands_as_with_that_effect_of_its_own(halves):
    """A set that is not sought in several records is then tried beside the others as in its own record."""
    alone = {label: mended(half, half.model.refit([ENCODER]), [ENCODER]) for label, half in halves.items()}
    of_each = [in_record(ENCODER, label) for label in halves]
    with_own, together = join(alone), join(halves)
    assert not with_own.model.falsified
    assert together.model.falsified
    assert with_own.model.baseline.radius == pytest.approx(together.model.refit(of_each).radius, abs=2e-3)
    # A set that mends only one of them does not stand.
    assert join({"even": alone["even"], "odd": halves["odd"]}).model.falsified
    # The fit subtracts the common remainder of all records again.
    without = join({label: mended(half, half.model.refit([ENCODER]), []) for label, half in halves.items()})
    assert without.model.falsified
    assert without.model.refit([ENCODER]).radius == pytest.approx(together.model.refit([ENCODER]).radius, abs=2e-3)


def test_what_is_the_instruments_by_default_and_by_what_is_asked():
    assert all(map(is_of_instrument, ("X4", "X15", "X6+X8", "accelerometer gamma_21", "gyro gamma_33")))
    assert not any(map(is_of_instrument, ("X1", "X8@north", "X16", "accelerometer bias_1", "gyro bias_2")))
    assert is_of_instrument("X16", shared=["bias-*"])
    assert not is_of_instrument("X6+X8", own=["misalignment-*"])


@pytest.mark.acceptance
def test_a_shared_parameter_that_differs_in_one_record_is_found_by_how_much_it_differs():
    rng = np.random.default_rng(8)
    bench = random_bench(rng)
    changed = bench + 0.0
    changed[9] += 4e-4
    records = {
        "first": simulated(bench, noise=rng.uniform(-SIGMA, SIGMA, (24, 3))),
        "second": simulated(changed, noise=rng.uniform(-SIGMA, SIGMA, (24, 3))),
    }
    joint = join({label: bench_evidence(record, noise_bound=SIGMA) for label, record in records.items()})
    assert joint.model.falsified
    place = Differs("parameter", "X4", record="second", unit="1")
    assert place in joint.model.places
    fit = joint.model.refit([place])
    assert fit.radius <= joint.model.limit
    ((low, high),) = fit.intervals()[0]
    assert low < 4e-4 < high
    # Two records do not show which one differs.
    assert joint.model.classes.equivalents(place) == (Differs("parameter", "X4", record="first", unit="1"),) or any(
        isinstance(changed, Differs) for changed in joint.model.classes.whole_class(place)
    )


def test_names_that_no_record_has_and_that_cannot_be_both_are_refused(halves):
    with pytest.raises(InputError, match=r"^--shared X44: no parameter of these records; "):
        members_of(halves, ["X44"], [])
    with pytest.raises(InputError, match=r"^--own bais-1: no parameter of these records; .*bias-1"):
        members_of(halves, [], ["bais-1"])
    with pytest.raises(InputError, match=r"^--shared and --own: X16 cannot be both"):
        members_of(halves, ["bias-*"], ["X16"])


@pytest.fixture(scope="module")
def carried():
    """Return two records of one block beside the true attitude, whose gyros sense gravity on both days."""
    cases = [draw_clean_block(77, k, "truth") for k in range(2)]
    same = cases[0].instrument.instruments
    evidence_of_day = {}
    for label, case in zip(("first", "second"), cases, strict=True):
        block, bias = case.instrument, {"bias": case.instrument.instruments.gyros["bias"]}
        of_day = replace(same, gyros={**same.gyros, **bias})
        hidden = Hidden(G_SENSITIVITY, TRUE_G)
        record = replace(block, instruments=of_day, temperature=None).measured(7, case.index, [hidden])
        evidence_of_day[label] = carried_evidence(record)
    return evidence_of_day


@pytest.mark.acceptance
def test_strapdown_records_share_an_effect_within_the_interval_of_each(carried):
    joint = join(carried)
    assert joint.model.falsified
    fit = joint.model.refit([G_SENSITIVITY])
    assert fit.radius <= joint.model.limit
    for (low, high), *alone in zip(
        fit.intervals()[0],
        *(day.model.refit([G_SENSITIVITY]).intervals()[0] for day in carried.values()),
        strict=True,
    ):
        for least, most in alone:
            assert least - 1e-9 <= low <= high <= most + 1e-9
    np.testing.assert_allclose(np.array(fit.intervals()[0])[:, 0] < np.array(TRUE_G), True)
    np.testing.assert_allclose(np.array(fit.intervals()[0])[:, 1] > np.array(TRUE_G), True)


@pytest.mark.acceptance
def test_what_was_found_in_one_strapdown_record_helps_on_the_other_by_the_fmus(carried):
    first, second = carried.values()
    estimate = {G_SENSITIVITY: first.rows.estimate([G_SENSITIVITY])[len(first.rows.names) :]}
    before, after = (rms_size(second.reader.rerun.errors(effects)) for effects in ({}, estimate))
    assert before == pytest.approx(rms_size(second.rows.parts[second.model.quoted].error), rel=0.05)
    assert after < 0.3 * before


@pytest.mark.first(1)
@pytest.mark.parametrize("baseline", ["symmetric", "asymmetric"])
def test_a_table_and_a_hand_tell_the_same_accelerometers(baseline):
    """Misalignments are the same for any turning; scale factors too if the table's do not depend on the sign.

    A changed one is reported; gyros, which the table lacks, are the strapdown record's own.
    """
    table, hand = at_a_table_and_by_hand(3, changed=2e-2)
    evidence = {
        "table": bench_evidence(table, noise_bound=SIGMA, baseline=baseline),
        "hand": carried_evidence(hand),
    }
    joint = join(members_of(evidence))
    scale = {"X4", "X9", "X14"} if baseline == "symmetric" else set()
    assert set(joint.model.shared) == {"X6+X8", "X7+X12", "X11+X13"} | scale
    assert "gyro gamma_11 in hand" in dict(joint.rows.names)
    assert joint.model.falsified
    fit = joint.model.refit([Differs("parameter", "X6+X8", record="hand", unit="rad")])
    assert fit.radius < 1.0
    ((low, high),) = fit.intervals()[0]
    assert low < 2e-2 < high
    # Effects of accelerometers act in both, those of gyros and of the table in one.
    common = {place.definition.component for place in joint.model.places if type(place) is EffectPlace}
    assert common == {"AccelerometerBlock"}
    assert join(members_of(evidence, own=["X6+X8"]), own=["X6+X8"]).model.baseline.radius < 1.0
