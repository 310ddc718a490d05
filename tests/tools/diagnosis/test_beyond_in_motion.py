"""Faults outside the catalogue, of a carried block: band, laws, extension and power are true."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from scipy.optimize import linprog

from diagnoses import worst_carried
from generator.carried import OutsideGyro, outside_gyro
from scenario_runs import run_of_file
from trihedron.models.effects import EffectPlace
from trihedron.models.effects.formula import Formula
from trihedron.tools.bounded import chebyshev_radius
from trihedron.tools.diagnosis import Diagnosis, diagnose, export_extended
from trihedron.tools.evidence import PIECES, Carried, Form, carried_evidence
from trihedron.tools.records import StrapdownRecord, read_record

HUMP = 9
"""Case of the generator with a gyro's bias that rises and falls once, between rests."""


@cache
def of_hump() -> tuple[OutsideGyro, Diagnosis]:
    case = outside_gyro(Path(mkdtemp()) / "s.strapdown.csv", 7, HUMP)
    result = diagnose(read_record(case.path, StrapdownRecord))
    assert isinstance(result, Diagnosis)
    return case, result


@pytest.mark.acceptance
def test_the_true_function_is_in_the_band():
    case, result = of_hump()
    assert (result.verdict, result.level) == ("unexplained", "quantity")
    assert result.band is not None
    assert (result.band.where, result.band.quantity) == (case.place, case.quantity) == (case.place, "hours")
    possible = result.beyond.possible
    true = np.interp(possible.knots, case.values, case.fault)
    truths = possible.every.told(true)[np.searchsorted(possible.knots, [knot["at"] for knot in result.band.knots])]
    ends = np.array([(knot["low"], knot["high"]) for knot in result.band.knots])
    assert (ends[:, 0] <= truths).all()
    assert (truths <= ends[:, 1]).all()
    # It says something: where the bias is largest it is not zero, and the band is narrower than the function.
    assert np.median(np.ptp(ends, axis=1)) < np.ptp(truths)
    assert (np.sign(ends[:, 0]) == np.sign(ends[:, 1])).any()


@pytest.mark.acceptance
def test_the_extension_predicts_what_was_left_out_and_is_exported(tmp_path):
    """The extended gyros carry gravity to its direction by the accelerometers, after every move, within the bounds."""
    case, result = of_hump()
    extension = result.extension
    assert extension is not None
    assert extension.gain is not None
    assert extension.gain.held_out_rms_after < 0.25 * extension.gain.held_out_rms_before
    export_extended(result, tmp_path, "native")
    assert worst_carried(result.evidence, run_of_file(tmp_path / "scenario.toml").table) <= 1.05
    assert extension.knots is not None
    # The stated function is the hump, but for the biases that the model has.
    at, stated = (np.array([knot[name] for knot in extension.knots]) for name in ("at", "estimate"))
    true = np.interp(at, case.values, case.fault)
    assert np.ptp((stated - true) - np.mean(stated - true)) < 0.5 * np.ptp(true)


@pytest.mark.acceptance
def test_bounds_as_much_larger_as_is_said_would_do():
    _, result = of_hump()
    evidence = result.evidence
    assert result.noise_bound_needed == pytest.approx(evidence.model.radius * result.noise_bound_arcmin)
    for part, stands in ((1.001, True), (0.999, False)):
        rows = evidence.rows.with_bounds([p.bound * part * evidence.model.radius for p in evidence.rows.parts])
        assert (replace(evidence.model, rows=rows).radius <= evidence.model.limit) == stands


@pytest.mark.acceptance
@pytest.mark.parametrize("law", ["w2 += c*w2**3", "w1 += a*n2 + b*dw3", "f3 += c*n3**2"])
def test_a_law_that_comes_later_has_the_columns_of_one_that_was_run(law):
    """The rows are the same with the catalogue from the beginning, or added to existing evidence."""
    case, result = of_hump()
    place = Formula.of(law).place
    run = carried_evidence(read_record(case.path, StrapdownRecord), further=[place])
    assert isinstance(run.model, Carried)
    later = result.evidence.including([place])
    assert later.rows.columns_of([place]) == pytest.approx(run.rows.columns_of([place]), rel=1e-9, abs=1e-9)
    assert later.including([place]) is later


@pytest.mark.acceptance
def test_a_place_that_knows_no_such_law_is_refused():
    _, result = of_hump()
    with pytest.raises(ValueError, match="has no alpha"):
        result.evidence.including([EffectPlace("lookup", "gyro-block", axes=(1,), law="alpha around 0 2 4")])


@pytest.mark.acceptance
def test_the_power_is_what_can_hide():
    """From that size on every function shows, and a smaller one may hide: by an independent programme."""
    _, result = of_hump()
    assert result.power is not None
    evidence, rng = result.evidence, np.random.default_rng(3)
    pairs = {(pair.where, pair.quantity, pair.factor): pair for pair in evidence.reader.pairs}
    sizes = {(power["place"], power["quantity"], power.get("factor", "")): power["size"] for power in result.power}
    nominal, form = evidence.rows.nominal, Form("pieces", PIECES)
    for key in (("gyro-1", "w1", ""), ("gyro-3", "hours", "")):
        pair, size = pairs[key], sizes[key]
        assert size is not None
        columns = pair.columns(form)
        knots = np.linspace(-1.0, 1.0, PIECES + 1)
        # A bias, and a scale factor, are the model's own.
        imitated = np.stack([np.ones(PIECES + 1), knots], axis=1)[:, : 2 if key[1] == "w1" else 1]
        keeps = np.eye(PIECES + 1) - imitated @ np.linalg.pinv(imitated)
        scale = np.linalg.norm(nominal, axis=0)
        matrix = np.hstack((nominal / scale, columns))
        largest = 0.0
        for projected in keeps:
            cost = np.concatenate([np.zeros(nominal.shape[1]), -projected])
            solution = linprog(
                cost, np.vstack((matrix, -matrix)), np.full(2 * len(matrix), 2.0), bounds=(None, None), method="highs"
            )
            largest = max(largest, -solution.fun)
        assert size == pytest.approx(largest, rel=1e-3)
        for _ in range(5):
            values = keeps @ rng.normal(size=PIECES + 1)
            values *= 1.01 * size / np.abs(values).max()
            assert chebyshev_radius(nominal, columns @ values, np.ones(len(nominal)))[0] > 2.0


@pytest.mark.acceptance
@pytest.mark.parametrize("index", [0, 3])
def test_a_table_predicts_where_few_readings_determine_its_knots(tmp_path, index):
    """A bump of the rate, and a wave of specific force between rests: plain least squares made predictions worse."""
    case = outside_gyro(tmp_path / "s.strapdown.csv", 7, index)
    extension = diagnose(read_record(case.path, StrapdownRecord)).extension
    assert extension is not None
    assert extension.gain is not None
    assert extension.gain.held_out_rms_after < 0.35 * extension.gain.held_out_rms_before
