"""Tables of a function of one quantity: signature against the components, exact kernels, refused laws."""

import inspect

import numpy as np
import pytest
from tests.effect_readings import readings, true_bench

from trihedron.fmus.catalogue import COMPONENTS
from trihedron.fmus.component import extend
from trihedron.models.effects import EffectPlace, MotionRows, parameter_name, place_from_mapping
from trihedron.models.effects.lookup import Table
from trihedron.models.restricted import GYRO_CONTEXT_SIZE, PREVIOUS_RATE, STEP_LENGTH
from trihedron.tools.evidence import signature_columns

LAWS = (
    ("accelerometer-1", "n1 at -1.0 -0.3 0.2 1.0"),
    ("accelerometer-2", "n3 times hours at 0.0 0.4 1.0"),
    ("accelerometer-3", "hours jumps at 0.03"),
    ("accelerometer-1", "alpha around 0.0 2.0 4.0"),
    ("accelerometer-2", "n1 times beta around 0.0 2.0 4.0"),
    ("accelerometer-1", "temperature times n1 at -1.0 0.1 1.0"),
    ("accelerometer-3", "n1*n3 at -0.6 -0.1 0.7"),
    ("accelerometer-2", "n2 at (-1.0) -0.2 (0.3) 1.0"),
    ("outer-axis", "alpha around (0.1) 2.0 4.0"),
    ("outer-axis", "alpha around 0.1 2.0 4.0"),
    ("inner-axis", "hours at 0.0 0.5"),
    ("inner-axis", "tilt times beta around -1.0 1.0 3.0"),
    ("outer-axis", "tilt times alpha around 0.0 1.0 3.0 5.0"),
    ("inner-axis", "sin alpha times beta around 0.0 1.5 3.0 5.0"),
    ("outer-axis", "cos beta times hours at 0.0 0.5"),
    ("inner-axis", "outer tilt times beta around 0.0 1.5 4.0"),
    ("accelerometer-1", "sin beta times n2 at -1.0 0.1 1.0"),
    ("accelerometer-3", "cos alpha times temperature at 0.0 20.0 40.0"),
    ("outer-axis", "temperature at 0.0 20.0 40.0"),
    ("base", "tilt times hours at 0.0 0.5"),
)


@pytest.mark.parametrize(("where", "law"), LAWS)
def test_its_signature_is_the_derivative_of_what_the_components_read(where, law):
    """A reading near a knot may be on its other side when an encoder errs: it is left out."""
    place = EffectPlace("lookup", where, law=law)
    rows = true_bench()[1]
    columns = signature_columns([place], rows)
    table, size = Table.of(law), 1e-4
    values = getattr(rows, table.quantity, None) if table.quantity[0] != "n" else None
    near = np.zeros(len(rows.hours), dtype=bool)
    if values is not None and where in ("outer-axis", "inner-axis"):
        gaps = np.abs((values[:, None] - np.array(table.knots) + np.pi) % (2 * np.pi) - np.pi)
        near = gaps.min(axis=1) < 2 * size
    distant = np.repeat(~near, 3)
    assert distant.sum() > 2 * near.sum()
    for k in range(columns.shape[1]):
        unit = size * np.eye(columns.shape[1])[k]
        slope = (readings({place: tuple(unit)}) - readings({place: tuple(-unit)})).ravel() / (2.0 * size)
        assert np.abs(slope - columns[:, k])[distant].max() < 2e-7
    assert np.abs(columns).max() > 0.0


@pytest.mark.parametrize("law", [law for _, law in LAWS])
def test_a_law_is_read_as_it_is_written(law):
    assert Table.of(law).law == law


def test_a_table_is_straight_between_its_knots_and_goes_round():
    table = Table.of("alpha around 0.0 2.0 4.0")
    angle = np.array([0.0, 1.0, 4.0, 2 * np.pi, -0.1, 2 * np.pi + 1.0])
    columns = table.columns(angle)
    assert columns.sum(axis=1) == pytest.approx(np.ones(6))
    assert columns[1] == pytest.approx([0.5, 0.5, 0.0])
    assert columns[3] == pytest.approx([1.0, 0.0, 0.0])
    assert columns[5] == pytest.approx(columns[1])
    assert columns[4] == pytest.approx([1 - 0.1 / (2 * np.pi - 4), 0.0, 0.1 / (2 * np.pi - 4)])
    assert Table.of(table.law) == table


def test_at_a_knot_in_parentheses_it_is_zero():
    table, free = Table.of("n1 at (-1.0) 0.0 (1.0) 2.0"), Table.of("n1 at -1.0 0.0 1.0 2.0")
    assert Table.of(table.law) == table
    values = np.linspace(-1.5, 2.5, 9)
    assert table.columns(values).tolist() == free.columns(values)[:, [1, 3]].tolist()
    place = EffectPlace("lookup", "accelerometer-1", law=table.law)
    assert [parameter.name for parameter in place.definition.parameters] == ["value_2", "value_4"]


