"""A block that turns on the table by an input, time or temperature is named as a turn, not as two accelerometers."""

import numpy as np
import pytest

from diagnoses import assert_named, diagnosed
from field_files import field_file
from generator.positions import Session, drawn_record, errors
from trihedron import read_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.records import PositionRecord

DRIFT, WARMTH = EffectPlace("mounting-drift", "mounting"), EffectPlace("mounting-temperature", "mounting")
SAG = EffectPlace("sag", "inner-axis")


def flexure(axis: int, by_input: int) -> EffectPlace:
    return EffectPlace("fixture-flexure", "mounting", axes=(axis, by_input))


def session_record(seed: int, place: EffectPlace, sizes: tuple[float, ...], count: int) -> PositionRecord:
    """Return a record of a drawn session, an hour long or longer."""
    rng = np.random.default_rng([seed, count])
    return Session.drawn(rng, count).record([(place, sizes)], errors(rng, count)[0])


@pytest.mark.acceptance
def test_the_bending_fixture_of_the_field_is_one_turn(tmp_path):
    record = read_record(field_file("o23_flexure.csv", tmp_path))
    result = diagnosed(record)
    assert result.verdict == "explained"
    assert [cause.place for cause in result.causes] == [flexure(2, 1)]
    assert (result.proven.place, result.proven.quantity, result.proven.factor) == ("mounting", "n1", "turn 2")


TURNED = {
    "about axis 1 by input 2": (flexure(1, 2), (7e-5,), 48),
    "about axis 2 by input 3": (flexure(2, 3), (-9e-5,), 24),
    "about its own input": (flexure(1, 1), (1.2e-4,), 100),
    "by time": (DRIFT, (2e-4, 0.0, 0.0), 36),
    "by temperature": (WARMTH, (0.0, 3e-5, 0.0), 36),
}


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("name", "seed"),
    [(name, 1) for name in TURNED] + [pytest.param(name, 2, marks=pytest.mark.acceptance) for name in TURNED],
)
def test_a_turn_of_the_block_is_named_alone(name, seed):
    place, sizes, count = TURNED[name]
    result = diagnosed(session_record(seed, place, sizes, count))
    assert_named(result, {place: sizes})


@pytest.mark.acceptance
@pytest.mark.parametrize("by_input", [1, pytest.param(2, marks=pytest.mark.acceptance)])
def test_a_turn_about_the_inner_axis_is_told_with_what_the_table_could_do(by_input):
    (cause,) = diagnosed(drawn_record(3, [(flexure(3, by_input), (1e-4,))], 36)).causes
    assert cause.place == SAG
    assert cause.alike == (flexure(3, by_input),)


@pytest.mark.acceptance
def test_a_sag_with_another_phase_is_no_bending_fixture():
    (cause,) = diagnosed(drawn_record(3, [(SAG, (1.5e-4, 0.7))], 36)).causes
    assert (cause.place, cause.alike) == (SAG, ())
