"""Targets and priors: linear combinations of the paper's X, in the form in which a person writes them.

Targets of the convention, other combinations, errors of readings at the corners of the input, priors |a'X| ≤ limit.
"""

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...models.bench import GYRO_PARAMETERS, SYMMETRIC_PAIRS, TARGETS
from ..errors import InputError, nearest
from .model import Linearisation, Parametrisation, determined, parametrise

ARCSEC = math.radians(1 / 3600)
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
    "X6+X8": ("misalignment-21", "rad"),
    "X7+X12": ("misalignment-31", "rad"),
    "X11+X13": ("misalignment-32", "rad"),
    "X8": ("mounting-error-3", "rad"),
    "-X12": ("mounting-error-2", "rad"),
    "X13": ("mounting-error-1", "rad"),
    "(X6+X8)/2": ("symmetric-misalignment-21", "rad"),
    "(X7+X12)/2": ("symmetric-misalignment-31", "rad"),
    "(X11+X13)/2": ("symmetric-misalignment-32", "rad"),
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

GYRO_NAMES = {
    "B": ("gyro-bias", "rad/s"),
    "M": ("gyro-misalignment", "rad"),
    "S": ("gyro-g-sensitivity", "rad/s/g"),
    "L": ("gyro-lag", "s"),
}
"""Name and unit of the gyros' parameters by their symbols' letter; the diagonal of M are scale-factor errors."""


def _motion_names() -> dict[str, tuple[str, str]]:
    """Return name and unit of the parameters that only motion shows, by their symbols."""
    named = {"A": ("accelerometer-lag", "s"), "L-A": ("gyro-lag-behind-accelerometers", "s")}
    named |= {f"r{p}{axis}": (f"accelerometer-place-{p}{axis}", "m") for p in (1, 2, 3) for axis in (1, 2, 3)}
    for symbol in GYRO_PARAMETERS:
        name, unit = GYRO_NAMES[symbol[0]]
        named[symbol] = ("-".join(filter(None, (name, symbol[1:]))), unit)
    return named | {f"M{axis}{axis}": (f"gyro-scale-factor-error-{axis}", "1") for axis in (1, 2, 3)}


MOTION_NAMES = _motion_names()
"""Physical name and unit of lags, of places of accelerometers, and of gyros."""

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

MISALIGNMENT_TARGETS = ((), ("X6+X8",), ("X7+X12", "X11+X13"))
BIAS_TARGETS = ("X16", "X17", "X18")
"""Targets of each accelerometer beside its scale factors, `SYMMETRIC_PAIRS`; Γ lower triangular."""

LEAST_LIMIT = 1e-12
"""The tightest prior, as the least noise bound: below is rounding."""
FROM_BOUNDS = "bounds"
"""The prior that stands for all: each parameter within u^max or v^0max of (1.7)."""

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
    return list(_targets_of(p.mountings, p.symmetric, convention))


@lru_cache
def _targets_of(mountings: tuple[str, ...], symmetric: bool, convention: str) -> tuple[Target, ...]:
    """Return the same, which do not depend on the matrices of the mountings."""
    p, targets = parametrise(dict.fromkeys(mountings, np.eye(3)), symmetric=symmetric), []
    for parameter in p.symbols:
        target, at, mounting = parameter.partition("@")
        symbol = target
        if convention == "A2":
            symbol = SYMMETRIC_CONVENTION.get(target, target)
        name, unit = NAMES[symbol]
        symbol = SYMBOL.sub(lambda match, suffix=at + mounting: match[0] + suffix, symbol)
        targets.append(Target(symbol, name + at + mounting, unit, expression_weights(symbol, p)))
    return tuple(targets)


def words_of(name: str) -> str:
    """Return a parameter in words, if it has words."""
    target, at, mounting = name.partition("@")
    named = NAMES | MOTION_NAMES
    return named[target][0] + at + mounting if target in named else name


def unit_of(name: str) -> str:
    """Return the unit of a parameter; empty for a ratio, or an unknown one."""
    target = name.partition("@")[0]
    return NAMES[target][1] if target in NAMES else ""


def asked_targets(expressions: Sequence[str], p: Parametrisation) -> list[Target]:
    """Return targets written as a person writes them: "X4-X5", "2*X4 + X6/3 - 0.5*X12", "X8@north".

    Raises an InputError for anything but a linear combination of X1..X18.
    """
    combinations, targets = [], []
    for symbol, (name, unit) in NAMES.items() if expressions else ():
        with suppress(InputError):
            combinations.append((name, unit, expression_weights(symbol, p)))
    for expression in expressions:
        weights = expression_weights(expression, p)
        fitting = [(n, u) for n, u, row in combinations if np.array_equal(row, weights)]
        name, unit = fitting[0] if fitting else ("linear-combination", _common_unit(weights, p))
        targets.append(Target(" ".join(expression.split()), name, unit, weights))
    return targets


