"""The two sizes with a theory: every noise within σ is detected at them, and some noise hides below them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from generator.stands import random_bench, record
from trihedron.models.bench import elementary_reading
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.models.effects.last_stage import place_of
from trihedron.tools.bounded import chebyshev_radius, spread_directions
from trihedron.tools.calibration import Linearisation, fit_record
from trihedron.tools.evidence import Cell, circumstances_of, signature_columns
from trihedron.tools.trials import KnownBench
from trihedron.tools.trials.sizes import DIRECTIONS, level_change

SIGMA = 1e-5
RNG = np.random.default_rng(11)
ANGLES = np.radians(RNG.uniform(0.0, 360.0, (40, 2)))
BENCH = random_bench(RNG)
CUBIC = EffectPlace("cubic", "accelerometer-1")
ODD = EffectPlace("odd-quadratic", "accelerometer-1")
QUADRATIC = EffectPlace("quadratic", "accelerometer-2")
ENCODER = EffectPlace("encoder-harmonic", "outer-axis", 2)
WOBBLE = EffectPlace("axis-wobble", "inner-axis", 2)
SAG = EffectPlace("sag", "inner-axis")


@pytest.fixture(scope="module")
def nominal() -> KnownBench:
    """Return the model at a true bench with 40 positions anywhere, and the rows' circumstances."""
    alpha, beta = ANGLES.T
    measured = record(elementary_reading(BENCH, alpha, beta, np.eye(3)), alpha, beta)
    return KnownBench(fit_record(measured, noise_bound=SIGMA), circumstances_of(measured))


def change_columns(nominal: KnownBench, place: EffectPlace) -> np.ndarray:
    return signature_columns([place], nominal.rows)


def radius(model: Linearisation, readings: np.ndarray, extra=None) -> float:
    columns = model.jacobian if extra is None else np.hstack((model.jacobian, extra))
    return chebyshev_radius(columns, readings, model.bound)[0]


@pytest.mark.parametrize("place", [QUADRATIC, CUBIC], ids=lambda place: place.title)
def test_at_the_first_size_no_noise_hides_an_effect_and_at_half_of_it_some_does(nominal: KnownBench, place):
    model = nominal.model
    size = nominal.sure_sizes(place, []).detected
    d = change_columns(nominal, place)[:, 0]
    for _ in range(40):
        noise = SIGMA * RNG.choice([-1.0, 1.0], size=len(d))
        assert radius(model, 1.01 * size * d + noise) > 1.0
    # Without noise half the size is still at the edge; the worst noise hides as much as the model may.
    assert radius(model, 0.5 * size * d) == pytest.approx(1.0, abs=1e-6)
    step = chebyshev_radius(model.jacobian, d, model.bound)[1]
    worst = -SIGMA * (d - model.jacobian @ step) / np.abs(d - model.jacobian @ step).max()
    assert radius(model, 0.99 * size * d + worst) <= 1.0


def test_at_the_second_size_no_parameters_of_a_rival_mend_the_record(nominal: KnownBench):
    model = nominal.model
    rivals = [ODD, ENCODER, QUADRATIC, WOBBLE, SAG]
    sizes = nominal.sure_sizes(CUBIC, rivals)
    assert sizes.rival == ODD.title
    d = change_columns(nominal, CUBIC)[:, 0]
    columns = [change_columns(nominal, rival) for rival in rivals]
    for _ in range(20):
        noise = SIGMA * RNG.choice([-1.0, 1.0], size=len(d))
        assert all(radius(model, 1.01 * sizes.excluded * d + noise, extra) > 1.0 for extra in columns)
    step = chebyshev_radius(np.hstack((model.jacobian, columns[0])), d, model.bound)[1]
    remaining = d - np.hstack((model.jacobian, columns[0])) @ step
    assert radius(model, 0.99 * sizes.excluded * d - SIGMA * remaining / np.abs(remaining).max(), columns[0]) <= 1.0


@pytest.mark.acceptance
def test_cubic_and_odd_quadratic_are_seen_long_before_they_are_told_apart(nominal: KnownBench):
    """Compare with the published facts: 6.6 times for the cubic term at 100 positions; most effects separate at
    once."""
    sizes = nominal.sure_sizes(CUBIC, [ODD, ENCODER, SAG])
    assert 4.0 < sizes.excluded / sizes.detected < 40.0
    sizes = nominal.sure_sizes(ENCODER, [ODD, CUBIC, QUADRATIC])
    assert sizes.excluded / sizes.detected < 2.0


def test_the_last_rival_found_with_pruning_is_that_of_a_search_through_all(nominal: KnownBench):
    model = nominal.model
    rivals = [place for name in ("cross-product", "cross-square", "cubic", "sag") for place in CATALOGUE[name].places]
    sizes = nominal.sure_sizes(QUADRATIC, rivals)
    d = change_columns(nominal, QUADRATIC)[:, 0]
    with_rivals = [radius(model, d, change_columns(nominal, rival)) for rival in rivals]
    with_outliers = [radius(model, d, np.eye(len(d), 1, -k)) for k in range(len(d))]
    least = min(with_rivals + with_outliers)
    assert sizes.excluded == pytest.approx(2.0 / least, rel=1.1e-3)
    assert sizes.detected == pytest.approx(2.0 / radius(model, d), rel=1e-9)


