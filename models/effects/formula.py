"""A user's formula with unknown coefficients, as an effect like any other: "f2 += c*sin(3*alpha)".

The left side is the erroneous quantity, the right side its error, in the units of `QUANTITIES`; letters are the unknown
coefficients. The formula is parsed, never evaluated as Python. The signature is its exact derivative by the
coefficients.
"""

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Any

import numpy as np

from ..arrays import Floats
from ..expression import (
    Statements,
    derivatives,
    evaluated,
    expression_notation,
    followed,
    names_in,
    parsed_expression,
    power_of,
)
from ..written import written_kernel
from .columns import PORTS, MotionRows, Rows, values_read
from .definition import (
    ACCELEROMETERS,
    AXES,
    GYRO_BLOCK,
    Effect,
    EffectParameter,
    EffectPlace,
    at_port,
    name_of_law,
)

LARGEST = 1e6
"""Largest coefficient, in its unit: a formula does not limit sizes."""
MOST_COEFFICIENTS = 6
TURNED = 3e-3
"""Uncertainty of the inner encoder's zero [rad]: its offset cannot be separated from the mounting."""
Powers = Mapping[str, int]
"""A unit: powers of g, rad, s, h and K."""


@dataclass(frozen=True)
class Quantity:
    """A quantity on the right side of a formula.

    Attributes
    ----------
    kernel : str
        expression in a kernel
    unit : mapping
        its unit
    symbol : str
        symbol on a page
    words : str
        name in words
    """

    kernel: str
    unit: Powers
    symbol: str
    words: str


def _quantities() -> dict[str, Quantity]:
    """Return the possible quantities on the right side, beside numbers, pi and coefficients."""
    quantities = {}
    for k in range(3):
        text, words = f"context[INPUT + {k}]", f"input of accelerometer {k + 1}, g"
        quantities[f"n{k + 1}"] = Quantity(text, {"g": 1}, f"n_{k + 1}", words)
    for k in range(3):
        words = f"rate about axis {k + 1}, rad/s"
        quantities[f"w{k + 1}"] = Quantity(f"rate[{k}]", {"rad": 1, "s": -1}, f"ω_{k + 1}", words)
    for k in range(3):
        text = f"((rate[{k}] - context[PREVIOUS_RATE + {k}]) / context[STEP_LENGTH])"
        words = f"angular acceleration about axis {k + 1}, rad/s²"
        quantities[f"dw{k + 1}"] = Quantity(text, {"rad": 1, "s": -2}, f"dω_{k + 1}/dt", words)
    quantities["alpha"] = Quantity("context[ALPHA]", {}, "α", "true angle of the outer axis, rad")
    quantities["beta"] = Quantity("context[BETA]", {}, "β", "true angle of the inner axis, rad")
    quantities["hours"] = Quantity("context[HOURS]", {"h": 1}, "t", "since the first row")
    seconds = "(3600.0 * context[HOURS])"
    quantities["time_s"] = Quantity(seconds, {"s": 1}, "t_s", "seconds since the first row")
    quantities["temperature"] = Quantity("context[TEMPERATURE]", {"K": 1}, "T", "°C")
    for k in range(3):
        symbol, words = f"'sense of the last change of' n_{k + 1}", f"sense of the last change of n{k + 1}: 1, -1, or 0"
        quantities[f"sense{k + 1}"] = Quantity(f"context[SENSE_INPUT + {k}]", {}, symbol, words)
    for axis, symbol, words in (("alpha", "α", "outer"), ("beta", "β", "inner")):
        text = f"context[SENSE_{axis.upper()}]"
        words = f"sense of the last move of the {words} axis"
        quantities[f"sense_{axis}"] = Quantity(text, {}, f"'sense of' {symbol}", words)
    return quantities


QUANTITIES = _quantities()
ALIASES = {"t": "hours", "T": "temperature"}
"""Names in formulas on pages."""
ALWAYS = ("hours", "time_s", "temperature")
INPUTS, RATES, ANGLES = ("n1", "n2", "n3"), ("w1", "w2", "w3"), ("alpha", "beta")
GROWTHS, SENSES = ("dw1", "dw2", "dw3"), ("sense_alpha", "sense_beta")
OF_TABLE = ("alpha", "beta", "sense1", "sense2", "sense3")
"""Quantities that a record of a carried block does not have."""


