"""Forward differentiation of restricted Python: every construct against differences; refusals without a tangent."""

import math
import re

import pytest

from trihedron.fmus.native.tangent import tangents
from trihedron.fmus.native.translate import RestrictionError, translate
from trihedron.fmus.source import SourcePart

SCALE = "SCALE = 3.0\n"
SQUARE = '''
def norm(v: Vector) -> float:
    """Length."""
    total = 0.0
    for i in range(2):
        total = total + v[i] * v[i]
    return math.sqrt(total)
'''
DRAW = '''
def draw(v: Vector, factor: float) -> float:
    """Changes a vector and returns what it was."""
    before = v[0]
    v[0] = factor * v[0] - 1.0
    return before * v[1]
'''
KERNEL = '''
def kernel(x: float, y: float, k: int, v: Vector, out: Vector) -> int:
    """Something of everything."""
    if norm(v) > 1e9:
        return 1
    a = x * y / (1.0 + y * y) - -x
    b = math.sin(a) + math.cos(x * y) + math.exp(0.1 * x) + math.atan2(y, x)
    c = math.fabs(x - 2.0 * y) + math.sqrt(x * x + y) + float(int(x)) + math.floor(y) * x
    if a > b:
        c = c + a
    elif a > -1e9:
        c = c * b
    n = 3
    while n > 0:
        c = c + 0.1 * a / n
        n = n - 1
    d = draw(v, x)
    d = d * norm(v) + SCALE * 2.0
    for i in range(k):
        out[i] = c * d + i * v[i]
    return 0
'''


def made(*texts: str, kernels: str = "kernel") -> dict:
    """Return the kernels and their tangents, in Python; they pass through the translator, too."""
    parts = [SourcePart(text.strip(), "kernel.py", 10) for text in texts]
    every = [*parts, *tangents(parts, [kernels])]
    translate(every)
    names: dict = {}
    code = "from __future__ import annotations\nimport math\n" + "\n\n".join(part.text for part in every)
    exec(compile(code, "kernels", "exec"), names)
    return names


def test_every_construct_is_differentiated():
    names = made(SCALE, SQUARE, DRAW, KERNEL)
    at, along = [0.7, 1.3, 0.4, -0.9], [0.3, -1.1, 0.6, 0.2]

    def value(shift: float) -> list[float]:
        x, y, *v = (a + shift * d for a, d in zip(at, along, strict=True))
        out = [0.0, 0.0]
        assert names["kernel"](x, y, 2, v, out) == 0
        return [*out, *v]

    v, v_dot, out, out_dot = at[2:], along[2:], [0.0, 0.0], [0.0, 0.0]
    tangent = names["tangent_kernel"]
    assert tangent(at[0], along[0], at[1], along[1], 2, v, v_dot, out, out_dot, [0.0]) == 0
    assert [*out, *v] == value(0.0)
    h = 1e-4
    near = [
        (8.0 * (a - b) - (c - d)) / (12.0 * h)
        for a, b, c, d in zip(value(h), value(-h), value(2 * h), value(-2 * h), strict=True)
    ]
    assert [*out_dot, *v_dot] == pytest.approx(near, rel=1e-10, abs=1e-10)
    assert min(map(abs, out_dot)) > 0.1


def test_what_has_no_derivative_is_flat_there():
    names = made(
        "def kernel(x: float, y: float) -> float:\n    return math.sqrt(x) + math.fabs(x) + math.atan2(x, y)\n"
    )
    slope = [1.0]
    assert names["tangent_kernel"](0.0, 1.0, 0.0, 1.0, slope) == 0.0
    assert slope == [0.0]
    assert math.isfinite(names["tangent_kernel"](0.0, 1.0, 1.0, 0.0, slope))
    assert slope == [1.0]


def test_a_call_that_changes_something_in_a_condition_is_refused():
    text = "def kernel(v: Vector) -> int:\n    if draw(v, 1.0) > 0.0:\n        return 1\n    return 0\n"
    with pytest.raises(RestrictionError, match=re.escape("kernel.py, line 11: 'draw(v, 1.0)': changes a vector")):
        made(DRAW, text)