def _common_unit(weights: NDArray, p: Parametrisation) -> str:
    units = {NAMES[symbol.split("@")[0]][1] for symbol, w in zip(p.symbols, weights, strict=True) if w != 0.0}
    if len(units) > 1 and units <= {"1", "rad"}:
        return "1"
    return units.pop() if len(units) == 1 else "mixed"


def expression_weights(expression: str, p: Parametrisation, option: str = "--target") -> NDArray:
    """Return weights (P,) of a linear combination of X1..X18 written with + - * / and parentheses, as in an option.

    With several mountings, X6, X7, X8, X11, X12, X13 differ by mounting and are written X8@name, unless the mounting
    drops out of the combination (X6+X8). An InputError names the fault of any other expression.
    """
    where = f"{option} {expression[:60]!r}"
    if len(expression) > MAX_EXPRESSION:
        raise InputError(f"{where}: longer than {MAX_EXPRESSION} characters")
    results = np.array([_Expression(expression, where, p, k).weights() for k in range(len(p.mountings))])
    if not np.allclose(results, results[0], rtol=1e-12, atol=0.0):
        raise InputError(
            f"{where}: X6, X7, X8, X11, X12 and X13 differ by mounting; write X8@{p.mountings[0]} "
            f"(mountings: {', '.join(p.mountings)})"
        )
    if not results[0].any():
        raise InputError(f"{where}: is zero whatever the parameters are; write a combination such as X4-X5")
    return results[0]


class _Expression:
    """A recursive-descent reader of one expression; values (P + 1,) are weights and a constant."""

    def __init__(self, text: str, where: str, p: Parametrisation, mounting: int):
        self._text, self._where, self._p, self._mounting = text, where, p, mounting
        self._at, self._depth = 0, 0

    @np.errstate(over="ignore", invalid="ignore")
    def weights(self) -> NDArray:
        """Weights (P,) of the whole text."""
        value = self._sum()
        weights, constant = value[:-1], value[-1]
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

    def _taken(self, signs: str) -> str:
        """Return the next sign and pass it if it is one of the given ones; else return an empty string."""
        sign = self._peek()
        if not sign or sign not in signs:
            return ""
        self._at += 1
        return sign

    def _peek(self) -> str:
        while self._at < len(self._text) and self._text[self._at] in " \t":
            self._at += 1
        return self._text[self._at : self._at + 1]

    def _sum(self) -> NDArray:
        value = self._product()
        while sign := self._taken("+-"):
            value = value + float(f"{sign}1") * self._product()
        return value

    def _product(self) -> NDArray:
        value = self._factor()
        while sign := self._taken("*/"):
            factor = self._factor()
            if sign == "/":
                if factor[:-1].any() or factor[-1] == 0.0:
                    self._refuse("divides by a parameter or by zero; a target is linear, as X6/3")
                factor[-1] = 1.0 / factor[-1]
            elif value[:-1].any() and factor[:-1].any():
                self._refuse("multiplies two parameters; a target is linear, as 2*X4")
            value = value * factor[-1] + np.append(factor[:-1] * value[-1], 0.0)
            if not np.isfinite(value).all():
                self._refuse("its numbers are too large")
        return value

    def _factor(self) -> NDArray:
        self._depth += 1
        if self._depth > 50:
            self._refuse("is nested too deeply")
        try:
            if sign := self._taken("+-"):
                return float(f"{sign}1") * self._factor()
            if self._taken("("):
                value = self._sum()
                if not self._taken(")"):
                    self._refuse("a parenthesis is not closed")
                return value
            first = self._peek()
            if number := NUMBER.match(self._text, self._at):
                self._at = number.end()
                if not math.isfinite(float(number[0])):
                    self._refuse("its numbers are too large")
                return np.append(np.zeros(len(self._p.symbols)), float(number[0]))
            if symbol := SYMBOL.match(self._text, self._at):
                self._at = symbol.end()
                return np.append(self._symbol(symbol[0]), 0.0)
            what = "ends too early"
            if first:
                what = f"{first!r} is not expected here (character {self._at + 1})"
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
                word = re.match(r"[\w-]*", rest)
                hint = nearest(word[0] if word else rest, self._p.mountings)
                self._refuse(f"{symbol}@: there is no such mounting ({hint})")
            name = max(fitting, key=len)
            if symbol not in IN_TARGETS and symbol not in ("X8", "X13"):
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