@dataclass(frozen=True)
class Target:
    """The erroneous quantity of a formula.

    Attributes
    ----------
    where : str
        place of the effect
    component, stage : str
        component and stage that its kernel joins
    index : int
        index in the array to which the kernel adds
    names : tuple of str
        quantities that are known there
    unit : mapping
        unit of the error
    symbol, words : str
        symbol of the error on a page; name in words
    """

    where: str
    component: str
    stage: str
    index: int
    names: tuple[str, ...]
    unit: Powers
    symbol: str
    words: str

    @property
    def values(self) -> str:
        """Name of the values that a kernel of the stage takes."""
        return {"AccelerometerBlock": "n", "GyroBlock": "rate", "TurntableMotion": "angles"}[self.component]


def _targets() -> dict[str, Target]:
    """Return the possible targets on the left side."""
    targets = {}
    names, unit = INPUTS + OF_TABLE + ALWAYS, {"g": 1}
    for k, where in enumerate(ACCELEROMETERS):
        symbol, words = f"Δf_{k + 1}/g =", f"the reading of accelerometer {k + 1}, in g,"
        targets[f"f{k + 1}"] = Target(where, "AccelerometerBlock", "reading_effects", k, names, unit, symbol, words)
    names, unit = RATES + GROWTHS + INPUTS + ALWAYS, {"rad": 1, "s": -1}
    for k in range(3):
        symbol, words = f"Δω_{k + 1} =", f"the reading of gyro {k + 1}, in rad/s,"
        targets[f"w{k + 1}"] = Target(GYRO_BLOCK, "GyroBlock", "reading_effects", k, names, unit, symbol, words)
    names, unit = ANGLES + SENSES + ALWAYS, {"rad": 1}
    for k, where in enumerate(AXES):
        symbol, words = "αβ"[k], f"the reading of the encoder of the {where.replace('-', ' ')}, in rad,"
        symbol = f"{symbol}_read = {symbol} +"
        targets[ANGLES[k]] = Target(where, "TurntableMotion", "encoder_effects", k, names, unit, symbol, words)
    names = ANGLES + ALWAYS
    for k, where in enumerate(AXES):
        symbol, words = f"Δ{'κε'[k]} =", f"{'κε'[k]}, in rad,"
        target = Target(where, "TurntableMotion", "geometry_effects", 2 * k, names, unit, symbol, words)
        targets[("kappa", "epsilon")[k]] = target
    return targets


TARGETS = _targets()


