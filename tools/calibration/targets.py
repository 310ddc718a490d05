"""What is asked for: linear combinations of the paper's X, by convention or as a person writes them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ..errors import InputError, nearest
from .parametrisation import MOUNTING_TARGETS, Parametrisation

NAMES = {
    "X1": ("outer-axis-tilt", "rad"),
    "X2": ("outer-angle-offset", "rad"),
    "X3": ("axis-nonorthogonality", "rad"),
    "X4": ("scale-factor-error-plus-1", "1"),
    "X5": ("scale-factor-error-minus-1", "1"),
    "X9": ("scale-factor-error-plus-2", "1"),
    "X10": ("scale-factor-error-minus-2", "1"),
    "X14": ("scale-factor-error-plus-3", "1"),
    "X15": ("scale-factor-error-minus-3", "1"),
    "X6+X8": ("misalignment-21", "1"),
    "X7+X12": ("misalignment-31", "1"),
    "X11+X13": ("misalignment-32", "1"),
    "X8": ("mounting-error-3", "rad"),
    "-X12": ("mounting-error-2", "rad"),
    "X13": ("mounting-error-1", "rad"),
    "(X6+X8)/2": ("symmetric-misalignment-21", "1"),
    "(X7+X12)/2": ("symmetric-misalignment-31", "1"),
    "(X11+X13)/2": ("symmetric-misalignment-32", "1"),
    "(X8-X6)/2": ("mounting-error-3", "rad"),
    "(X7-X12)/2": ("mounting-error-2", "rad"),
    "(X13-X11)/2": ("mounting-error-1", "rad"),
    "X16": ("bias-1", "g"),
    "X17": ("bias-2", "g"),
    "X18": ("bias-3", "g"),
    "X4-X5": ("scale-factor-asymmetry-1", "1"),
    "X9-X10": ("scale-factor-asymmetry-2", "1"),
    "X14-X15": ("scale-factor-asymmetry-3", "1"),
}
"""Physical name and unit of each target of the paper, and of the asymmetries."""

SYMMETRIC_CONVENTION = {
    "X6+X8": "(X6+X8)/2",
    "X7+X12": "(X7+X12)/2",
    "X11+X13": "(X11+X13)/2",
    "X8": "(X8-X6)/2",
    "-X12": "(X7-X12)/2",
    "X13": "(X13-X11)/2",
}
"""The paper's targets of convention A2 in place of those of A1."""

IN_TARGETS = {
    "X6": {"X6+X8": 1.0, "X8": -1.0},
    "X7": {"X7+X12": 1.0, "-X12": 1.0},
    "X11": {"X11+X13": 1.0, "X13": -1.0},
    "X12": {"-X12": -1.0},
}
"""The X that are no targets of case (A1) themselves, by those that are."""

NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
SYMBOL = re.compile(r"X\d+", re.ASCII)
MAX_EXPRESSION = 500
MAX_WEIGHT = 1e9


@dataclass(frozen=True)
class Target:
    """A linear combination of the parameters: its symbol, physical name, unit, and weights (P,)."""

    symbol: str
    name: str
    unit: str
    weights: NDArray


def convention_targets(p: Parametrisation, convention: str) -> list[Target]:
    """The targets of the paper under convention "A1" or "A2"; the mounting's once for each mounting."""
    minus = {pair[1] for pair in SYMMETRIC_PAIRS} if p.symmetric else set()
    groups: list[tuple[str, ...]] = []
    for target in TARGETS:
        if target in minus:
            continue
        if target in MOUNTING_TARGETS and len(p.mountings) > 1:
            if target == MOUNTING_TARGETS[0]:
                groups += [(t, name) for name in p.mountings for t in MOUNTING_TARGETS]
            continue
        groups.append((target,))
    targets = []
    for target, *mounting in groups:
        symbol = SYMMETRIC_CONVENTION.get(target, target) if convention == "A2" else target
        name, unit = NAMES[symbol]
        if mounting:
            symbol = SYMBOL.sub(lambda match, at=mounting[0]: f"{match[0]}@{at}", symbol)
            name = f"{name}@{mounting[0]}"
        targets.append(Target(symbol, name, unit, expression_weights(symbol, p)))
    return targets


def asked_targets(expressions: Sequence[str], p: Parametrisation) -> list[Target]:
    """Targets as a person writes them: "X4-X5", "2*X4 + X6/3 - 0.5*X12", "X8@north".

    Raises
    ------
    InputError
        for what is not a linear combination of X1..X18
    """
    named = [(name, unit, _known_weights(symbol, p)) for symbol, (name, unit) in NAMES.items()]
    targets = []
    for expression in expressions:
        weights = expression_weights(expression, p)
        fitting = [(n, u) for n, u, known in named if known is not None and np.array_equal(known, weights)]
        name, unit = fitting[0] if fitting else ("linear-combination", _common_unit(weights, p))
        targets.append(Target(" ".join(expression.split()), name, unit, weights))
    return targets


def _known_weights(symbol: str, p: Parametrisation) -> NDArray | None:
    try:
        return expression_weights(symbol, p)
    except InputError:
        return None


def _common_unit(weights: NDArray, p: Parametrisation) -> str:
    units = {NAMES[symbol.split("@")[0]][1] for symbol, w in zip(p.symbols, weights, strict=True) if w != 0.0}
    if len(units) > 1 and units <= {"1", "rad"}:
        return "1"
    return units.pop() if len(units) == 1 else "mixed"


