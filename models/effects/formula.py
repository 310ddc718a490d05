"""A formula that a person states, with unknown coefficients, as an effect like any other: "f2 += c*sin(3*alpha)".

Left stands what errs, right what is added to it, in the units of `QUANTITIES`; letters are the unknown coefficients. It
is parsed, never evaluated as Python. The signature is its exact derivative by the coefficients.
"""

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..expression import Statements, derivatives, evaluated, followed, names_in, parsed, power_of, typeset
from ..written import written
from .columns import PORTS, MotionRows, Rows
from .definition import (
    ACCELEROMETERS,
    AXES,
    GYRO_BLOCK,
    Effect,
    EffectParameter,
    EffectPlace,
    Sentence,
    at_port,
    name_of_law,
)

LARGEST = 1e6
"""No coefficient is larger, in its unit: a formula says nothing of sizes."""
MOST_COEFFICIENTS = 6
TURNED = 3e-3
"""The inner encoder's zero is not known better [rad]: its offset cannot be told from how the block is mounted."""
Powers = Mapping[str, int]
"""A unit: powers of g, rad, s, h and K."""


@dataclass(frozen=True)
class Quantity:
    """Something that a formula may name on its right.

    Attributes
    ----------
    attribute : str
        of the rows: `Rows` or `MotionRows`
    column : int or None
        of it
    kernel : str
        how a kernel reads it
    unit : mapping
    symbol : str
        on a page
    said : str
        in words
    """

    attribute: str
    column: int | None
    kernel: str
    unit: Powers
    symbol: str
    said: str

    def of(self, rows: Rows | MotionRows) -> NDArray[np.float64]:
        """Its values (N,)."""
        values = getattr(rows, self.attribute)
        return values if self.column is None else values[:, self.column]


QUANTITIES = {
    **{
        f"n{p}": Quantity("n", p - 1, f"context[INPUT + {p - 1}]", {"g": 1}, f"n_{p}", f"input of accelerometer {p}, g")
        for p in (1, 2, 3)
    },
    **{
        f"w{p}": Quantity("rate", p - 1, f"rate[{p - 1}]", {"rad": 1, "s": -1}, f"ω_{p}", f"rate about axis {p}, rad/s")
        for p in (1, 2, 3)
    },
    **{
        f"dw{p}": Quantity(
            "acceleration",
            p - 1,
            f"((rate[{p - 1}] - context[PREVIOUS_RATE + {p - 1}]) / context[STEP_LENGTH])",
            {"rad": 1, "s": -2},
            f"dω_{p}/dt",
            f"angular acceleration about axis {p}, rad/s²",
        )
        for p in (1, 2, 3)
    },
    "alpha": Quantity("alpha", None, "context[ALPHA]", {}, "α", "true angle of the outer axis, rad"),
    "beta": Quantity("beta", None, "context[BETA]", {}, "β", "true angle of the inner axis, rad"),
    "hours": Quantity("hours", None, "context[HOURS]", {"h": 1}, "t", "since the first row"),
    "time_s": Quantity("hours", None, "(3600.0 * context[HOURS])", {"s": 1}, "t_s", "seconds since the first row"),
    "temperature": Quantity("temperature", None, "context[TEMPERATURE]", {"K": 1}, "T", "°C"),
    **{
        f"sense{p}": Quantity(
            "input_sense",
            p - 1,
            f"context[SENSE_INPUT + {p - 1}]",
            {},
            f"'sense of the last change of' n_{p}",
            f"sense of the last change of n{p}: 1, -1, or 0",
        )
        for p in (1, 2, 3)
    },
    "sense_alpha": Quantity(
        "sense_alpha", None, "context[SENSE_ALPHA]", {}, "'sense of' α", "sense of the last move of the outer axis"
    ),
    "sense_beta": Quantity(
        "sense_beta", None, "context[SENSE_BETA]", {}, "'sense of' β", "sense of the last move of the inner axis"
    ),
}
"""What may stand on the right, beside numbers, pi and coefficients."""
ALIASES = {"t": "hours", "T": "temperature"}
"""As formulas on pages write them."""
ALWAYS = ("hours", "time_s", "temperature")
INPUTS, RATES, ANGLES = ("n1", "n2", "n3"), ("w1", "w2", "w3"), ("alpha", "beta")
GROWTHS = ("dw1", "dw2", "dw3")
OF_TABLE = (*ANGLES, "sense1", "sense2", "sense3")
"""What a record of a block that is carried does not have."""