@dataclass(frozen=True)
class Formula:
    """A formula with its unknown coefficients.

    Attributes
    ----------
    name : str
        name of its target, a key of `TARGETS`
    tree : ast.expr
        the right side
    columns : dict
        coefficient -> exact derivative by it, in the order of appearance
    """

    name: str
    tree: ast.expr
    columns: dict[str, ast.expr]

    @staticmethod
    def of(text: str) -> "Formula":
        """Return a formula from its text.

        Raises
        ------
        ValueError
            in one line the unusable part, and the correct form
        """
        target, _, right = (part.strip() for part in text.partition("+="))
        if not target or not right:
            raise ValueError("must be written as f2 += c*sin(3*alpha): what errs, += and what is added to it")
        target = {"α": "alpha", "β": "beta"}.get(target, target)
        if target not in TARGETS:
            raise ValueError(f"{_short(target)} is nothing that can err; {_nearest(target, list(TARGETS))}")
        tree = _renamed(parsed_expression(right))
        columns = derivatives(tree, _coefficients(tree, target))
        if not columns:
            raise ValueError("has no unknown coefficient; a letter is one, as in f2 += c*sin(3*alpha)")
        if len(columns) > MOST_COEFFICIENTS:
            raise ValueError(f"has {len(columns)} unknown coefficients; {MOST_COEFFICIENTS} are the most")
        return Formula(target, tree, columns)

    @property
    def target(self) -> Target:
        """Target of the formula."""
        return TARGETS[self.name]

    @property
    def law(self) -> str:
        """Canonical text of the formula."""
        return f"{self.name} += {ast.unparse(self.tree)}"

    @property
    def place(self) -> EffectPlace:
        """Place of the effect."""
        return EffectPlace("formula", self.target.where, law=self.law)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantities on which it depends."""
        return tuple(name for name in names_in(self.tree) if name in QUANTITIES)

    @property
    def texts(self) -> dict[str, str]:
        """Expressions of each quantity in a kernel at the place of the formula."""
        texts = {name: quantity.kernel for name, quantity in QUANTITIES.items()}
        texts["pi"] = "math.pi"
        if self.target.component == "TurntableMotion":
            texts |= {"alpha": "angles[0]", "beta": "angles[1]"}
        return texts

    def values(self, rows: Rows | MotionRows) -> dict[str, Any]:
        """Return the values (N,) of its quantities.

        Raises ValueError if the rows have none.
        """
        values: dict[str, Any] = {"pi": np.pi}
        for name in self.quantities:
            missing = name == "temperature" and rows.temperature is None
            if missing or (isinstance(rows, MotionRows) and name in OF_TABLE):
                raise ValueError(f"{self.law}: the record has no {name}")
            values[name] = values_read(self.texts[name], self.target.values, self.target.component, rows)
        return values

    def factors(self, rows: Rows | MotionRows) -> Floats:
        """Return the factor of each coefficient (N, K).

        Raises ValueError if it is not a number.
        """
        values = self.values(rows)
        factors = np.zeros((len(rows.hours), len(self.columns)))
        for k, column in enumerate(self.columns.values()):
            factors[:, k] = evaluated(column, values)
        finite = np.isfinite(factors).all(axis=1)
        if not finite.all():
            row = int(np.flatnonzero(~finite)[0])
            at = ", ".join(f"{name} = {values[name][row]:.6g}" for name in self.quantities)
            raise ValueError(f"{self.law}: is no finite number at row {row + 1}, where {at}")
        return factors

    def open_factors(self, rows: Rows) -> Floats:
        """Return the possible difference of the factors (N,), as a length, by quantities that the record leaves open.

        To first order: exact slopes times half a last digit, and the offset of the inner encoder's zero.
        """
        values, ones = self.values(rows), np.ones(len(rows.hours))
        differences = np.zeros((len(rows.hours), len(self.columns)))
        for name, size in (("temperature", rows.temperature_resolution), ("beta", TURNED)):
            if name in values:
                for k, column in enumerate(self.columns.values()):
                    differences[:, k] += size * np.abs(followed(column, values, {name: ones})[1])
        return np.linalg.norm(np.nan_to_num(differences), axis=1)

    def kernel_source(self) -> str:
        """Source of a kernel in restricted Python that adds the formula's value."""
        target, coefficients = self.target, {name: f"coefficient_{name}" for name in self.columns}
        added = "turns" if target.stage == "geometry_effects" else "added"
        arguments = ["context: Vector", f"{target.values}: Vector"]
        arguments += [f"{name}: float" for name in coefficients.values()]
        statements = Statements(self.texts | coefficients)
        addition = statements.of(self.tree)
        lines = [f"def formula_{name_of_law(self.law)}({', '.join(arguments)}, {added}: Vector) -> None:"]
        lines.append(f'    """Add what a formula says: {self.law}."""')
        lines += [f"    {line}" for line in statements.lines]
        lines.append(f"    {added}[{target.index}] = {added}[{target.index}] + {addition}")
        return "\n".join(lines) + "\n"

    def effect(self) -> Effect:
        """Return the formula as an effect."""
        target, law = self.target, self.law
        untold = {"temperature", "beta"} & set(self.quantities)
        open_argument = self._open_argument if untold and target.component == "AccelerometerBlock" else None
        symbols = {name: quantity.symbol for name, quantity in QUANTITIES.items()} | {"pi": "π"}
        parameters, degrees = [], []
        for name, column in self.columns.items():
            symbols[name] = f"{{{name}}}"
            parameters.append(EffectParameter(name, unit_of(target.unit, column), f"{name} of {law}", LARGEST))
            degrees.append(degree_of(column))
        return Effect(
            name="formula",
            places=(self.place,),
            parameters=tuple(parameters),
            sentence=self._sentence,
            component=target.component,
            stage=target.stage,
            kernel=written_kernel(self.kernel_source()),
            degree=max(degrees),
            formula=f"{target.symbol} {expression_notation(self.tree, symbols)}",
            columns=self._columns,
            open_argument=open_argument,
        )

    def _columns(self, place: EffectPlace, rows: Rows | MotionRows) -> Floats:
        return at_port(PORTS[self.target.stage], self.target.index, self.factors(rows))

    def _open_argument(self, place: EffectPlace, rows: Rows) -> Floats:
        return at_port(3, self.target.index, self.open_factors(rows)[:, None])[..., 0]

    def _sentence(self, place: EffectPlace, values: Mapping[str, float]) -> str:
        sizes = ", ".join(f"{name} = {value:+.2e}" for name, value in values.items())
        return f"{self.target.words} gains {ast.unparse(self.tree)}, {sizes}"


