"""The translator of restricted Python to C refuses unknown constructs, and names file, line and construct."""

import pytest

from trihedron.fmus.native.translate import RestrictionError, translate
from trihedron.fmus.source import SourcePart

HEAD = "def kernel(x: float, i: int, v: Vector, w: Vector) -> float:\n"


def translated(body: str, head: str = HEAD, before: str = "") -> str:
    text = head + "".join(f"    {line}\n" for line in body.splitlines())
    parts = [SourcePart(before, "before.py", 1)] if before else []
    return translate([*parts, SourcePart(text, "kernel.py", 10)])[0]


@pytest.mark.parametrize(
    ("body", "line", "construct"),
    [
        ("return x ** 2.0", 11, "x ** 2.0"),
        ("return x // 2.0", 11, "FloorDiv"),
        ("return x % 2.0", 11, "Mod"),
        ("y = 1.0\nreturn round(y)", 12, "round(y)"),
        ("return abs(x)", 11, "abs(x)"),
        ("return math.tan(x)", 11, "math.tan(x)"),
        ("return math.sqrt(x, x)", 11, "takes 1 argument"),
        ("return x if x > 0.0 else 1.0", 11, "if x > 0.0"),
        ("return 0.0 < x < 1.0", 11, "0.0 < x < 1.0"),
        ("if 0.0 < x < 1.0:\n    return x\nreturn 1.0", 11, "single comparisons"),
        ("if x:\n    return x\nreturn 1.0", 11, "a condition is made of"),
        ("return True", 11, "truth values"),
        ("return 'text'", 11, "'text'"),
        ("return v", 11, "is not a number"),
        ("return v[x]", 11, "an index is a whole number"),
        ("return x[0]", 11, "x is not a vector"),
        ("return v[0:2]", 11, "0:2"),
        ("return unknown", 11, "has no value yet"),
        ("x += 1.0\nreturn x", 11, "AugAssign"),
        ("y: float = 1.0\nreturn y", 11, "AnnAssign"),
        ("y = z = 1.0\nreturn y", 11, "of this form"),
        ("y, z = 1.0, 2.0\nreturn y", 11, "is not in restricted Python"),
        ("y = 1\ny = 2.0\nreturn y", 12, "y is a int and becomes a float"),
        ("y = v\nreturn y[0]", 11, "is not a number"),
        ("y = [x]\nreturn x", 11, "[x]"),
        ("for k in v:\n    x = k\nreturn x", 11, "of this form"),
        ("for k in range(0, i, 2):\n    x = 1.0\nreturn x", 11, "a start and an end"),
        ("for k in range(x):\n    x = 1.0\nreturn x", 11, "whole numbers"),
        ("for k in range(i):\n    i = 2\nreturn x", 11, "changes i, an end of its own range"),
        ("for k in range(i):\n    k = 2\nreturn x", 12, "counts a loop"),
        ("for k in range(i):\n    x = 1.0\nreturn v[k]", 13, "'k': has no value yet"),
        ("while x > 0.0:\n    break\nreturn x", 12, "Break"),
        ("for k in range(i):\n    continue\nreturn x", 12, "Continue"),
        ("assert x > 0.0\nreturn x", 11, "Assert"),
        ("raise ValueError", 11, "Raise"),
        ("import os\nreturn x", 11, "Import"),
        ("if x > 0.0:\n    return x", 10, "does not return on every way"),
        ("y = math.floor(x) * math.floor(x)\nreturn x", 11, "one side must be a float"),
        ("y = -math.floor(x)\nreturn x", 11, "the sign of a floor's zero"),
    ],
)
def test_what_is_not_restricted_python_is_refused(body, line, construct):
    with pytest.raises(RestrictionError) as refusal:
        translated(body)
    assert str(refusal.value).startswith(f"kernel.py, line {line}: ")
    assert construct in str(refusal.value)


@pytest.mark.parametrize(
    ("head", "construct"),
    [
        ("def kernel(x: float = 1.0) -> float:\n", "default values"),
        ("def kernel(*x: float) -> float:\n", "plain names"),
        ("def kernel(x) -> float:\n", "annotated"),
        ("def kernel(x: str) -> float:\n", "annotated"),
        ("def kernel(x: float):\n", "a kernel returns"),
        ("def kernel(x: float) -> bool:\n", "a kernel returns"),
    ],
)
def test_arguments_and_results_have_kinds(head, construct):
    with pytest.raises(RestrictionError, match=construct):
        translated("return 1.0", head)


DRAW = "def draw(v: Vector) -> float:\n    v[0] = v[0] + 1.0\n    return v[0]\n"


@pytest.mark.parametrize(
    ("body", "construct"),
    [
        ("return draw(v) - draw(w)", "a second call that changes a vector"),
        ("return v[0] + draw(v)", "changes v, which the same statement reads"),
        ("w[0] = draw(v) * v[1]\nreturn x", "changes v, which the same statement reads"),
        ("return draw(v, w)", "takes 1 arguments"),
        ("return draw(x)", "is a Vector"),
        ("return draw(v=w)", "keyword arguments"),
    ],
)
def test_an_order_that_c_leaves_open_is_refused(body, construct):
    with pytest.raises(RestrictionError, match=construct):
        translated(body, before=DRAW)


def test_order_and_grouping_of_operations_stay_as_they_are():
    text = translated("y = x - (x - 1.0) / (x * (2.0 / x)) - -x + 3 / i\nreturn y")
    assert "y = x - (x - 1.0) / (x * (2.0 / x)) - -x + (double)3 / i;" in text
    assert "return -(x + 1.0);" in translated("return -(x + 1.0)")
    assert "return floor(x) + 0.0 - (floor(x) + 0.0 - x);" in translated("return math.floor(x) - (math.floor(x) - x)")


def test_names_of_c_and_vectors_that_are_only_read():
    text = translated("double = v[0]\nw[i] = double\nreturn double")
    assert "double_ = v[0];" in text
    assert "whole_ = (double)whole(x);" in translated("whole = float(int(x))\nreturn whole")
    assert "const double *v, double *w" in text
    passed = translated("return draw(w)", before=DRAW)
    assert "kernel_kernel(double x, int64_t i, const double *v, double *w)" in passed