@dataclass(frozen=True)
class Target:
    """What errs by a formula.

    Attributes
    ----------
    where : str
        the place of the effect
    component, stage : str
        that its kernel joins
    index : int
        of the array to which the kernel adds
    names : tuple of str
        of the quantities that are known there
    unit : mapping
    symbol, said : str
        of the error on a page; in words
    """

    where: str
    component: str
    stage: str
    index: int
    names: tuple[str, ...]
    unit: Powers
    symbol: str
    said: str


TARGETS = {
    **{
        f"f{p}": Target(
            where,
            "AccelerometerBlock",
            "reading_effects",
            p - 1,
            (*INPUTS, *OF_TABLE, *ALWAYS),
            {"g": 1},
            f"Δf_{p}/g =",
            f"the reading of accelerometer {p}, in g,",
        )
        for p, where in enumerate(ACCELEROMETERS, start=1)
    },
    **{
        f"w{p}": Target(
            GYRO_BLOCK,
            "GyroBlock",
            "reading_effects",
            p - 1,
            (*RATES, *GROWTHS, *INPUTS, *ALWAYS),
            {"rad": 1, "s": -1},
            f"Δω_{p} =",
            f"the reading of gyro {p}, in rad/s,",
        )
        for p in (1, 2, 3)
    },
    **{
        name: Target(
            where,
            "TurntableMotion",
            "encoder_effects",
            k,
            (*ANGLES, "sense_alpha", "sense_beta", *ALWAYS),
            {"rad": 1},
            f"{symbol}_read = {symbol} +",
            f"the reading of the encoder of the {where.replace('-', ' ')}, in rad,",
        )
        for k, (name, where, symbol) in enumerate(zip(ANGLES, AXES, "αβ", strict=True))
    },
    **{
        name: Target(
            where,
            "TurntableMotion",
            "geometry_effects",
            2 * k,
            (*ANGLES, *ALWAYS),
            {"rad": 1},
            f"Δ{symbol} =",
            f"{symbol}, in rad,",
        )
        for k, (name, where, symbol) in enumerate(zip(("kappa", "epsilon"), AXES, "κε", strict=True))
    },
}
"""What may stand on the left."""