def test_a_function_of_a_gyros_rate_has_its_rows_and_its_kernel():
    place = EffectPlace("lookup", "gyro-block", axes=(2,), law="w3 at -1.0 0.0 1.0")
    rate = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, -1.0]])
    rows = MotionRows(rate, rate, np.zeros((2, 3)), np.zeros(2), np.ones(2))
    effect = place.definition
    assert effect.signature(place, rows)[:, 1].tolist() == [[0.0, 0.5, 0.5], [1.0, 0.0, 0.0]]
    assert effect.kernel is not None
    added = [0.0, 0.0, 0.0]
    effect.kernel([0.0] * 38, rate[0].tolist(), 1.0, 2.0, 4.0, added)
    assert added == [0.0, 3.0, 0.0]
    assert "w3 at" in inspect.getsource(effect.kernel)


def test_a_function_of_an_angular_acceleration_has_its_rows_and_its_kernel():
    """The previous step is 0.5 s long, and its rate is in the context."""
    law, before, rate = "w1 times dw3 at -2.0 0.0 2.0", np.array([[0.0, 0.0, 0.2]]), np.array([[3.0, 0.0, 0.7]])
    place = EffectPlace("lookup", "gyro-block", axes=(2,), law=law)
    rows = MotionRows(rate, before, np.zeros((1, 3)), np.zeros(1), np.array([0.5]))
    effect = place.definition
    assert effect.signature(place, rows)[0, 1] == pytest.approx([0.0, 1.5, 1.5])
    context, added = [0.0] * GYRO_CONTEXT_SIZE, [0.0, 0.0, 0.0]
    context[STEP_LENGTH], context[PREVIOUS_RATE + 2] = 0.5, 0.2
    assert effect.kernel is not None
    effect.kernel(context, rate[0].tolist(), 1.0, 2.0, 4.0, added)
    assert added == pytest.approx([0.0, 9.0, 0.0])
    by = EffectPlace("lookup", "gyro-block", axes=(1,), law="dw1 times hours at 0.0 1.0").definition
    assert [parameter.unit for parameter in by.parameters] == ["s", "s"]


def test_its_entry_names_it_again_and_its_variables_are_its_own():
    places = [EffectPlace("lookup", "accelerometer-1", law=law) for law in ("n1 at -1.0 1.0", "n1 at -1.0 0.0 1.0")]
    entry = places[1].entry | {f"value_{k}": float(k) for k in (1, 2, 3)}
    assert place_from_mapping(entry) == (places[1], {"value_1": 1.0, "value_2": 2.0, "value_3": 3.0})
    block = extend(COMPONENTS["AccelerometerBlock"], places)
    names = [variable.name for variable in block.variables]
    assert len(names) == len(set(names))
    assert parameter_name(places[0], "value_1") in names


@pytest.mark.parametrize(
    ("where", "law", "says"),
    [
        ("accelerometer-1", "n1 at 1.0", "knots"),
        ("accelerometer-1", "n1 at 1.0 0.0", "knots growing"),
        ("accelerometer-1", "n4 at 0.0 1.0", "must be"),
        ("accelerometer-1", "w1 at 0.0 1.0", "has no w1"),
        ("accelerometer-1", "n1 around 0.0 1.0", "must be"),
        ("accelerometer-1", "n1 at 0.0 nan", "must be"),
        ("accelerometer-1", "n1 at (0.0) (1.0)", "must be"),
        ("accelerometer-1", "n1 at (0.0 1.0", "must be"),
        ("accelerometer-1", "", "must be"),
        ("accelerometer-1", "tilt times n1 at 0.0 1.0", "only an axis"),
        ("outer-axis", "n1 times alpha at 0.0 1.0", "has no n1"),
        ("outer-axis", "n1 at 0.0 1.0", "has no n1"),
        ("outer-axis", "outer tilt times alpha at 0.0 1.0", "only the inner-axis"),
        ("base", "hours at 0.0 1.0", "only a tilt"),
        ("inner-axis", "tan alpha times beta at 0.0 1.0", "must be"),
        ("inner-axis", "sin hours times beta at 0.0 1.0", "must be"),
        ("inner-axis", "times beta at 0.0 1.0", "must be"),
        ("gyro-block", "w1 at 0.0 1.0", "its one axis"),
        ("nowhere", "n1 at 0.0 1.0", "places"),
    ],
)
def test_what_is_no_law_is_refused(where, law, says):
    with pytest.raises(ValueError, match=says):
        place_from_mapping({"effect": "lookup", "where": where, "law": law, "value_1": 0.0, "value_2": 0.0})