@pytest.mark.acceptance
def test_over_all_phases_the_worst_is_taken(nominal: KnownBench):
    single = [nominal.sure_sizes(ENCODER, [SAG, ODD], direction=d) for d in spread_directions(2, DIRECTIONS)]
    worst = nominal.sure_sizes(ENCODER, [SAG, ODD])
    assert worst.detected == max(s.detected for s in single)
    assert worst.excluded == max(s.excluded for s in single)
    phases = RNG.uniform(0.0, math.pi, 6)
    some = [nominal.sure_sizes(ENCODER, [SAG, ODD], direction=np.array([math.cos(t), math.sin(t)])) for t in phases]
    assert max(s.detected for s in some) < 1.02 * worst.detected


def test_a_bound_that_an_open_sign_widens_makes_the_sizes_larger(nominal: KnownBench):
    wide = nominal.model.bound.copy()
    wide[1::3] *= 3.0
    place = QUADRATIC
    assert replace(nominal, model=replace(nominal.model, bound=wide)).sure_sizes(place, []).detected == pytest.approx(
        3.0 * nominal.sure_sizes(place, []).detected, rel=1e-3
    )


def test_what_the_model_holds_already_has_no_size_and_an_outlier_is_not_its_own_rival(nominal: KnownBench):
    sizes = nominal.sure_sizes(EffectPlace("scale-asymmetry", "accelerometer-1"), [CUBIC])
    assert (sizes.detected, sizes.excluded) == (math.inf, math.inf)
    sizes = nominal.sure_sizes(place_of(5, 2), [])
    assert SIGMA < sizes.detected <= sizes.excluded < math.inf
    assert sizes.rival != place_of(5, 2).title


def test_beside_another_effect_sizes_are_larger(nominal: KnownBench):
    alone = nominal.sure_sizes(CUBIC, [SAG])
    companion = nominal.sure_sizes(CUBIC, [SAG], beside=[ODD])
    assert companion.detected > 3.0 * alone.detected


def test_levels_are_scanned_with_the_effects_own_kernel(nominal: KnownBench):
    rows = nominal.rows
    place = EffectPlace("saturation", "accelerometer-3")
    top = float(np.abs(rows.prediction[:, 2]).max())
    clipped = level_change(place, 0.9, rows)
    assert np.array_equal(clipped[:, :2], np.zeros((len(clipped), 2)))
    assert np.abs(rows.prediction + clipped)[:, 2].max() == pytest.approx(0.9, abs=1e-12)
    margins = nominal.level_margins(place, [0.9, top * (1.0 + 1e-6)], [CUBIC])
    assert margins[0].detected < 1.0
    assert margins[1].detected == math.inf


def test_a_rival_whose_coefficients_have_one_sign_is_excluded_where_a_free_one_is_not(nominal: KnownBench):
    """The change is a difference of the rival's columns; another solver gives the least distance, in each sign."""
    model = nominal.model
    hours = np.linspace(0.0, 1.0, len(model.bound) // 3)
    columns, change = np.zeros((len(hours), 3, 2)), np.zeros((len(hours), 3))
    columns[:, 1] = np.stack((np.sin(9.0 * hours), np.sin(9.0 * hours) + np.exp(-3.0 * hours)), axis=1)
    change[:, 1] = columns[:, 1, 1] - columns[:, 1, 0]
    place = EffectPlace("thermal-lag", "accelerometer-2")
    free = Cell(place, (0.0, 1.0), columns, np.ones(2))
    assert nominal.sizes_of_way(change, [], [(place, free)]).excluded == math.inf
    nearest = nominal.sizes_of_way(change, [], [(place, replace(free, missed=np.zeros_like(columns)))])
    matrix = np.hstack((model.jacobian, columns.reshape(-1, 2))) / model.bound[:, None]
    scale = np.abs(matrix).max(axis=0)
    target, count = change.ravel() / model.bound / 1e5, matrix.shape[1] - 2
    ones = np.ones((len(target), 1))
    pair, ends = np.vstack((np.hstack((matrix / scale, -ones)), np.hstack((-matrix / scale, -ones)))), []
    for signed in ((0.0, None), (None, 0.0)):
        bounds = [(None, None)] * count + [signed] * 2 + [(0.0, None)]
        cost = np.append(np.zeros(count + 2), 1.0)
        ends.append(linprog(cost, A_ub=pair, b_ub=np.append(target, -target), bounds=bounds).fun)
    assert nearest.excluded == pytest.approx(2.0 / (1e5 * min(ends)), rel=2e-3)
    assert nearest.rival == place.title
    assert nearest.detected < nearest.excluded
