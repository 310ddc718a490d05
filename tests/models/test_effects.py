"""The catalogue: names, FMU variables, and signatures against the kernels inside the components."""

import dataclasses
import math

import numpy as np
import pytest

from effect_readings import ALPHA, BETA, ROWS, readings, true_bench
from trihedron.fmus import components
from trihedron.fmus.component import extend
from trihedron.fmus.units import UNITS
from trihedron.models.bench import TARGETS, target_reading
from trihedron.models.effects import (
    CATALOGUE,
    POSITION_EFFECTS,
    EffectPlace,
    MotionRows,
    Rows,
    parameter_name,
    place_from_mapping,
)
from trihedron.models.effects.columns import small_turns
from trihedron.models.effects.last_stage import place_of
from trihedron.tools.calibration import Positions, linearise, parametrise
from trihedron.tools.evidence import Circumstances, Visits, signature_columns, untold_readings
from trihedron.tools.evidence.bench_visits import left_open
from trihedron.tools.evidence.fit import linear_intervals

CONTRACT = {
    "scale-asymmetry": ["coefficient"],
    "bias-asymmetry": ["coefficient"],
    "quadratic": ["coefficient"],
    "odd-quadratic": ["coefficient"],
    "cubic": ["coefficient"],
    "cross-product": ["coefficient"],
    "cross-square": ["coefficient"],
    "dead-zone": ["width"],
    "saturation": ["level"],
    "quantisation": ["step"],
    "exchanged-readings": ["start"],
    "hysteresis": ["width"],
    "bias-drift": ["rate"],
    "bias-step": ["size", "start"],
    "scale-step": ["size", "start"],
    "mounting-slip": ["theta_1", "theta_2", "theta_3", "start"],
    "warm-up": ["size", "time_constant"],
    "thermal-lag": ["coefficient", "settling", "time_constant"],
    "scale-drift": ["rate"],
    "temperature-bias": ["coefficient"],
    "temperature-scale": ["coefficient"],
    "temperature-bias-quadratic": ["linear", "square"],
    "temperature-bias-cubic": ["linear", "square", "cube"],
    "temperature-scale-quadratic": ["linear", "square"],
    "temperature-scale-cubic": ["linear", "square", "cube"],
    "encoder-harmonic": ["amplitude", "phase"],
    "axis-wobble": ["amplitude", "phase"],
    "sag": ["amplitude", "phase"],
    "backlash": ["width"],
    "base-drift": ["kappa_rate", "alpha_star_rate"],
    "fixture-flexure": ["coefficient"],
    "mounting-drift": ["rate_1", "rate_2", "rate_3"],
    "mounting-temperature": ["slope_1", "slope_2", "slope_3"],
    "outlier": ["size"],
}
ON_AXES = {"encoder-harmonic", "axis-wobble", "sag", "backlash"}
PLACES = [p for effect in POSITION_EFFECTS.values() if effect.kernel for p in effect.places]
LINEAR = [p for p in PLACES if CATALOGUE[p.effect].linear]


def test_the_catalogue_is_the_contracts():
    """Every static effect of the table in the contract, with its parameters, and no other."""
    assert {name: [p.name for p in effect.parameters] for name, effect in POSITION_EFFECTS.items()} == CONTRACT
    accelerometers = {f"accelerometer-{p}" for p in (1, 2, 3)}
    for name, effect in POSITION_EFFECTS.items():
        expected = {"outer-axis", "inner-axis"} if name in ON_AXES else accelerometers
        expected = {"base": {"base"}, "moun": {"mounting"}, "fixt": {"mounting"}, "outl": set()}.get(name[:4], expected)
        assert {p.where for p in effect.places} == expected
    assert sorted(p.order or 0 for p in CATALOGUE["encoder-harmonic"].places) == sorted([1, 2, 3, 4, 5, 6] * 2)
    assert sorted(p.order or 0 for p in CATALOGUE["axis-wobble"].places) == [1, 1, 2, 2, 3, 3]
    products = {(p.where, p.axes) for p in CATALOGUE["cross-product"].places}
    assert products == {(where, axes) for where in accelerometers for axes in ((1, 2), (1, 3), (2, 3))}
    squares = {(p.where, p.axes) for p in CATALOGUE["cross-square"].places}
    assert squares == {(f"accelerometer-{p}", (j,)) for p in (1, 2, 3) for j in (1, 2, 3) if j != p}
    inner = [EffectPlace("axis-wobble", "inner-axis", order) for order in (1, 2, 3)]
    names = [[p.name for p in CATALOGUE["axis-wobble"].at(place).parameters] for place in inner]
    four = ["epsilon_amplitude", "epsilon_phase", "tilt_amplitude", "tilt_phase"]
    assert names == [four[:2], four, four]


