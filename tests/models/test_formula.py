"""Formulas of a user: exact signatures, kernels, units, and one line for every other text."""

import contextlib
import math
import string
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from effect_readings import ROWS, readings, true_bench
from gyro_readings import gyro_readings, lively_motion
from trihedron.fmus import components
from trihedron.fmus.component import extend
from trihedron.fmus.units import unit_named
from trihedron.models.effects import parameter_name, place_from_mapping
from trihedron.models.effects.formula import QUANTITIES, TARGETS, Formula
from trihedron.models.expression import FUNCTIONS
from trihedron.tools.document import equation
from trihedron.tools.evidence import signature_columns

AT_REST = (
    "f1 += c*n1**3",
    "f2 += c*sin(3*alpha)",
    "f2 += c*sin(3*alpha) + d*cos(3*alpha)",
    "f3 += (c + d*n1)*(n3 - 0.2)**2/(1 + n2**2)",
    "f1 += c*exp(-hours/2) - d*step(hours - 1)*n2",
    "f2 += -c*(temperature - 20)**2*abs(n2)",
    "f3 += c*atan2(n1, n2) + d*sqrt(1.5 + n3) + e*sign(n1)*cos(2*beta)",
    "alpha += c*sin(7*alpha)",
    "beta += c*exp(cos(beta - 1)) + d*sense_beta*(temperature - 20)*1e-2",
    "kappa += c*cos(3*alpha)",
    "epsilon += c*sin(beta)**3 + d*hours",
)


@pytest.mark.first(2)
@pytest.mark.parametrize("text", AT_REST)
def test_its_signature_is_the_derivative_of_what_the_components_read(text):
    """Kernel and signature come from the same tree by different means."""
    place = Formula.of(text).place
    effect, columns = place.definition, signature_columns([place], true_bench()[1])
    assert columns.shape == (3 * ROWS, len(effect.parameters))
    for k in range(columns.shape[1]):
        slopes = []
        for size in (1e-3, 5e-4):
            unit = size * np.eye(columns.shape[1])[k]
            slopes.append((readings({place: tuple(unit)}) - readings({place: tuple(-unit)})).ravel() / (2.0 * size))
        derivative = (4.0 * slopes[1] - slopes[0]) / 3.0
        assert np.abs(derivative - columns[:, k]).max() < 2e-9 * max(1.0, np.abs(columns[:, k]).max())
        assert np.abs(columns[:, k]).max() > 1e-3


@pytest.mark.parametrize(
    "text", ["w1 += c*w1**3", "w2 += c*w1*n3 + d*exp(-time_s)*abs(w2)", "w3 += c*hours", "w1 += c*dw1 + d*abs(dw2)*dw3"]
)
def test_that_of_a_gyro_too(text):
    place, rows = Formula.of(text).place, lively_motion()
    columns, clean = place.definition.signature(place, rows), gyro_readings([], rows)
    for k in range(columns.shape[2]):
        values = 1e-3 * np.eye(columns.shape[2])[k]
        change = (gyro_readings([(place, values)], rows) - clean) / 1e-3
        assert np.abs(change - columns[..., k]).max() < 1e-11 * max(1.0, np.abs(columns).max())
        assert np.abs(columns[..., k]).max() > 0.0


def test_it_is_written_in_one_way_and_named_by_its_entry():
    formula = Formula.of("  f2+=c * sin( 3*α )+ d*T*t ")
    assert formula.law == "f2 += c * sin(3 * alpha) + d * temperature * hours"
    assert Formula.of(formula.law) == formula or Formula.of(formula.law).law == formula.law
    place = formula.place
    assert place_from_mapping({**place.entry, "c": 1e-4, "d": 2.0}) == (place, {"c": 1e-4, "d": 2.0})
    with pytest.raises(ValueError, match="is of accelerometer-2, not of accelerometer-1"):
        place_from_mapping({**place.entry, "where": "accelerometer-1", "c": 1e-4, "d": 2.0})
    block = extend(components()["AccelerometerBlock"], [place, Formula.of("f2 += c*sin(4*alpha)").place])
    names = [variable.name for variable in block.variables]
    assert len(names) == len(set(names))
    assert parameter_name(place, "c") in names
    assert place.definition.needs == ("temperature",)