def _short(text: str) -> str:
    line = "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
    return repr(line if len(line) <= 40 else f"{line[:37]}...")


def _nearest(name: str, names: Sequence[str]) -> str:
    close = get_close_matches(name, names, n=1, cutoff=0.6)
    if close:
        return f"did you mean {close[0]}?"
    return f"there are {', '.join(names)}"


class _Renamed(ast.NodeTransformer):
    """Rename the names of pages to those of records."""

    def visit_Name(self, node: ast.Name) -> ast.Name:
        return ast.Name(ALIASES.get(node.id, node.id), node.ctx)


def _renamed(tree: ast.expr) -> ast.expr:
    return _Renamed().visit(tree)


def _coefficients(tree: ast.expr, target: str) -> list[str]:
    """Return the unknown coefficients.

    Raises ValueError for a name that is neither a coefficient nor known at this place.
    """
    names, coefficients = TARGETS[target].names, []
    for name in names_in(tree):
        if name in names or name == "pi":
            continue
        if name in QUANTITIES:
            raise ValueError(f"{name} is not known to what adds to {target}; it knows {', '.join(names)}")
        if name in TARGETS or not re.fullmatch(r"[a-zA-Z][0-9]?", name) or (name[0] in "fnw" and len(name) == 2):
            close = "" if len(name) > 30 else f"; {_nearest(name, names)}"
            raise ValueError(f"{_short(name)} is not known here, and a coefficient is a letter, as c or a1{close}")
        coefficients.append(name)
    return coefficients


def unit_of(of_error: Powers, column: ast.expr) -> str:
    """Return the unit of a coefficient, such as "1/g2"; that of the error if the other factor is a pure number.

    In a sum of terms with different units its numbers have unknown units: the sum counts as a number.
    """
    powers = dict(of_error)
    for name, power in (_powers(column) or {}).items():
        powers[name] = powers.get(name, 0) - power
    above, below = "", ""
    for name, power in powers.items():
        factor = name
        if abs(power) > 1:
            factor = f"{name}{abs(power)}"
        if power > 0:
            above += f".{factor}"
        elif power < 0:
            below += f"/{factor}"
    return (above[1:] or "1") + below


def _powers(node: ast.expr) -> dict[str, int] | None:
    """Return the unit of an expression; None for a bare number, which may have any."""
    match node:
        case ast.Constant():
            return None
        case ast.Name(id=name):
            if name not in QUANTITIES:
                return {}
            return dict(QUANTITIES[name].unit)
        case ast.UnaryOp(operand=operand):
            return _powers(operand)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            base = _powers(left)
            if base is None:
                return None
            return {name: power * power_of(right) for name, power in base.items()}
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            powers, sign = dict(_powers(left) or {}), -1
            if isinstance(op, ast.Mult):
                sign = 1
            for name, power in (_powers(right) or {}).items():
                powers[name] = powers.get(name, 0) + sign * power
            return {name: power for name, power in powers.items() if power}
        case ast.BinOp(left=left, right=right):
            first, second = _powers(left), _powers(right)
            if first is None or first == second:
                return second
            if second is None:
                return first
            return {}
        case ast.Call(func=ast.Name(id="abs"), args=[argument]):
            return _powers(argument)
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            square = _powers(argument) or {}
            if any(power % 2 for power in square.values()):
                return {}
            return {name: power // 2 for name, power in square.items()}
    return {}


def degree_of(node: ast.expr) -> int:
    """Return the degree of an expression in the inputs; for a function that of its argument."""
    match node:
        case ast.Name(id=name):
            return int(name in INPUTS)
        case ast.UnaryOp(operand=operand):
            return degree_of(operand)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return degree_of(left) * power_of(right)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return degree_of(left) + degree_of(right)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return degree_of(left) - degree_of(right)
        case ast.BinOp(left=left, right=right):
            return max(degree_of(left), degree_of(right))
        case ast.Call(args=args):
            return max(degree_of(argument) for argument in args)
    return 0


@cache
def formula_at(place: EffectPlace) -> Effect:
    """Return the formula of a place's law as an effect.

    Raises ValueError with the correct form.
    """
    formula = Formula.of(place.law)
    if place.where != formula.target.where:
        raise ValueError(f"law {place.law!r} is of {formula.target.where}, not of {place.where}")
    return formula.effect()


EFFECT = Effect("formula", (), (), lambda place, values: place.title, of_place=formula_at)