@pytest.mark.first(30)
@pytest.mark.parametrize("place", LINEAR, ids=lambda p: p.title)
def test_signatures_are_the_derivatives_of_what_the_components_read(place):
    """Use central differences at two sizes, extrapolated."""
    effect = CATALOGUE[place.effect].at(place)
    rows = true_bench()[1]
    columns = signature_columns([place], rows)
    assert columns.shape[1] == len(effect.parameters)
    determined = ~untold_readings([place], rows)
    for k in range(columns.shape[1]):
        slopes = []
        for size in (1e-3, 5e-4):
            ends = [effect.from_coefficients(sign * size * np.eye(columns.shape[1])[k]) for sign in (1.0, -1.0)]
            up, down = (readings({place: values}) for values in ends)
            slopes.append((up - down) / (2.0 * size))
        derivative = (4.0 * slopes[1] - slopes[0]) / 3.0
        assert np.abs(derivative.ravel() - columns[:, k])[determined].max() < 2e-9
        # Where the record does not show the sense, the effect is within the growth of the bound for its size.
        assert np.all(np.abs(derivative.ravel()[~determined]) <= left_open(place, rows)[~determined] * (1.0 + 2e-9))
        assert np.abs(columns[:, k]).max() > 0.0


@pytest.mark.parametrize("place", [p for p in LINEAR if CATALOGUE[p.effect].turns_table], ids=lambda p: p.title)
def test_small_turns_are_exact_for_large_effects(place):
    """The exact model with κ, ε and both angles turned gives the components' readings, at 8e-3 rad too."""
    effect = CATALOGUE[place.effect].at(place)
    model, rows = true_bench()
    coefficients = 8e-3 * np.array([0.6, -0.8, -0.5, 0.7])[: len(effect.parameters)]
    turns = small_turns(effect, place, rows) @ coefficients
    if effect.stage == "encoder_effects":
        # Functions of the true angles, which include the turns.
        for _ in range(40):
            moved = dataclasses.replace(rows, alpha=rows.alpha + turns[:, 1], beta=rows.beta + turns[:, 3])
            turns = small_turns(effect, place, moved) @ coefficients
    targets = np.tile(model.parametrisation.selection[0] @ model.point, (ROWS, 1))
    targets[:, TARGETS.index("X1")] += turns[:, 0]
    targets[:, TARGETS.index("X3")] += turns[:, 2]
    expected = target_reading(targets, ALPHA + turns[:, 1], BETA + turns[:, 3], np.eye(3), further=turns[:, 4:])
    assert readings({place: effect.from_coefficients(coefficients)}) == pytest.approx(expected, abs=2e-14)


def test_what_the_bench_cannot_tell_apart_has_the_same_signature():
    """Wobble of the outer axis of order 1 is in the nominal model. Sag about it is the first harmonic of its encoder.
    The tilt of the inner axis, once a turn, is its lean a quarter of a turn later, except for the part in the model."""
    rng = np.random.default_rng(8)
    p = parametrise({"identity": np.eye(3)})
    at = Positions(rng.uniform(-3.0, 3.0, 60), rng.uniform(-3.0, 3.0, 60), np.zeros(60, dtype=int))
    point = np.zeros(len(p.symbols))
    model = linearise(p, at, np.zeros((60, 3)), point, np.full(180, 1e-5))
    nothing = np.zeros(60)
    rows = Visits(p, at, Circumstances(nothing, np.full(60, 20.0), nothing, nothing, False)).rows(point)
    basis, _ = np.linalg.qr(model.jacobian)

    def beyond_model(columns: np.ndarray) -> np.ndarray:
        return columns - basis @ (basis.T @ columns)

    assert np.abs(beyond_model(signature_columns([EffectPlace("axis-wobble", "outer-axis", 1)], rows))).max() < 1e-13
    sag = signature_columns([EffectPlace("sag", "outer-axis")], rows)
    assert sag == pytest.approx(-signature_columns([EffectPlace("encoder-harmonic", "outer-axis", 1)], rows), abs=1e-15)
    lean = beyond_model(signature_columns([EffectPlace("axis-wobble", "inner-axis", 1)], rows))
    tilts = np.zeros((60, 7, 2))
    tilts[:, 1] = np.stack((np.cos(at.beta), -np.sin(at.beta)), axis=1)
    tilt = beyond_model((rows.by_turns @ tilts).reshape(180, 2))
    assert np.linalg.matrix_rank(lean, tol=1e-9) == 2
    assert np.linalg.matrix_rank(np.hstack((lean, tilt)), tol=1e-9) == 2


def test_an_outlier_marks_one_reading():
    columns = signature_columns([place_of(4, 2)], true_bench()[1])
    assert columns.sum() == 1.0
    assert columns[3 * 3 + 1, 0] == 1.0


def test_effects_of_temperature_need_the_temperature():
    values = np.ones((ROWS, 3))
    rows = Rows(np.zeros(ROWS), np.zeros(ROWS), np.zeros(ROWS), values, values, values)
    for name in ("temperature-bias", "temperature-scale"):
        effect = CATALOGUE[name]
        assert effect.needs == ("temperature",)
        with pytest.raises(ValueError, match="need the temperature"):
            effect.signature(effect.places[0], rows)


