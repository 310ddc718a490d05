"""The attitude computer's kernels for tests: the exact text that an FMU carries, in multiple precision."""

import ast
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache
from types import SimpleNamespace
from typing import Any

import mpmath
from mpmath import mpf

from trihedron.fmus import components
from trihedron.fmus.source import flat_source
from trihedron.models.attitude_algorithms import Algorithm
from trihedron.models.attitude_algorithms.computer import STEP_SIZE, TABLE_SIZE
from trihedron.models.attitude_algorithms.iteration import SPACE_SIZE

DIGITS = 50


class ExactNumbers(ast.NodeTransformer):
    """Replace every float literal by its exact decimal number, in multiple precision."""

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, float):
            text = ast.Constant(repr(node.value))
            return ast.Call(ast.Name("mpf", ast.Load()), [text], [])
        return node


@cache
def precise_kernels(component: str = "AttitudeComputer") -> dict[str, Any]:
    """Return the kernels of a component with mpmath's numbers and functions in place of floats and `math`."""
    functions = {name: getattr(mpmath.mp, name) for name in ("sqrt", "sin", "cos", "atan2", "floor", "fabs", "pi")}
    namespace: dict[str, Any] = {"math": SimpleNamespace(**functions), "mpf": mpf}
    source = flat_source(components()[component])
    tree = ast.fix_missing_locations(ExactNumbers().visit(ast.parse("from __future__ import annotations\n" + source)))
    exec(compile(tree, "<kernels in multiple precision>", "exec"), namespace)
    namespace["ITERATION_REMAINDER"] = mpf(10) ** -DIGITS
    return namespace


@cache
def tables(algorithm: Algorithm) -> list:
    """Return the tables that an algorithm prepares once."""
    table = [mpf(0)] * TABLE_SIZE
    entries = [Fraction(x) for product in algorithm.products for x in (algorithm.number, *product)]
    catalogue = [mpf(x.numerator) / x.denominator for x in entries]
    precise_kernels()["prepare_update"](mpf(algorithm.number), [*catalogue, mpf(0)], table)
    return table


@cache
def updater(algorithm: Algorithm) -> Callable[[Sequence, Sequence | None], list]:
    """Return a function that makes one update.

    Returns
    -------
    callable
        (increments of the step, those of the previous step or None) -> quaternion; increments are flat lists
    """
    kernels, number = precise_kernels(), mpf(algorithm.number)
    table = tables(algorithm)

    def update(g: Sequence, before: Sequence | None) -> list:
        empty = [mpf(0)] * STEP_SIZE
        turned = [mpf(0)] * 4
        failed = kernels["update"](
            number,
            [*(before or []), *empty][:STEP_SIZE],
            mpf(0 if before is None else 1),
            [*g, *empty][:STEP_SIZE],
            table,
            [mpf(0)] * SPACE_SIZE,
            [mpf(0)] * 4,
            turned,
        )
        assert failed == 0
        return turned

    return update


def product(p: Sequence, q: Sequence) -> list:
    """Return the quaternion product, written here independently."""
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
    ]


def angle_between(p: Sequence, q: Sequence) -> Any:
    """Return the angle between two attitudes [rad], for any norms."""
    turned = product([p[0], -p[1], -p[2], -p[3]], q)
    return 2 * mpmath.atan2(mpmath.sqrt(turned[1] ** 2 + turned[2] ** 2 + turned[3] ** 2), abs(turned[0]))
