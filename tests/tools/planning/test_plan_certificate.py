"""Forms are the regressors and admissible sets of the model; the bound of |F'y| holds, and is tight."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planning_reference import random_mounting
from trihedron.models.bench import admissible, nominal_input
from trihedron.tools.calibration import Positions, parametrise, reading_jacobian
from trihedron.tools.errors import InputError
from trihedron.tools.planning import SignSheet, clearance, sheets, value
from trihedron.tools.planning.certificate import ROUNDING, ceiling
from trihedron.tools.planning.forms import Ridges, dual_forms


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), symmetric=st.booleans(), rule=st.sampled_from(["paper", "tables"]))
def test_forms_are_the_model(seed: int, symmetric: bool, rule: str) -> None:
    rng = np.random.default_rng(seed)
    q = random_mounting(seed) if seed % 3 else np.eye(3)
    p = parametrise({"q": q}, symmetric=symmetric)
    alpha, beta = rng.uniform(-4, 10, (2, 200))
    jacobian = reading_jacobian(p, np.zeros(len(p.symbols)), Positions(alpha, beta, np.zeros(200, dtype=int)))
    m = nominal_input(alpha, beta, q)
    allowed = admissible(alpha, beta, q, bounds=(2e-3, 3e-2), rule=rule)
    certain = np.zeros((200, 3), dtype=bool)
    for sheet in sheets(p, bounds=(2e-3, 3e-2), rule=rule):
        i = sheet.accelerometer
        valid = np.full(200, True) if symmetric else m[:, i] * sheet.sign > 0
        np.testing.assert_allclose(value(sheet.regressor, alpha, beta)[valid], jacobian[valid, i], atol=1e-14)
        certain[:, i] |= clearance(sheet, alpha, beta) > 0
    assert (certain == (True if symmetric else allowed)).all()


@pytest.mark.parametrize(
    ("bounds", "message"),
    [((-1.0, 0.01), "not negative"), ((np.nan, 0.01), "finite"), ((0.003, 1.2), "leave no position")],
)
def test_wrong_bounds_are_refused(bounds: tuple[float, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        sheets(parametrise({"identity": np.eye(3)}), bounds=bounds)


def test_bounds_of_next_to_nothing_give_arcs_without_a_warning() -> None:
    """If a form does not depend on β, its arc has no end, for any ratio."""
    block = sheets(parametrise({"identity": np.eye(3)}), bounds=(1e-320, 1e-320))
    ridges, alpha = Ridges(block, 1e-6), np.linspace(0.0, np.pi, 8)
    ends = [ridges.arcs(np.full(8, k), alpha).ends for k in range(len(block))]
    assert any(np.isfinite(beta).all(axis=1).any() for beta in ends)


def sampled_maximum(block: list[SignSheet], dual: np.ndarray, seed: int) -> float:
    """Return the greatest |F'y| of many admissible positions; corners of the set are among them only by chance."""
    rng = np.random.default_rng(seed)
    alpha, beta = rng.uniform(0, 2 * np.pi, (2, 40_000))
    greatest = 0.0
    for sheet, form in zip(block, dual_forms(block, dual), strict=True):
        inside = clearance(sheet, alpha, beta) >= 0.0
        greatest = max(greatest, float(np.abs(value(form, alpha[inside], beta[inside])).max()))
    return greatest


@pytest.mark.acceptance
@settings(max_examples=8)
@given(seed=st.integers(0, 10**6), symmetric=st.booleans(), rule=st.sampled_from(["paper", "tables"]))
def test_the_bound_is_between_samples_and_violation(seed: int, symmetric: bool, rule: str) -> None:
    """No sample exceeds a proven bound; a reported violation is real, at an admissible position."""
    rng = np.random.default_rng(seed)
    p = parametrise({"q": random_mounting(seed)}, symmetric=symmetric)
    block = sheets(p, bounds=(1e-3, 3e-2), rule=rule)
    dual = rng.normal(size=len(p.symbols))
    greatest = sampled_maximum(block, dual, seed)
    proven = ceiling(block, dual, 1.02 * greatest)
    assert not len(proven.violations)
    assert greatest <= proven.bound <= 1.02 * greatest
    refuted = ceiling(block, dual, 0.99 * greatest)
    assert len(refuted.violations)
    assert refuted.bound == np.inf
    for k, sense, alpha, beta in refuted.violations:
        form = dual_forms(block, dual)[int(k)]
        assert sense * value(form, alpha, beta) > 0.99 * greatest
        assert clearance(block[int(k)], alpha, beta) >= 0.0


@pytest.mark.parametrize("excess", [1e-6, 1e-9, 1e-12])
def test_a_curve_of_contact_is_bounded_tightly(excess: float) -> None:
    """y for scale factor and bias at Q = I: F'y = (2|m| − 1 − δ)/(1 − δ) is −1 on a whole circle and 1 at the pole."""
    u, v = 3e-3, 1e-2
    delta = np.sin(np.arcsin(v / np.hypot(1 - v, u + v)) + np.arctan2(u + v, 1 - v))
    p = parametrise({"q": np.eye(3)})
    dual = np.zeros(18)
    for symbol, amount in (("X14", 2.0), ("X15", -2.0), ("X18", -1.0 - delta)):
        dual[p.symbols.index(symbol)] = amount / (1.0 - delta)
    block = sheets(p, bounds=(u, v), rule="tables")
    assert ceiling(block, dual, 1.0 + excess).bound <= 1.0 + excess + 1e-15
    assert len(ceiling(block, dual, 1.0 - 1e-6).violations)


def test_a_search_that_is_cut_short_still_bounds() -> None:
    p = parametrise({"q": random_mounting(3)})
    block = sheets(p)
    dual = np.random.default_rng(3).normal(size=18)
    greatest = sampled_maximum(block, dual, 3)
    short = ceiling(block, dual, greatest * (1.0 + 1e-3), max_boxes=4000)
    assert short.bound >= greatest
    assert not len(short.violations)


def test_forms_are_evaluated_to_the_rounding_that_is_allowed_for() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        form, alpha, beta = rng.normal(size=(3, 3)), *rng.uniform(-7, 7, 2)
        a, b = (np.array([np.cos(np.longdouble(x)), np.sin(np.longdouble(x)), 1.0]) for x in (alpha, beta))
        exact = a @ form.astype(np.longdouble) @ b
        assert abs(float(exact - value(form, alpha, beta))) < 0.1 * ROUNDING * np.abs(form).sum()
