"""The catalogue: names, FMU variables, and signatures against the kernels inside the components."""

import math

import numpy as np
import pytest

from trihedron.calibration.linearisation import linearise
from trihedron.calibration.parametrisation import Positions, parametrise
from trihedron.calibration.result import component_parameters
from trihedron.diagnosis.circumstances import standing_still
from trihedron.diagnosis.extended_fit import rows_at, signature_columns
from trihedron.fmus import components
from trihedron.fmus.composition import extend
from trihedron.fmus.in_process import instantiate, references
from trihedron.models.bench import TARGETS
from trihedron.models.effects import CATALOGUE, EffectPlace, parameter_name, place_from_mapping
from trihedron.models.effects.outlier import place_of

G = 9.80665
RNG = np.random.default_rng(3)
ALPHA, BETA = RNG.uniform(-3.0, 3.0, 12), RNG.uniform(-3.0, 3.0, 12)
HOURS = np.linspace(0.0, 2.0, 12)
TRUTH = RNG.uniform(-0.005, 0.005, len(TARGETS))
PLACES = [p for effect in CATALOGUE.values() if effect.kernel for p in effect.places]


def configured(name: str, place: EffectPlace, parameters: dict, values: tuple[float, ...]):
    """An instance of a component with the effect at its place, where it belongs there."""
    mine = CATALOGUE[place.effect].component == name
    component = extend(components()[name], [place] if mine else [])
    at = references(component)
    model = instantiate(component)
    for variable, value in parameters.items():
        for i, element in enumerate(np.ravel(value)):
            model.set(at[f"{variable}[{i + 1}]" if isinstance(value, list) else variable], float(element))
    if mine:
        for parameter, value in zip(CATALOGUE[place.effect].parameters, values, strict=True):
            model.set(at[parameter_name(place, parameter.name)], value)
    return model, at


def readings(place: EffectPlace, coefficients: np.ndarray) -> np.ndarray:
    """Readings (12, 3) [g] of table and block, with the effect composed in, at given encoder readings and hours.

    The components themselves read: the command is sought at which the encoders show the angles that are asked for.
    """
    values = CATALOGUE[place.effect].from_coefficients(coefficients)
    parameters = component_parameters(dict(zip(TARGETS, TRUTH, strict=True)), np.eye(3), G)
    table_parameters = {**parameters["TurntableMotion"], "encoder_fluctuation_bound": 0.0}
    shown = np.zeros((len(ALPHA), 3))
    for row, wanted in enumerate(zip(ALPHA, BETA, strict=True)):
        command = list(wanted)
        for _ in range(4):
            table, at = configured("TurntableMotion", place, {**table_parameters, "initial_angle": [*command]}, values)
            assert table.initialise(0.0) == 0
            for i in range(2):
                command[i] += wanted[i] - table.get(at[f"angle_reading[{i + 1}]"])
        force = [table.get(at[f"specific_force[{i + 1}]"]) for i in range(3)]
        block, at = configured("AccelerometerBlock", place, parameters["AccelerometerBlock"], values)
        assert block.initialise(0.0) == 0
        for i in range(3):
            block.set(at[f"specific_force[{i + 1}]"], force[i])
        if HOURS[row] > 0.0:
            assert block.do_step(0.0, 3600.0 * HOURS[row]) == 0
        shown[row] = [block.get(at[f"reading[{i + 1}]"]) / G for i in range(3)]
    return shown


def signatures(place: EffectPlace) -> np.ndarray:
    p = parametrise({"identity": np.eye(3)})
    at = Positions(ALPHA, BETA, np.zeros(len(ALPHA), dtype=int))
    here = linearise(p, at, np.zeros((len(ALPHA), 3)), true_point(p), np.full(3 * len(ALPHA), 1e-5))
    return signature_columns([place], rows_at(here, here.point, at, standing_still(len(HOURS), HOURS)))


def true_point(p) -> np.ndarray:
    """The true targets in the order of the parametrisation."""
    values = dict(zip(TARGETS, TRUTH, strict=True))
    return np.array([values[symbol] for symbol in p.symbols])


@pytest.mark.parametrize("place", PLACES, ids=lambda p: p.title)
def test_signatures_are_the_derivatives_of_what_the_components_read(place):
    """Written by hand, they share no code with the kernels; central differences at two sizes, extrapolated."""
    columns = signatures(place)
    for k in range(columns.shape[1]):
        direction = np.eye(columns.shape[1])[k]
        slopes = []
        for size in (1e-3, 5e-4):
            apart = readings(place, size * direction) - readings(place, -size * direction)
            slopes.append(apart / (2.0 * size))
        derivative = (4.0 * slopes[1] - slopes[0]) / 3.0
        assert np.abs(derivative.ravel() - columns[:, k]).max() < 2e-9


def test_an_outlier_marks_one_reading():
    columns = signatures(place_of(4, 2))
    assert columns.sum() == 1.0
    assert columns[3 * 3 + 1, 0] == 1.0


@pytest.mark.parametrize("place", PLACES, ids=lambda p: p.title)
def test_parameters_come_back_from_coefficients_and_have_one_name(place):
    effect = CATALOGUE[place.effect]
    coefficients = np.array([3e-4, -4e-4])[: len(effect.parameters)]
    values = effect.from_coefficients(coefficients)
    if len(values) == 2:
        amplitude, phase = values
        assert amplitude == pytest.approx(5e-4)
        assert [amplitude * math.cos(phase), amplitude * math.sin(phase)] == pytest.approx(coefficients.tolist())
    else:
        assert values == (3e-4,)
    entry: dict = {"effect": place.effect, "where": place.where}
    if place.order is not None:
        entry["order"] = place.order
    named = dict(zip([p.name for p in effect.parameters], values, strict=True))
    assert place_from_mapping({**entry, **named}) == (place, named)
    variables = extend(components()[effect.component or ""], [place]).variables
    assert [v.name for v in variables[-len(values) :]] == [parameter_name(place, p.name) for p in effect.parameters]
    assert effect.sentence(place, named)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"effect": "quadatic", "where": "accelerometer-1"}, "not one that extends a component"),
        ({"effect": "outlier", "where": "position-1"}, "not one that extends a component"),
        ({"effect": "quadratic", "where": "accelerometer-4", "coefficient": 1e-4}, "no place"),
        ({"effect": "encoder-harmonic", "where": "outer-axis", "order": 9, "amplitude": 1e-4, "phase": 0.0}, "order 9"),
        ({"effect": "quadratic", "where": "accelerometer-1"}, "needs a finite number"),
        ({"effect": "quadratic", "where": "accelerometer-1", "coefficient": math.nan}, "needs a finite number"),
        ({"effect": "quadratic", "where": "accelerometer-1", "coefficient": True}, "needs a finite number"),
        ({"effect": "quadratic", "where": "accelerometer-1", "coefficient": 1e-4, "rate": 1.0}, "no parameter 'rate'"),
    ],
)
def test_wrong_entries_are_refused_in_one_line(entry, said):
    with pytest.raises(ValueError, match=said) as refusal:
        place_from_mapping(entry)
    assert "\n" not in str(refusal.value)
