"""The limits of proof: beyond the bounds, by one number for each piece, beside equally good readings or sets."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron
from diagnoses import diagnosed, flowing, sets_of
from generator import SIGMA
from generator.positions import Session, drawn_record, hidden_record, record_with
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded import Work
from trihedron.tools.bounded.programmes import SolverError
from trihedron.tools.diagnosis.dependence import dependence
from trihedron.tools.evidence.bench import Bench, bench_evidence
from trihedron.tools.trials import Options, diagnosed_case, draw_case

FIELD = Path(os.environ.get("TRIHEDRON_DATA", Path(__file__).parents[4] / "shared" / "data")) / "field"
SAG = EffectPlace("sag", "outer-axis")
QUADRATICS = [EffectPlace("quadratic", f"accelerometer-{p}") for p in (1, 2, 3)]
"""Effects: the first is tried every time, the others before a release."""
LONG = [pytest.param(place, marks=pytest.mark.acceptance) for place in QUADRATICS[1:]]


def field_diagnosis(name: str) -> Any:
    """Return the diagnosis of a record from the field."""
    if not (FIELD / name).exists():
        pytest.skip(f"{FIELD / name} is not there; TRIHEDRON_DATA names the folder above")
    return trihedron.diagnose(FIELD / name, noise_bound=1e-5)


@pytest.mark.parametrize("accelerometer", [1, 2, 3])
def test_nothing_is_proven_above_its_bound_or_by_as_many_numbers_as_pieces(accelerometer):
    record = record_with(accelerometer, {f"f{accelerometer}": lambda v: 3e-4 * v.n[:, accelerometer - 1] ** 5})
    shown = dependence(bench_evidence(record, noise_bound=SIGMA))
    assert shown is not None
    assert shown.place == f"accelerometer-{accelerometer}"
    assert shown.limit < 1.011
    above = [replace(standing, radius=1.06) for standing in shown.standing]
    assert replace(shown, standing=tuple(above)).proven is None
    many = [replace(standing, complexity=20) for standing in shown.standing]
    assert replace(shown, standing=tuple(many)).proven is None


@pytest.mark.acceptance
def test_two_readings_that_do_as_well_leave_nothing_proven():
    assert field_diagnosis("x11_local_16.csv").proven.quantity is None


@pytest.mark.acceptance
@pytest.mark.parametrize("name", ["x08_mag_16", "x10_triple_24", "x14_walk_16"])
def test_a_record_is_not_refused_for_a_programme_that_fails(name):
    result = field_diagnosis(f"{name}.csv")
    assert result.verdict in ("explained", "unexplained", "ambiguous")
    # A formula may do; no effect of the catalogue acts in these records.
    assert all(cause.place.law for cause in result.causes)


@pytest.mark.acceptance
@pytest.mark.parametrize("place", [QUADRATICS[0], *LONG])
def test_a_set_on_which_the_solver_fails_is_said_to_be_not_tried(place, monkeypatch):
    mended = Bench.mended

    def failing(model: Bench, places: Any, work: Any) -> Any:
        if tuple(places) == (place,):
            raise SolverError("a linear programme was not solved: Unbounded")
        return mended(model, places, work)

    monkeypatch.setattr(Bench, "mended", failing)
    result = diagnosed(hidden_record(4, place, (4e-4,)))
    assert result.verdict != "explained"
    assert any("not tried, since the solver failed" in text and place.title in text for text in result.warnings)


def unsolved(*_: Any, **__: Any) -> Any:
    raise SolverError("a linear programme was not solved: Unbounded")


@pytest.mark.first(2)
@pytest.mark.parametrize(
    ("place", "stage"),
    [
        ("trihedron.tools.diagnosis.dependence.chebyshev_radius", "functions of one quantity"),
        ("trihedron.tools.sieve.sigma.LeadingFunctions", "faults of the record"),
        ("trihedron.tools.evidence.bench.powers", "the detection limit"),
    ],
)
def test_a_stage_in_which_the_solver_fails_is_said_to_be_not_tried(place, stage, monkeypatch):
    monkeypatch.setattr(place, unsolved)
    result = diagnosed(drawn_record(3, [(QUADRATICS[0], (3e-4,))], 20), rerun=True)
    assert result.calibration.verdict == "falsified"
    assert f"not tried, since the solver failed: {stage}" in result.warnings


@pytest.mark.acceptance
def test_a_wander_on_which_the_solver_fails_refuses_no_record(monkeypatch):
    monkeypatch.setattr("trihedron.tools.evidence.bench_wander.any_centre", unsolved)
    pair = [(QUADRATICS[0], (4e-4,)), (QUADRATICS[1], (-4e-4,))]
    result = diagnosed(drawn_record(5, pair, 24))
    assert {place for place, _ in pair} in sets_of(result)


@pytest.mark.acceptance
@pytest.mark.parametrize("options", [Options(whole=True, positions=(24, 30)), Options(strapdown=True)])
def test_bench_and_strapdown_records_are_not_refused_for_a_programme_that_fails(options, monkeypatch):
    case = draw_case(options, 78, 0)
    record = case.measured()
    monkeypatch.setattr("trihedron.tools.diagnosis.dependence.chebyshev_radius", unsolved)
    result = diagnosed_case(case, record)
    assert result.verdict != "consistent"
    assert any("not tried, since the solver failed" in text for text in result.warnings)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_true_set_stands_though_every_error_is_at_its_bound(seed):
    product = EffectPlace("cross-product", "accelerometer-3", None, (1, 2))
    record = drawn_record(seed, [(SAG, (1.55e-4, 0.5)), (product, (2.1e-4,))], 100, at_bound=True)
    model = bench_evidence(record, noise_bound=SIGMA).model
    fits = model.mended((SAG, product), Work())
    assert fits
    assert fits[0].radius <= model.limit


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [21, *(pytest.param(seed, marks=pytest.mark.acceptance) for seed in (22, 23))])
def test_only_positions_that_decide_are_proposed(seed):
    """For cubic or odd quadratic, few readings leave both; the proposal separates two of the candidates."""
    place = EffectPlace("odd-quadratic", "accelerometer-1")
    result = diagnosed(drawn_record(seed, [(place, (1.5e-4,))], 20))
    positions = result.next_positions or ()
    assert len(positions) <= 6
    assert all(position["apart_g"] > 2.0 * SIGMA for position in positions)
    if result.verdict == "ambiguous" and not positions:
        assert "No further position surely tells two of them apart" in flowing(result)
    assert np.isfinite(result.radius)


LAWS = (
    lambda v, n: n**5,
    lambda v, n: n**7,
    lambda v, n: np.sin(3.0 * n),
    lambda v, n: np.exp(-(((n - 0.3) / 0.3) ** 2)),
    lambda v, n: np.tanh(4.0 * n),
    lambda v, n: np.cos(9.0 * v.beta),
    lambda v, n: np.cos(7.0 * v.alpha),
)
QUANTITY = (None, None, None, None, None, "beta", "alpha")
"""Of each law the quantity; None: the accelerometer's own input."""


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.acceptance) for k in range(4, 20))])
def test_what_is_proven_of_drawn_records_outside_the_catalogue_is_true(seed):
    """16 to 48 positions, errors of 15 to 120 σ: the place is right, the quantity is or is left open."""
    rng = np.random.default_rng([seed, 91])
    p, count, k = int(rng.integers(1, 4)), int(rng.integers(16, 49)), int(rng.integers(len(LAWS)))
    size = SIGMA * float(rng.choice([-1.0, 1.0]) * rng.uniform(15.0, 120.0))
    record = record_with([seed, 7], {f"f{p}": lambda v: size * LAWS[k](v, v.n[:, p - 1])}, count)
    shown = dependence(bench_evidence(record, noise_bound=SIGMA))
    assert shown is not None
    assert shown.place == f"accelerometer-{p}"
    if shown.proven is not None:
        wanted = QUANTITY[k] or f"n{p}"
        assert any(standing.pair.name == wanted for standing in shown.standing)
        assert shown.proven.radius <= 1.0101


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.acceptance) for k in (2, 3, 4))])
def test_a_misfit_of_a_hundred_bounds_leaves_no_second_order(seed):
    """Errors are at their bound, and the harmonic is among the forms: the exact model leaves the bound and no more."""
    rng = np.random.default_rng([seed, 3])
    session = Session.drawn(rng, 32)
    angles, reading = session.read([], SIGMA * rng.choice([-1.0, 1.0], (32, 3)))
    reading[:, 1] += 1e-3 * np.cos(5.0 * session.alpha + seed)
    shown = dependence(bench_evidence(session.recorded(angles, reading), noise_bound=SIGMA))
    assert shown is not None
    assert shown.radius > 60.0
    (alpha,) = [standing for standing in shown.standing if standing.pair.name == "alpha"]
    assert alpha.radius <= 1.0 + 1e-6