@pytest.mark.parametrize(
    ("text", "units"),
    [
        ("f1 += c*n1**5", ["1/g4"]),
        ("f1 += c*n1 + d*n1*n2*hours", ["1", "1/g/h"]),
        ("f1 += c*sin(3*n1)", ["g"]),
        ("f1 += c*(temperature - 20)", ["g/K"]),
        ("f1 += c*(n1**2 - 0.5*n1)", ["g"]),
        ("w1 += c*w1**3", ["s2/rad2"]),
        ("w1 += c*n1*n2 + d/time_s", ["rad/s/g2", "rad"]),
        ("w1 += c*dw1 + d*dw2**2", ["s", "s3/rad"]),
        ("alpha += c*hours*sin(alpha)", ["rad/h"]),
        ("f2 += c*sqrt(n1**2 + n2**2)", ["1"]),
    ],
)
def test_its_coefficients_have_units(text, units):
    units = [parameter.unit for parameter in Formula.of(text).place.definition.parameters]
    assert units == units
    for unit in units:
        assert unit_named(unit).factor > 0.0


def test_composed_units_are_right():
    assert unit_named("1/g4").exponents == {"m": -4, "s": 8}
    assert unit_named("1/g4").factor == pytest.approx(9.80665**-4)
    assert unit_named("s2/rad2").exponents == {"s": 2, "rad": -2}
    assert unit_named("g/K/h").exponents == {"m": 1, "s": -3, "K": -1}
    assert unit_named("g/K/h").factor == pytest.approx(9.80665 / 3600.0)
    for wrong in ("apple", "g/", "1/g4/x", "g^2"):
        with pytest.raises(KeyError):
            unit_named(wrong)


def test_it_has_an_equation_for_pages():
    formula = Formula.of("f2 += -c*sin(3*alpha)/(1 + n1**5) + d*abs(n2)*2").place.definition.formula
    assert formula == "Δf_2/g = − {c} sin(3 α) / (1 + n_1⁵) + {d} |n_2| · 2"
    assert "<mn>5</mn>" in equation(formula.format(c="1e-4", d="2"))


def test_what_is_not_told_of_its_quantities_widens_the_bounds():
    """The bounds grow by half a last digit of the temperature, and by the zero of the inner encoder, to first order."""
    rows = true_bench()[1]
    for text, slope in (
        ("f2 += c*temperature**2", 2.0 * np.asarray(rows.temperature) * 0.05),
        ("f2 += c*sin(2*beta)", np.abs(2.0 * np.cos(2.0 * rows.beta)) * 3e-3),
    ):
        place = Formula.of(text).place
        effect = place.definition
        assert effect.open_argument is not None
        coarse = replace(rows, temperature_resolution=0.05)
        assert effect.open_argument(place, coarse)[:, 1] == pytest.approx(slope)
        assert not effect.open_argument(place, coarse)[:, [0, 2]].any()


def test_where_it_has_no_value_it_is_refused_and_its_kernel_adds_nothing():
    place = Formula.of("f1 += c/n2").place
    rows = true_bench()[1]
    zero = replace(rows, n=rows.n * [1.0, 0.0, 1.0])
    with pytest.raises(ValueError, match="no finite number at row 1, where n2 = 0"):
        place.definition.signature(place, zero)
    kernel = place.definition.kernel
    assert kernel is not None
    added = [0.0, 0.0, 0.0]
    kernel([0.0] * 20, [0.0] * 3, 1.0, added)
    assert added == [0.0, 0.0, 0.0]
    cold = replace(rows, temperature=None)
    place = Formula.of("f1 += c*temperature").place
    with pytest.raises(ValueError, match="the record has no temperature"):
        place.definition.signature(place, cold)