@pytest.mark.parametrize(
    "place", [p for effect in CATALOGUE.values() if effect.kernel for p in effect.places], ids=lambda p: p.title
)
def test_parameters_come_back_from_coefficients_and_have_one_name(place):
    effect = CATALOGUE[place.effect].at(place)
    names = [parameter.name for parameter in effect.parameters]
    if effect.variants is None:
        coefficients = np.resize([3e-4, -4e-4, -5e-4, 2e-4], len(names))
        values = effect.from_coefficients(coefficients)
        back = []
        for k, name in enumerate(names):
            if name.endswith("amplitude"):
                amplitude, phase = values[k : k + 2]
                back += [amplitude * math.cos(phase), amplitude * math.sin(phase)]
                assert amplitude >= 0.0
            elif not name.endswith("phase"):
                back.append(values[k])
        assert back == pytest.approx(coefficients.tolist())
    else:
        values = tuple(p.largest for p in effect.parameters)
        with pytest.raises(TypeError, match="not linear"):
            effect.from_coefficients(np.zeros(1))
    if effect.variants is not None:
        with pytest.raises(TypeError, match="not linear"):
            effect.signature(place, true_bench()[1])
    by_name = dict(zip(names, values, strict=True))
    entry: dict = {"effect": place.effect, "where": place.where}
    if place.order is not None:
        entry["order"] = place.order
    if place.axes:
        # The order of factors is free; the order of a turn's axis and its input is not.
        entry["axes"] = list(place.axes if place.effect == "fixture-flexure" else place.axes[::-1])
    assert place_from_mapping({**entry, **by_name}) == (place, by_name)
    variables = extend(components()[effect.component or ""], [place]).variables
    assert [v.name for v in variables[-len(values) :]] == [parameter_name(place, name) for name in names]
    for parameter in effect.parameters:
        assert parameter.unit in UNITS
        assert parameter.possible(parameter.largest)
        assert not parameter.possible(1.01 * parameter.largest)
    assert effect.sentence(place, by_name)


def test_sizes_are_possible_or_not():
    width, level = CATALOGUE["hysteresis"].parameters[0], CATALOGUE["saturation"].parameters[0]
    coefficient = CATALOGUE["quadratic"].parameters[0]
    assert [width.possible(value) for value in (width.largest, 0.0, -1e-4, 1.001 * width.largest)] == [1, 1, 0, 0]
    assert [level.possible(value) for value in (0.4, 0.95)] == [0, 1]
    assert coefficient.possible(-coefficient.largest)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"effect": "quadatic", "where": "accelerometer-1"}, "not one that extends a component"),
        ({"effect": "outlier", "where": "position-1"}, "not one that extends a component"),
        ({"effect": "quadratic", "where": "accelerometer-4", "coefficient": 1e-4}, "no place"),
        ({"effect": "encoder-harmonic", "where": "outer-axis", "order": 9, "amplitude": 1e-4, "phase": 0.0}, "order 9"),
        ({"effect": "quadratic", "where": "accelerometer-1"}, "needs a finite number"),
        ({"effect": "quadratic", "where": "accelerometer-1", "coefficient": math.nan}, "needs a finite number"),
        ({"effect": "quadratic", "where": "accelerometer-1", "coefficient": True}, "needs a finite number"),
        ({"effect": "quadratic", "where": "accelerometer-1", "coefficient": 1e-4, "rate": 1.0}, "no parameter 'rate'"),
        ({"effect": "quadratic", "where": "accelerometer-1", "axes": [1], "coefficient": 1e-4}, r"axes \[1\]"),
        (
            {"effect": "cross-product", "where": "accelerometer-1", "axes": [1, 1], "coefficient": 1e-4},
            r"axes \[1, 1\]",
        ),
        ({"effect": "cross-product", "where": "accelerometer-1", "axes": 3, "coefficient": 1e-4}, "axes 3"),
        ({"effect": "cross-square", "where": "accelerometer-1", "axes": ["2"], "coefficient": 1e-4}, "axes"),
        (
            {"effect": "axis-wobble", "where": "inner-axis", "order": 2, "amplitude": 1e-4, "phase": 0.0},
            "'epsilon_amplitude' needs a finite number",
        ),
    ],
)
def test_wrong_entries_are_refused_in_one_line(entry, message):
    with pytest.raises(ValueError, match=message) as refusal:
        place_from_mapping(entry)
    assert "\n" not in str(refusal.value)


def test_what_a_record_leaves_of_a_width_is_no_negative_width():
    width = CATALOGUE["hysteresis"].places[0]
    assert linear_intervals(width, lambda direction: 2e-4) == ((0.0, 2e-4),)
    bias = CATALOGUE["bias-asymmetry"].places[0]
    assert linear_intervals(bias, lambda direction: 2e-4) == ((-2e-4, 2e-4),)


def test_of_no_rows_effects_in_motion_have_columns_of_no_rows():
    """A record that is too slow for its motion has no row in steady motion."""
    none = np.zeros((0, 3))
    rows = MotionRows(none, none, none, np.zeros(0), np.zeros(0))
    place = EffectPlace("lever-arm", "accelerometer-1")
    assert place.definition.signature(place, rows).shape == (0, 3, 3)
