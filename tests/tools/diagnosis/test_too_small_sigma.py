"""A noise bound that is too small is reported, and no physics is named in its place."""

import numpy as np
import pytest

import trihedron as th
from field_files import field_file
from gaussian_records import ERRORS, clean_record
from generator.positions import Session
from trihedron.models.effects import EffectPlace
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import diagnose

QUADRATIC = EffectPlace("quadratic", "accelerometer-2")


def with_effect(seed: int, place: EffectPlace, size: float, count: int = 48):
    """Return a record with one effect and uniform errors within 1e-5 g."""
    rng = np.random.default_rng(seed)
    session = Session.drawn(rng, count)
    return session.record([(place, (size,))], rng.uniform(-1e-5, 1e-5, (count, 3)))


@pytest.mark.first(1)
@pytest.mark.parametrize("errors", ["Gaussian", "uniform"])
@pytest.mark.parametrize(("seed", "count", "too_small"), [(11, 36, 1.4), (12, 48, 1.9), (13, 100, 1.6)])
def test_a_clean_record_asks_for_a_larger_bound(seed, count, too_small, errors):
    record = clean_record(seed, count, errors)
    radius = th.calibrate(record, noise_bound=1e-5).radius
    assert radius is not None
    least = 1e-5 * radius
    diagnosis = diagnose(record, noise_bound=least / too_small, rerun=False)
    first = diagnosis.explanations[0]
    assert (diagnosis.verdict, first.kind, first.numbers, diagnosis.causes) == ("explained", "sigma", 1, ())
    assert first.change is not None
    assert first.calibration is not None
    bound = first.change["noise_bound"]
    assert least <= bound < 1.1 * least
    assert first.sentence.startswith("No fault is found, but σ looks too small. With σ = ")
    assert first.calibration.sigma.kind == "estimated"
    assert th.calibrate(record, noise_bound=bound).verdict == "consistent"


@pytest.mark.acceptance
def test_a_record_of_the_field_with_half_its_bound(tmp_path, capsys):
    path = field_file("o12_clean_bound_half.csv", tmp_path)
    assert main(["diagnose", str(path), "--noise-bound", "5e-6"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("No fault is found, but σ looks too small. With σ = 8.8e-6 g the record fits.")
    assert "give --noise-bound 8.8e-6" in " ".join(out.split())
    assert "largest error 1.75 σ as given, 0.996 of the larger σ; the bound σ = 5e-6 g (given)" in " ".join(out.split())


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [21, 22])
def test_beside_an_effect_both_are_named(seed):
    record = with_effect(seed, QUADRATIC, 4e-4)
    diagnosis = diagnose(record, noise_bound=1e-5 / 1.35, rerun=False)
    first = diagnosis.explanations[0]
    assert (first.kind, first.where) == ("sigma", ("sigma", "accelerometer-2"))
    assert "quadratic accelerometer-2" in first.sentence
    assert [cause.place for cause in first.causes] == [QUADRATIC]
    # nothing is named without the larger bound
    assert diagnosis.verdict in ("explained", "ambiguous")
    assert all(explanation.numbers >= first.numbers for explanation in diagnosis.explanations)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_beside_a_hysteresis_whose_senses_are_unknown_in_some_rows(seed):
    hidden = th.hide(seed, "hysteresis")
    diagnosis = diagnose(hidden.record, noise_bound=1e-5 / 1.9, rerun=False)
    first = diagnosis.explanations[0]
    assert (diagnosis.verdict, first.kind) == ("explained", "sigma")
    assert first.where == ("sigma", hidden.secret["hidden"]["where"])
    assert [cause.effect for cause in first.causes] == ["hysteresis"]


@pytest.mark.first(1)
@pytest.mark.parametrize("size", [6e-5, 1.5e-4, 4e-4])
def test_an_effect_with_the_right_bound_is_no_noise(size):
    diagnosis = diagnose(with_effect(31, QUADRATIC, size), noise_bound=1e-5, rerun=False)
    assert diagnosis.radius is not None
    assert diagnosis.radius > 1.0
    assert all(explanation.kind != "sigma" for explanation in diagnosis.explanations)


def test_errors_are_those_that_were_asked_for():
    drawn = ERRORS["Gaussian"](np.random.default_rng(1), (4000, 3))
    assert np.std(drawn) == pytest.approx(1.0, abs=0.03)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("effect", "where", "size"),
    [
        ("backlash", "inner-axis", (1.5e-4,)),
        pytest.param("saturation", "accelerometer-1", (0.97,), marks=pytest.mark.acceptance),
        pytest.param("bias-step", "accelerometer-2", (1.5e-4, 0.4), marks=pytest.mark.acceptance),
    ],
)
def test_beside_an_effect_that_is_not_linear_both_are_named(effect, where, size):
    rng = np.random.default_rng(40)
    record = Session.drawn(rng, 48).record([(EffectPlace(effect, where), size)], rng.uniform(-1e-5, 1e-5, (48, 3)))
    diagnosis = diagnose(record, noise_bound=1e-5 / 1.3, rerun=False)
    first = diagnosis.explanations[0]
    assert (diagnosis.verdict, first.kind, first.where) == ("explained", "sigma", ("sigma", where))
    assert [cause.effect for cause in first.causes] == [effect]
    assert first.change is not None
    assert 0.8e-5 < first.change["noise_bound"] <= 1.1e-5