def expression_weights(expression: str, p: Parametrisation) -> NDArray:
    """Weights (P,) of a linear combination of X1..X18 written with + - * / and parentheses.

    With several mountings, X6, X7, X8, X11, X12, X13 differ by mounting and are written X8@name, unless the mounting
    drops out of the combination (X6+X8).

    Raises
    ------
    InputError
        one line that says what is wrong with the expression
    """
    where = f"--target {expression[:60]!r}"
    if len(expression) > MAX_EXPRESSION:
        raise InputError(f"{where}: longer than {MAX_EXPRESSION} characters")
    results = [_Expression(expression, where, p, k).weights() for k in range(len(p.mountings))]
    if any(not np.allclose(other, results[0], rtol=1e-12, atol=0.0) for other in results[1:]):
        raise InputError(
            f"{where}: X6, X7, X8, X11, X12 and X13 differ by mounting; write X8@{p.mountings[0]} "
            f"(mountings: {', '.join(p.mountings)})"
        )
    if not results[0].any():
        raise InputError(f"{where}: is zero whatever the parameters are; write a combination such as X4-X5")
    return results[0]


class _Expression:
    """A recursive-descent reader of one expression; values are (constant, weights)."""

    def __init__(self, text: str, where: str, p: Parametrisation, mounting: int):
        self._text, self._where, self._p, self._mounting = text, where, p, mounting
        self._at, self._depth = 0, 0

    def weights(self) -> NDArray:
        """Weights (P,) of the whole text."""
        constant, weights = self._sum()
        if self._peek():
            self._refuse(f"{self._text[self._at]!r} is not expected here (character {self._at + 1})")
        if constant != 0.0 and weights.any():
            self._refuse("has a constant term; a target is a linear combination such as X4-X5")
        if constant != 0.0:
            self._refuse("names no parameter; write a combination such as X4-X5")
        if not np.abs(weights).max() <= MAX_WEIGHT:
            self._refuse(f"its numbers are too large; {MAX_WEIGHT:g} is the most")
        return weights

    def _refuse(self, what: str):
        raise InputError(f"{self._where}: {what}")

    def _peek(self) -> str:
        while self._at < len(self._text) and self._text[self._at] in " \t":
            self._at += 1
        return self._text[self._at : self._at + 1]

    def _sum(self) -> tuple[float, NDArray]:
        constant, weights = self._product()
        while (sign := self._peek()) in ("+", "-"):
            self._at += 1
            more, others = self._product()
            factor = 1.0 if sign == "+" else -1.0
            constant, weights = constant + factor * more, weights + factor * others
        return constant, weights

    def _product(self) -> tuple[float, NDArray]:
        constant, weights = self._factor()
        while (sign := self._peek()) in ("*", "/"):
            self._at += 1
            more, others = self._factor()
            if sign == "/":
                if others.any() or more == 0.0:
                    self._refuse("divides by a parameter or by zero; a target is linear, as X6/3")
                more = 1.0 / more
            elif weights.any() and others.any():
                self._refuse("multiplies two parameters; a target is linear, as 2*X4")
            constant, weights = constant * more, weights * more + others * constant
            if not (isfinite(constant) and np.isfinite(weights).all()):
                self._refuse("its numbers are too large")
        return constant, weights

    def _factor(self) -> tuple[float, NDArray]:
        self._depth += 1
        if self._depth > 50:
            self._refuse("is nested too deeply")
        try:
            first = self._peek()
            if first in ("+", "-"):
                self._at += 1
                constant, weights = self._factor()
                return (constant, weights) if first == "+" else (-constant, -weights)
            if first == "(":
                self._at += 1
                value = self._sum()
                if self._peek() != ")":
                    self._refuse("a parenthesis is not closed")
                self._at += 1
                return value
            if number := NUMBER.match(self._text, self._at):
                self._at = number.end()
                if not isfinite(float(number[0])):
                    self._refuse("its numbers are too large")
                return float(number[0]), np.zeros(len(self._p.symbols))
            if symbol := SYMBOL.match(self._text, self._at):
                self._at = symbol.end()
                return 0.0, self._symbol(symbol[0])
            what = f"{first!r} is not expected here (character {self._at + 1})" if first else "ends too early"
            self._refuse(f"{what}; write a combination of X1..X18 such as X4-X5")
            raise AssertionError
        finally:
            self._depth -= 1

    def _symbol(self, symbol: str) -> NDArray:
        if not (1 <= int(symbol[1:4]) <= 18) or len(symbol) > 3 or symbol[1] == "0":
            self._refuse(f"there is no {symbol[:12]}; the parameters are X1 to X18")
        mounting = self._mounting
        if self._text[self._at : self._at + 1] == "@":
            rest = self._text[self._at + 1 :]
            fitting = [name for name in self._p.mountings if rest.startswith(name)]
            if not fitting:
                given = re.match(r"[\w-]*", rest)
                hint = nearest(given[0] if given else rest, self._p.mountings)
                self._refuse(f"{symbol}@: there is no such mounting ({hint})")
            name = max(fitting, key=len)
            if symbol not in (*IN_TARGETS, "X8", "X13"):
                self._refuse(f"{symbol} is common to all mountings; write it without @{name}")
            self._at += 1 + len(name)
            mounting = self._p.mountings.index(name)
        if self._p.symmetric:
            for plus, minus in SYMMETRIC_PAIRS:
                if symbol == minus:
                    self._refuse(f"the symmetric baseline has no {minus}: {plus} stands for both signs")
        weights = np.zeros(len(TARGETS))
        for target, factor in IN_TARGETS.get(symbol, {symbol: 1.0}).items():
            weights[TARGETS.index(target)] += factor
        return weights @ self._p.selection[mounting]
