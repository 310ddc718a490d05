"""Effects of the catalogue in drawn records are named, alone and together, and their intervals hold the true sizes."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from diagnoses import assert_named, diagnosed, holds, sets_of
from generator import SIGMA, G
from generator.positions import drawn_record, hidden_record
from trihedron.models.effects import EffectPlace

PERIOD_S = 10.0
Effects = dict[EffectPlace, tuple[Any, ...]]


def before_row(row: int) -> tuple[float, float]:
    """Return the hours of two rows, counted from 0, between which an event happens."""
    return PERIOD_S * (row - 1) / 3600.0, PERIOD_S * row / 3600.0


def on(effect: str, accelerometer: int, *axes: int) -> EffectPlace:
    return EffectPlace(effect, f"accelerometer-{accelerometer}", axes=axes)


def turned(axis: int, by_input: int) -> EffectPlace:
    return EffectPlace("fixture-flexure", "mounting", axes=(axis, by_input))


def outlier(position: int, accelerometer: int) -> EffectPlace:
    return EffectPlace("outlier", f"position-{position}", axes=(accelerometer,))


@dataclass(frozen=True)
class Hidden:
    """Effects in a record of this number of positions, with further arguments of `drawn_record`."""

    effects: Effects
    count: int = 30
    options: dict[str, bool] = field(default_factory=dict)

    def record(self, seed: int) -> Any:
        """Return the record; an event between two rows is in the middle."""
        effects = []
        for place, sizes in self.effects.items():
            effects.append((place, [np.mean(size) for size in sizes]))
        return drawn_record(seed, effects, self.count, **self.options)

    def diagnosed(self, seed: int) -> Any:
        options = {"baseline": "symmetric"} if self.options.get("symmetric") else {}
        return diagnosed(self.record(seed), **options)


AT_BOUND = {"at_bound": True}
WARM = {"temperature": True}
DRIFT = on("bias-drift", 1)
QUICK = {
    "bias step": Hidden({on("bias-step", 1): (1.5e-4, before_row(14))}, 20),
    "step beside another effect": Hidden({on("bias-step", 1): (2e-4, before_row(14)), on("cubic", 3): (4e-4,)}),
    "slip with its second order": Hidden(
        {EffectPlace("mounting-slip", "mounting"): (1e-3, -2e-3, 1.5e-3, before_row(14))}
    ),
    "fixture that bends": Hidden({turned(2, 1): (8e-5,)}, 40),
    "mounting that creeps": Hidden({EffectPlace("mounting-drift", "mounting"): (1e-3, -2e-3, 5e-4)}),
    "warm-up": Hidden({on("warm-up", 2): (4e-4, 0.02)}, 26),
    "channels exchanged late": Hidden({on("exchanged-readings", 1, 2): (before_row(20),)}),
    # The channels before that alone do not determine a bench.
    "channel reversed early": Hidden({on("exchanged-readings", 3, 3): (before_row(5),)}),
    "rounded readings": Hidden({on("quantisation", 2): (4e-4,)}, 40),
    # The second order of 3e-3 rad is half a σ: first orders alone would refuse the correct name.
    "large sag": Hidden({EffectPlace("sag", "inner-axis"): (3e-3, 0.4)}, 36, AT_BOUND),
    "quadratic": Hidden({on("quadratic", 2): (-1.2e-3,)}, 40),
}
LONG = {
    "lag from another temperature": Hidden({on("thermal-lag", 2): (5e-5, 1e-4, 0.015)}, 30, WARM),
    "fixture that bends far": Hidden({turned(1, 3): (3e-3,)}, 36),
    "fixture that bends about its second axis": Hidden({turned(2, 2): (-2e-4,)}, 24),
    "warm mounting": Hidden({EffectPlace("mounting-temperature", "mounting"): (2e-5, 3e-5, -4e-5)}, 30, WARM),
    "scale step": Hidden({on("scale-step", 2): (4e-4, before_row(12))}),
    "small slip": Hidden({EffectPlace("mounting-slip", "mounting"): (1e-4, -1e-4, 5e-5, before_row(14))}),
    # The effect is so large that the nominal fit hardly shows the time constant: each is judged at a better fit.
    "large warm-up": Hidden({on("warm-up", 2): (5e-2, 0.03)}, 26),
    "lag from a steady temperature": Hidden({on("thermal-lag", 2): (5e-5, 0.0, 0.015)}, 30, WARM),
    "lag from below": Hidden({on("thermal-lag", 2): (5e-5, -1e-4, 0.01)}, 30, WARM),
    "drift": Hidden({DRIFT: (3e-3,)}),
    "asymmetry": Hidden({on("scale-asymmetry", 1): (1.5e-3,)}, 40, {"symmetric": True}),
    "harmonic": Hidden({EffectPlace("encoder-harmonic", "outer-axis", 2): (2.5e-4, 0.7)}, 40),
    "large wobble": Hidden({EffectPlace("axis-wobble", "inner-axis", 2): (2e-3, 1.0, 3e-3, -2.0)}, 36, AT_BOUND),
    "three": Hidden(
        {on("cubic", 1): (6e-4,), EffectPlace("axis-wobble", "outer-axis", 2): (4e-4, 0.7), DRIFT: (4e-3,)},
        36,
        AT_BOUND,
    ),
    "three at one accelerometer": Hidden(
        {on("cubic", 3): (6e-4,), on("cross-product", 3, 1, 2): (6e-4,), on("bias-drift", 3): (8e-3,)}, 40
    ),
    # Five hundred σ of one and ten of the other: the search begins where the large one no longer distorts the fit.
    "large and small": Hidden(
        {EffectPlace("encoder-harmonic", "outer-axis", 3): (5e-3, 0.3), on("cubic", 1): (8e-4,)}, 36, AT_BOUND
    ),
    "two outliers beside an effect": Hidden(
        {on("cubic", 1): (8e-4,), outlier(4, 2): (4e-4,), outlier(21, 3): (-3e-4,)}, 36, AT_BOUND
    ),
    "rounding beside a drift": Hidden({on("quantisation", 2): (2e-4,), DRIFT: (6e-3,)}, 40),
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=pytest.mark.acceptance) for name in LONG)])
def test_what_is_hidden_is_named_with_its_sizes(name):
    case = (QUICK | LONG)[name]
    assert_named(case.diagnosed(1), case.effects)


@pytest.mark.acceptance
@pytest.mark.parametrize("name", QUICK)
def test_what_is_hidden_in_other_records_is_named_or_among_the_candidates(name):
    case = QUICK[name]
    for seed in (2, 3):
        result = case.diagnosed(seed)
        assert set(case.effects) in sets_of(result)
        causes = result.sets[sets_of(result).index(set(case.effects))]
        assert all(holds(cause, case.effects[cause.place]) for cause in causes)
        assert all(cause.acts or cause.effect == "exchanged-readings" for cause in causes)
        assert result.verdict == ("explained" if len(result.sets) == 1 else "ambiguous")


@pytest.mark.acceptance
@pytest.mark.parametrize(("bent", "size"), [("saturation", 0.93), ("dead-zone", 0.045)])
def test_what_is_not_linear_is_among_the_candidates_beside_a_linear_effect(bent, size):
    """An outlier may replace a change of a single reading, a settling bias a drift; nothing else may."""
    effects = {DRIFT: (6e-3,), on(bent, 2): (size,)}
    result = Hidden(effects, 40).diagnosed(2)
    assert set(effects) in sets_of(result)
    (causes,) = (causes for causes in result.sets if {cause.place for cause in causes} == set(effects))
    assert all(holds(cause, effects[cause.place]) for cause in causes)
    names = {place.effect for places in sets_of(result) for place in places}
    assert names <= {"bias-drift", "warm-up", "outlier", bent}


@pytest.mark.acceptance
def test_a_weak_step_has_every_time_at_which_it_could_be_in_its_interval():
    """At 2 σ it could have come in one of several gaps between rows."""
    step = on("bias-step", 1)
    case = Hidden({step: (2.0 * SIGMA, before_row(15))})
    (cause,) = (causes[0] for causes in case.diagnosed(1).sets if [c.place for c in causes] == [step])
    assert holds(cause, case.effects[step])
    first, last = cause.intervals[1]
    assert last - first > 1.5 * PERIOD_S / 3600.0


@pytest.mark.acceptance
def test_outliers_of_a_whole_g_are_found_although_they_turn_the_signs_of_other_inputs():
    """Large misfits exceed the linear model: no level is claimed."""
    effects = {outlier(11, 3): (-2.0,), outlier(4, 2): (1.0,)}
    result = Hidden(effects, 40).diagnosed(5)
    assert_named(result, effects)
    assert result.level is None


@pytest.mark.acceptance
def test_rounded_temperatures_and_angles_do_not_refuse_the_right_name():
    """Every error is at its bound: rounding goes beyond it."""
    case = Hidden({on("temperature-bias", 1): (6e-5,)}, 36, AT_BOUND | WARM)
    record, digit = case.record(1), np.deg2rad(1e-6)
    rounded = replace(
        record,
        temperature=np.round(record.temperature, 2),
        temperature_resolution=0.005,
        alpha=digit * np.round(record.alpha / digit),
        beta=digit * np.round(record.beta / digit),
        angle_resolution=0.5 * digit,
    )
    assert_named(diagnosed(rounded), case.effects)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.acceptance) for k in (1, 2, 3))])
def test_readings_in_steps_are_named_where_noise_at_its_bound_came_after_the_rounding(seed):
    """If steps are a multiple of σ, such readings are exact multiples of σ, too."""
    rng = np.random.default_rng([seed, 5])
    place, step = on("quantisation", 1 + seed % 3), round(10.0 ** rng.uniform(-3.6, -2.4) / SIGMA) * SIGMA
    record = drawn_record(seed, [(place, (step,))], int(rng.integers(14, 45)), exact=True)
    reading = np.round(record.specific_force / G + SIGMA * rng.choice([-1.0, 1.0], record.specific_force.shape), 10)
    assert_named(diagnosed(replace(record, specific_force=G * reading, resolution=5e-11 * G)), {place: (step,)})


@pytest.mark.acceptance
def test_a_drift_contains_what_settles_slowly():
    result = Hidden({DRIFT: (2.3e-3,)}, 20, WARM).diagnosed(1)
    assert_named(result, {DRIFT: (2.3e-3,)})
    assert set(result.containing_sets) == {(on("warm-up", 1),), (on("thermal-lag", 1),)}


@pytest.mark.acceptance
def test_a_bias_that_goes_up_and_down_is_a_wander_and_what_depends_on_an_input_is_none():
    """No single effect is like it, and with no input or angle does it vary so little."""
    part, wander = np.linspace(0.0, 1.0, 30), drawn_record(5)
    wander.specific_force[:, 1] += 10.0 * SIGMA * G * np.sin(9.0 * part)
    ((cause,),) = diagnosed(wander).sets
    assert (cause.effect, cause.where, cause.place.law[:6]) == ("bias-wander", "accelerometer-2", "hours ")
    bent = drawn_record(6)
    n = bent.specific_force[:, 1] / G
    bent.specific_force[:, 1] += G * (30.0 * SIGMA * n**5 - 20.0 * SIGMA * np.abs(n) ** 3)
    assert "bias-wander" not in {place.effect for places in sets_of(diagnosed(bent)) for place in places}


@pytest.mark.acceptance
def test_an_outlier_is_named_by_the_records_own_number_alone_and_beside_an_effect():
    quadratic = on("quadratic", 2)
    for record, effects in ((hidden_record(21, quadratic, (2e-3,)), {quadratic: (2e-3,)}), (hidden_record(3), {})):
        part = record.selected(np.arange(5, len(record)))
        part.specific_force[7, 1] += 4e-4 * G
        result = diagnosed(part, rerun=True)
        assert_named(result, {**effects, outlier(int(part.position[7]), 2): (4e-4,)})
        assert {entry.get("accelerometer") for entry in result.to_json()["causes"]} >= {2}
        assert result.gain is None