WRONG = {
    "": "must be written as",
    "f2": "must be written as",
    "f2 = c*n1": "must be written as",
    "f2 += ": "must be written as",
    "f4 += c*n1": "'f4' is nothing that can err",
    "n1 += c*n1": "nothing that can err",
    "f2 += 3*n1": "has no unknown coefficient",
    "f2 += c*n1 + 2*n2": r"'2 \* n2' has no unknown coefficient",
    "f2 += c*d*n1": "not linear in c, d",
    "f2 += c*sin(d*alpha)": "not linear in c, d",
    "f2 += (c*n1)**2": "not linear in c",
    "f2 += n1/c": "not linear in c",
    "f2 += c*n1^3": r"written \*\*",
    "f2 += c*n1**0.5": "a power is a whole number from -9 to 9, not 0.5",
    "f2 += c*n1**n2": "a power is a whole number",
    "f2 += c*9**9**9": "a power is a whole number",
    "f2 += c*alhpa": "did you mean alpha",
    "f2 += c*n4": "'n4' is not known here",
    "f2 += c*dw1": "dw1 is not known to what adds to f2",
    "f2 += c*w1": "w1 is not known to what adds to f2",
    "alpha += c*n1": "n1 is not known to what adds to alpha",
    "f2 += c*f2": "'f2' is not known here",
    "f2 += c*tan(alpha)": "no function tan; did you mean atan2",
    "f2 += c*sin()": "sin takes 1 argument",
    "f2 += c*atan2(n1)": "atan2 takes 2 arguments",
    "f2 += c*sin(x=n1)": "is not permitted",
    "f2 += c*n1.real": "is not permitted",
    "f2 += c*[n1][0]": "is not permitted",
    "f2 += c*(n1 if n2 else 1)": "is not permitted",
    "f2 += c*(x := n1)": "is not permitted",
    "f2 += c*True": "is not permitted",
    "f2 += c*1j": "is not permitted",
    "f2 += c*'n1'": "is not permitted",
    "f2 += c*1e999": "too large",
    "f2 += c*" + "9" * 200: "too large",
    "f2 += c*(n1": "cannot be read",
    "f2 += c\x00": "cannot be read",
    "f2 += c; import os": "cannot be read",
    "f2 += c += d": "cannot be read",
    "f2 += " + "(" * 400 + "c": "has 401 letters; 300 are the most",
    "f2 += " + "-" * 250 + "c": "deep within each other",
    "f2 += " + "(" * 140 + "c" + ")" * 140 + "*d*d": "not linear",
    "f2 += __import__('os').system('true')*c": "is not permitted",
    "f2 += c*open('x')": "no function open",
    "f2 += " + "+".join(f"{name}*n1" for name in "abcdefg"): "7 unknown coefficients",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_no_formula_is_refused_in_one_line(text):
    with pytest.raises(ValueError, match=WRONG[text]) as refusal:
        Formula.of(text)
    assert str(refusal.value).isprintable()
    assert len(str(refusal.value)) < 400


def formulas() -> st.SearchStrategy[str]:
    """Return a strategy of formulas and near formulas: known and unknown words, operators and brackets, in any
    order."""
    words = [*QUANTITIES, *FUNCTIONS, *TARGETS, "c", "d", "pi", "9", "1e300", "0", "0.5", "**", "+", "-", "*", "/"]
    words += ["(", ")", ",", "+=", "lambda:", "if", "else", "[", "]", ".", "__class__", "'x'", "\\", "\x00", ":=", ";"]
    texts = st.lists(st.sampled_from(words), max_size=40).map(" ".join)
    texts = st.text(string.printable + "αβ²\ud800½", max_size=60)
    return st.one_of(texts, texts).flatmap(
        lambda right: st.sampled_from([f"f1 += {right}", f"f1 += c*({right})", right])
    )


@pytest.mark.acceptance
@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(formulas())
def test_whatever_is_typed_gives_a_formula_or_one_line(text):
    """An accepted formula has a kernel that runs, known units, and a signature of numbers; a refusal is one line."""
    began, refusal = time.process_time(), ""
    try:
        formula = Formula.of(text)
    except ValueError as error:
        refusal = str(error)
        formula = None
    finally:
        assert time.process_time() - began < 1.0
    if formula is None:
        assert refusal.isprintable()
        return
    effect = formula.place.definition
    assert effect.kernel is not None
    added = [0.0] * 4
    effect.kernel([0.1] * 38, [0.1] * 3, *([1e-4] * len(effect.parameters)), added)
    for parameter in effect.parameters:
        assert unit_named(parameter.unit).factor > 0.0
    rows = lively_motion() if effect.in_motion else true_bench()[1]
    with contextlib.suppress(ValueError):
        assert np.isfinite(effect.signature(formula.place, rows)).all()
    assert all(math.isfinite(value) or abs(value) > 1e200 for value in added)