def corners() -> list[tuple[int, tuple[int, int, int]]]:
    """Accelerometer and input for every combination of −1, 0, 1 that its reading depends on (Γ lower triangular)."""
    signs, none = (-1, 0, 1), (0,)
    first, second, third = product(signs, none, none), product(signs, signs, none), product(signs, signs, signs)
    return [(1, n) for n in first] + [(2, n) for n in second] + [(3, n) for n in third]


def error_weights(p: Parametrisation) -> NDArray:
    """Weights (39, P) of (Γ n + b) of each of the `corners`, by the parameters of the fit."""
    rows = np.zeros((len(corners()), len(TARGETS)))
    for row, (accelerometer, n) in zip(rows, corners(), strict=True):
        axis = accelerometer - 1
        plus, minus = SYMMETRIC_PAIRS[axis]
        row[TARGETS.index(plus if n[axis] > 0 else minus)] += n[axis]
        for c, target in enumerate(MISALIGNMENT_TARGETS[axis]):
            row[TARGETS.index(target)] += n[c]
        row[TARGETS.index(BIAS_TARGETS[axis])] += 1.0
    # the block is the same in every mounting
    return rows @ p.selection[0]


@dataclass(frozen=True)
class Prior:
    """|weights'X| ≤ limit, and how it was written."""

    text: str
    weights: NDArray
    limit: float


@dataclass(frozen=True)
class WithPriors(Linearisation):
    """A linearisation with a row for each prior after those of the measurements: 0 = weights'X within its limit.

    `residual`, `jacobian`, `bound` and `span` count the priors; `reading` and `sign` do not.
    """

    prior: NDArray

    def residuals_at(self, points: NDArray) -> NDArray:
        """Return exact residuals (K, M) at other points; a prior's is its distance to zero."""
        return np.hstack((super().residuals_at(points), -points @ self.prior.T))

    def jacobian_at(self, point: NDArray) -> NDArray:
        """Exact derivatives (M + K, P) at another point; a prior's are its weights."""
        return np.vstack((super().jacobian_at(point), self.prior))


def asked_priors(texts: Sequence[str], p: Parametrisation, bounds: tuple[float, float]) -> list[Prior]:
    """Priors as a person writes them: "X16=1e-3", "X4-X5=2e-4", or "bounds" for all by (1.7).

    An InputError for another form, or a limit that is not positive.
    """
    priors = []
    for text in texts:
        if text.strip() == FROM_BOUNDS:
            every = zip(p.symbols, np.eye(len(p.symbols)), parameter_limits(p.symbols, bounds), strict=True)
            priors += [Prior(f"{s}={limit:g}", weights, float(limit)) for s, weights, limit in every if limit > 0.0]
            continue
        expression, equals, limit = text.rpartition("=")
        where = f"--prior {text[:60]!r}"
        if not equals:
            raise InputError(f"{where}: write a combination and its greatest size, as X16=1e-3, or {FROM_BOUNDS}")
        try:
            value = float(limit)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{where}: {limit.strip()[:20]!r} is not a positive number; write X16=1e-3")
        if value < LEAST_LIMIT:
            raise InputError(f"{where}: {value:g} is below {LEAST_LIMIT:g}, the least that can be used")
        priors.append(Prior(" ".join(text.split()), expression_weights(expression, p, "--prior"), value))
    return priors


def parameter_limits(symbols: Sequence[str], bounds: tuple[float, float], priors: Sequence[Prior] = ()) -> NDArray:
    """Return the largest size of each parameter (P,): u^max or v^0max of (1.7), or the limit of a prior on it alone."""
    limits = np.where(np.isin(symbols, ("X1", "X2", "X3")), float(bounds[0]), float(bounds[1]))
    by_prior: dict[int, float] = {}
    for prior in priors:
        if np.count_nonzero(prior.weights) == 1:
            k = int(np.argmax(np.abs(prior.weights)))
            by_prior[k] = min(by_prior.get(k, math.inf), prior.limit / abs(prior.weights[k]))
    for k, limit in by_prior.items():
        limits[k] = limit
    return limits


def with_priors(linearised: Linearisation, priors: Sequence[Prior]) -> Linearisation:
    """Return the linearisation with the priors' rows; itself when there are none."""
    if not priors:
        return linearised
    rows, prior_limits = np.array([prior.weights for prior in priors]), [prior.limit for prior in priors]
    jacobian = np.vstack([linearised.jacobian, rows])
    values = {field.name: getattr(linearised, field.name) for field in fields(linearised)} | {
        "residual": np.append(linearised.residual, -rows @ linearised.point),
        "jacobian": jacobian,
        "bound": np.append(linearised.bound, prior_limits),
        # a direction that a prior bounds is bounded, however loosely
        "span": determined(jacobian, float(linearised.bound.min())),
    }
    return WithPriors(**values, prior=rows)