@dataclass(frozen=True)
class Formula:
    """A formula with its unknown coefficients.

    Attributes
    ----------
    left : str
        a key of `TARGETS`
    tree : ast.expr
        what is added
    columns : dict
        coefficient -> exact derivative by it, in the order of appearance
    """

    left: str
    tree: ast.expr
    columns: dict[str, ast.expr]

    @staticmethod
    def of(text: str) -> "Formula":
        """A formula from its text.

        Raises
        ------
        ValueError
            in one line what cannot be used, and what would be right
        """
        left, plus, right = (part.strip() for part in text.partition("+="))
        if not plus or not left or not right:
            raise ValueError("must be written as f2 += c*sin(3*alpha): what errs, += and what is added to it")
        left = {"α": "alpha", "β": "beta"}.get(left, left)
        if left not in TARGETS:
            raise ValueError(f"{_short(left)} is nothing that can err; {_nearest(left, list(TARGETS))}")
        tree = _renamed(parsed(right))
        columns = derivatives(tree, _coefficients(tree, left))
        if not columns:
            raise ValueError("has no unknown coefficient; a letter is one, as in f2 += c*sin(3*alpha)")
        if len(columns) > MOST_COEFFICIENTS:
            raise ValueError(f"has {len(columns)} unknown coefficients; {MOST_COEFFICIENTS} are the most")
        return Formula(left, tree, columns)

    @property
    def target(self) -> Target:
        """What errs."""
        return TARGETS[self.left]

    @property
    def law(self) -> str:
        """As it is written, in one way."""
        return f"{self.left} += {ast.unparse(self.tree)}"

    @property
    def place(self) -> EffectPlace:
        """Where the effect sits."""
        return EffectPlace("formula", self.target.where, law=self.law)

    @property
    def quantities(self) -> tuple[str, ...]:
        """What it depends on."""
        return tuple(name for name in names_in(self.tree) if name in QUANTITIES)

    def values(self, rows: Rows | MotionRows) -> dict[str, Any]:
        """The values (N,) of what it depends on; a ValueError where the rows have none."""
        known: dict[str, Any] = {"pi": np.pi}
        for name in self.quantities:
            attribute = QUANTITIES[name].attribute
            # The inputs of a block that is carried are its specific force.
            if attribute == "n" and isinstance(rows, MotionRows):
                known[name] = rows.specific_force[:, int(name[1]) - 1]
                continue
            if getattr(rows, attribute, None) is None:
                raise ValueError(f"{self.law}: the record has no {name}")
            own = QUANTITIES[name].of(rows)
            known[name] = 3600.0 * own if name == "time_s" else own
        return known

    def factors(self, rows: Rows | MotionRows) -> NDArray[np.float64]:
        """What each coefficient is multiplied by (N, K); a ValueError where that is no number."""
        known, count = self.values(rows), len(rows.hours)
        found = np.stack([np.broadcast_to(evaluated(c, known), count) for c in self.columns.values()], axis=1)
        if not np.isfinite(found).all():
            row = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
            at = ", ".join(f"{name} = {known[name][row]:.6g}" for name in self.quantities)
            raise ValueError(f"{self.law}: is no finite number at row {row + 1}, where {at}")
        return found

    def open_factors(self, rows: Rows) -> NDArray[np.float64]:
        """By how much the factors may differ (N,), with what is not told of temperature and inner angle, as a length.

        To first order: exact slopes times half a last digit, and the offset of an encoder's zero.
        """
        known, count = self.values(rows), len(rows.hours)
        found = np.zeros((count, len(self.columns)))
        for name, size in (("temperature", rows.temperature_resolution), ("beta", TURNED)):
            if name in known:
                slopes = [followed(c, known, {name: np.ones(count)})[1] for c in self.columns.values()]
                found += size * np.abs(np.stack([np.broadcast_to(s, count) for s in slopes], axis=1))
        return np.linalg.norm(np.nan_to_num(found), axis=1)

    def kernel_source(self) -> str:
        """A kernel in restricted Python that adds what the formula says."""
        target = self.target
        of_table, of_gyros = target.component == "TurntableMotion", target.component == "GyroBlock"
        texts = {name: quantity.kernel for name, quantity in QUANTITIES.items()} | {"pi": "math.pi"}
        texts |= {name: f"coefficient_{name}" for name in self.columns}
        if of_table:
            texts |= {"alpha": "angles[0]", "beta": "angles[1]"}
        added = "turns" if target.stage == "geometry_effects" else "added"
        seen = "angles" if of_table else "rate" if of_gyros else "n"
        statements = Statements(texts)
        what = statements.of(self.tree)
        coefficients = "".join(f"coefficient_{name}: float, " for name in self.columns)
        lines = [
            f"def formula_{name_of_law(self.law)}(context: Vector, {seen}: Vector, {coefficients}{added}: Vector) "
            "-> None:",
            f'    """Add what a formula says: {self.law}."""',
            *(f"    {line}" for line in statements.lines),
            f"    {added}[{target.index}] = {added}[{target.index}] + {what}",
        ]
        return "\n".join(lines) + "\n"

    def effect(self) -> Effect:
        """The formula as an effect."""
        target, columns = self.target, list(self.columns.items())
        untold = {"temperature", "beta"} & set(self.quantities)
        open_argument = self._open_argument if untold and target.component == "AccelerometerBlock" else None
        names = {name: quantity.symbol for name, quantity in QUANTITIES.items()} | {"pi": "π"}
        shown = typeset(self.tree, names | {name: f"{{{name}}}" for name in self.columns})
        return Effect(
            name="formula",
            places=(self.place,),
            parameters=tuple(
                EffectParameter(name, unit_of(target.unit, column), f"{name} of {self.law}", LARGEST)
                for name, column in columns
            ),
            sentence=self._sentence(),
            component=target.component,
            stage=target.stage,
            kernel=written(self.kernel_source()),
            degree=max(degree_of(column) for _, column in columns),
            formula=f"{target.symbol} {shown}",
            columns=self._columns,
            open_argument=open_argument,
        )

    def _columns(self, place: EffectPlace, rows: Rows | MotionRows) -> NDArray[np.float64]:
        return at_port(PORTS[self.target.stage], self.target.index, self.factors(rows))

    def _open_argument(self, place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
        found = np.zeros(rows.n.shape)
        found[:, self.target.index] = self.open_factors(rows)
        return found

    def _sentence(self) -> Sentence:
        what, said = ast.unparse(self.tree), self.target.said

        def say(place: EffectPlace, values: Mapping[str, float]) -> str:
            sizes = ", ".join(f"{name} = {value:+.2e}" for name, value in values.items())
            return f"{said} gains {what}, {sizes}"

        return say


def _short(text: str) -> str:
    line = "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
    return repr(line if len(line) <= 40 else f"{line[:37]}...")


def _nearest(name: str, known: Sequence[str]) -> str:
    close = get_close_matches(name, known, n=1, cutoff=0.6)
    return f"did you mean {close[0]}?" if close else f"there are {', '.join(known)}"


class _Renamed(ast.NodeTransformer):
    """Names of pages as those of records."""

    def visit_Name(self, node: ast.Name) -> ast.Name:
        return ast.Name(ALIASES.get(node.id, node.id), node.ctx)


def _renamed(tree: ast.expr) -> ast.expr:
    return _Renamed().visit(tree)


def _coefficients(tree: ast.expr, left: str) -> list[str]:
    """The unknown coefficients; a ValueError for a name that is neither a coefficient nor known where it stands."""
    known, found = TARGETS[left].names, []
    for name in names_in(tree):
        if name in known or name == "pi":
            continue
        if name in QUANTITIES:
            raise ValueError(f"{name} is not known to what adds to {left}; it knows {', '.join(known)}")
        if name in TARGETS or not re.fullmatch(r"[a-zA-Z][0-9]?", name) or (name[0] in "fnw" and len(name) == 2):
            close = "" if len(name) > 30 else f"; {_nearest(name, known)}"
            raise ValueError(f"{_short(name)} is not known here, and a coefficient is a letter, as c or a1{close}")
        found.append(name)
    return found


def unit_of(left: Powers, column: ast.expr) -> str:
    """The unit of a coefficient, such as "1/g2"; that of what errs where the other factor is a pure number.

    In a sum of terms with different units the numbers in it have units, which nobody knows: it counts as a number.
    """
    powers = dict(left)
    for name, power in (_powers(column) or {}).items():
        powers[name] = powers.get(name, 0) - power
    texts = [
        ".".join(f"{name}{abs(power) if abs(power) > 1 else ''}" for name, power in powers.items() if power * sign > 0)
        for sign in (1, -1)
    ]
    return f"{texts[0] or '1'}/{texts[1].replace('.', '/')}" if texts[1] else texts[0] or "1"


def _powers(node: ast.expr) -> dict[str, int] | None:
    """The unit of an expression; None of a bare number, which may have any."""
    match node:
        case ast.Constant():
            return None
        case ast.Name(id=name):
            return dict(QUANTITIES[name].unit) if name in QUANTITIES else {}
        case ast.UnaryOp(operand=operand):
            return _powers(operand)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            own = _powers(left)
            return None if own is None else {name: power * power_of(right) for name, power in own.items()}
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            found, sign = dict(_powers(left) or {}), 1 if isinstance(op, ast.Mult) else -1
            for name, power in (_powers(right) or {}).items():
                found[name] = found.get(name, 0) + sign * power
            return {name: power for name, power in found.items() if power}
        case ast.BinOp(left=left, right=right):
            sides = [side for side in (_powers(left), _powers(right)) if side is not None]
            return None if not sides else sides[0] if all(side == sides[0] for side in sides) else {}
        case ast.Call(func=ast.Name(id="abs"), args=[argument]):
            return _powers(argument)
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            own = _powers(argument) or {}
            return {n: p // 2 for n, p in own.items()} if all(p % 2 == 0 for p in own.values()) else {}
    return {}


def degree_of(node: ast.expr) -> int:
    """The degree of an expression in the inputs; that of its argument for a function."""
    match node:
        case ast.Name(id=name):
            return 1 if name in INPUTS else 0
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
    """The formula of a place's law as an effect; a ValueError says what would be right."""
    formula = Formula.of(place.law)
    if place.where != formula.target.where:
        raise ValueError(f"law {place.law!r} is of {formula.target.where}, not of {place.where}")
    return formula.effect()


EFFECT = Effect("formula", (), (), lambda place, values: place.title, of_place=formula_at)
