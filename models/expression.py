"""Expressions that a person writes in one line: parsed, never evaluated as Python; slopes; source of a kernel.

They contain numbers, names, ``+ - * /``, ``**`` with a whole number, and the functions of `FUNCTIONS`. The source is
restricted Python (`trihedron.models.restricted`) and gives a number for any arguments. If an expression has no value (a
division by zero, the root of a negative number), a kernel adds nothing, and `evaluated` gives no value.
"""

import ast
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

import numpy as np

from .arrays import Floats

LONGEST = 300
"""Largest number of letters of an expression."""
DEEPEST = 20
"""Largest depth of nested operations."""
LARGEST_POWER = 9
LARGEST_NUMBER = 1e30
MOST_EXPONENT = 700.0
"""Largest argument of the exponential: beyond it the result overflows."""


@dataclass(frozen=True)
class Function:
    """A function that an expression may call.

    Attributes
    ----------
    source : tuple of str
        statements of a kernel that leave its value in {f}, from arguments {x} and {y}
    value : callable
        function of arrays
    slopes : callable
        arguments -> derivative by each of them
    """

    source: tuple[str, ...]
    value: Callable[..., Floats]
    slopes: Callable[..., tuple[Any, ...]]

    @property
    def count(self) -> int:
        """Number of its arguments."""
        return 2 if "{y}" in self.source[0] else 1


FUNCTIONS = {
    "sin": Function(("{f} = math.sin({x})",), np.sin, lambda x: (np.cos(x),)),
    "cos": Function(("{f} = math.cos({x})",), np.cos, lambda x: (-np.sin(x),)),
    "sqrt": Function(
        ("{f} = 0.0", "if {x} > 0.0:", "    {f} = math.sqrt({x})"), np.sqrt, lambda x: (0.5 / np.sqrt(x),)
    ),
    "abs": Function(("{f} = math.fabs({x})",), np.abs, lambda x: (np.sign(x),)),
    "exp": Function(
        ("{f} = {x}", f"if {{x}} > {MOST_EXPONENT!r}:", f"    {{f}} = {MOST_EXPONENT!r}", "{f} = math.exp({f})"),
        np.exp,
        lambda x: (np.exp(x),),
    ),
    "sign": Function(
        ("{f} = 0.0", "if {x} > 0.0:", "    {f} = 1.0", "if {x} < 0.0:", "    {f} = -1.0"),
        np.sign,
        lambda x: (0.0 * x,),
    ),
    "step": Function(
        ("{f} = 0.0", "if {x} > 0.0:", "    {f} = 1.0"), lambda x: np.where(x > 0.0, 1.0, 0.0), lambda x: (0.0 * x,)
    ),
    "atan2": Function(
        ("{f} = math.atan2({x}, {y})",),
        np.arctan2,
        lambda y, x: (x / (x * x + y * y), -y / (x * x + y * y)),
    ),
}
QUOTIENT = ("{f} = 0.0", "if {y} != 0.0:", "    {f} = {x} / {y}")
OPERATIONS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


def parsed_expression(text: str) -> ast.expr:
    """Return the tree of an expression with permitted operations and any names.

    Raises
    ------
    ValueError
        in one line the unreadable part, and the correct form
    """
    if len(text) > LONGEST:
        raise ValueError(f"has {len(text)} letters; {LONGEST} are the most")
    if "^" in text:
        raise ValueError("a power is written **, as n1**3")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(text.strip().replace("α", "alpha").replace("β", "beta"), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"'{_short(text)}' cannot be read; an example is c*sin(3*alpha)") from None
    _check(tree, 0)
    return tree


def _short(text: str) -> str:
    line = "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
    return line if len(line) <= 60 else f"{line[:57]}..."


def _shown(node: ast.AST) -> str:
    return f"'{_short(ast.unparse(node))}'"


def _check(node: ast.expr, depth: int) -> None:
    """Refuse operations that are not permitted."""
    if depth > DEEPEST:
        raise ValueError(f"operations stand more than {DEEPEST} deep within each other; write it with fewer brackets")
    match node:
        case ast.Constant(value=int() | float() as value) if type(value) is not bool:
            # An integer of any length is compared exactly.
            if not abs(value) <= LARGEST_NUMBER:
                raise ValueError(f"{_short(repr(value))} is too large: numbers are up to {LARGEST_NUMBER:g}")
        case ast.Name():
            pass
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            power_of(right)
            _check(left, depth + 1)
        case ast.BinOp(op=op, left=left, right=right) if type(op) in OPERATIONS:
            _check(left, depth + 1)
            _check(right, depth + 1)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check(operand, depth + 1)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            function = FUNCTIONS.get(name)
            if function is None:
                raise ValueError(f"there is no function {_short(name)}; {_known(name, list(FUNCTIONS))}")
            if len(args) != function.count or any(isinstance(a, ast.Starred) for a in args):
                raise ValueError(f"{_shown(node)}: {name} takes {function.count} argument{'s' * (function.count > 1)}")
            for argument in args:
                _check(argument, depth + 1)
        case _:
            raise ValueError(
                f"{_shown(node)} is not permitted; there are numbers, names, + - * / ** and {', '.join(FUNCTIONS)}"
            )


def _known(name: str, names: Sequence[str]) -> str:
    close = get_close_matches(name, names, n=1, cutoff=0.6)
    return f"did you mean {close[0]}?" if close else f"there are {', '.join(names)}"


def power_of(node: ast.expr) -> int:
    """Return the exponent of a power: a whole number."""
    sign = 1
    while isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node, sign = node.operand, -sign
    if isinstance(node, ast.Constant) and type(node.value) is int and node.value <= LARGEST_POWER:
        return sign * node.value
    raise ValueError(f"a power is a whole number from -{LARGEST_POWER} to {LARGEST_POWER}, not {_shown(node)[1:-1]}")


def names_in(tree: ast.expr) -> tuple[str, ...]:
    """Return the names of quantities and coefficients, in order of appearance."""
    return tuple(dict.fromkeys(_names(tree)))


def _names(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Name(id=name):
            yield name
        case ast.BinOp(left=left, op=op, right=right):
            yield from _names(left)
            if not isinstance(op, ast.Pow):
                yield from _names(right)
        case ast.UnaryOp(operand=operand):
            yield from _names(operand)
        case ast.Call(args=args):
            for argument in args:
                yield from _names(argument)


# An expression as a function of coefficients

ONE = ast.Constant(1.0)


def derivatives(tree: ast.expr, coefficients: Sequence[str]) -> dict[str, ast.expr]:
    """Return the exact derivative by each of several coefficients, which contains none of them.

    Raises
    ------
    ValueError
        if the expression is not a sum of terms with one coefficient each as a factor
    """
    parts = _linear(tree, set(coefficients))
    constant = parts.pop(None, None)
    if constant is not None:
        raise ValueError(f"{_shown(constant)} has no unknown coefficient; put a letter before it, as c*n1**3")
    return {name: parts[name] for name in coefficients}


def _linear(node: ast.expr, letters: set[str]) -> dict[str | None, ast.expr]:
    """Return the factors of each coefficient; under None the part without one."""
    if not letters & set(_names(node)):
        return {None: node}
    match node:
        case ast.Name(id=name):
            return {name: ONE}
        case ast.UnaryOp(op=op, operand=operand):
            return {name: ast.UnaryOp(op, part) for name, part in _linear(operand, letters).items()}
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            parts = _linear(left, letters)
            for name, part in _linear(right, letters).items():
                if name in parts:
                    parts[name] = ast.BinOp(parts[name], op, part)
                else:
                    parts[name] = part if isinstance(op, ast.Add) else ast.UnaryOp(ast.USub(), part)
            return parts
        case ast.BinOp(left=left, op=ast.Mult() as op, right=right):
            if not letters & set(_names(left)):
                return {name: ast.BinOp(left, op, part) for name, part in _linear(right, letters).items()}
            if not letters & set(_names(right)):
                return {name: ast.BinOp(part, op, right) for name, part in _linear(left, letters).items()}
        case ast.BinOp(left=left, op=ast.Div() as op, right=right) if not letters & set(_names(right)):
            return {name: ast.BinOp(part, op, right) for name, part in _linear(left, letters).items()}
        case ast.BinOp(left=left, op=ast.Pow(), right=right) if power_of(right) == 1:
            return _linear(left, letters)
    inside = ", ".join(sorted(letters & set(_names(node))))
    raise ValueError(
        f"{_shown(node)} is not linear in {inside}: an unknown coefficient is a factor, as in c*n1**3; "
        "give what stands elsewhere a number"
    )


def evaluated(tree: ast.expr, values: Mapping[str, Any]) -> Floats:
    """Return the expression at arrays of its names' values; not finite if it has no value."""
    return followed(tree, values, {})[0]


def followed(tree: ast.expr, values: Mapping[str, Any], slopes: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Return the expression and its exact derivative, given those of some of its names; the others are constant."""
    with np.errstate(all="ignore"):
        return _followed(tree, values, slopes)


def _followed(node: ast.expr, values: Mapping[str, Any], slopes: Mapping[str, Any]) -> tuple[Any, Any]:
    match node:
        case ast.Constant(value=value):
            return np.float64(value), 0.0  # type: ignore[arg-type]
        case ast.Name(id=name):
            return np.asarray(values[name], dtype=float), slopes.get(name, 0.0)
        case ast.UnaryOp(op=op, operand=operand):
            x, dx = _followed(operand, values, slopes)
            return (-x, -dx) if isinstance(op, ast.USub) else (x, dx)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            (x, dx), power = _followed(left, values, slopes), power_of(right)
            return x ** float(power), power * x ** float(power - 1) * dx if power else 0.0 * x
        case ast.BinOp(left=left, op=op, right=right):
            (x, dx), (y, dy) = (_followed(part, values, slopes) for part in (left, right))
            match op:
                case ast.Add():
                    return x + y, dx + dy
                case ast.Sub():
                    return x - y, dx - dy
                case ast.Mult():
                    return x * y, dx * y + x * dy
            return x / y, dx / y - x * dy / (y * y)
        case ast.Call(func=ast.Name(id=name), args=args):
            inputs = [_followed(argument, values, slopes) for argument in args]
            function, arguments = FUNCTIONS[name], [x for x, _ in inputs]
            by = function.slopes(*arguments)
            # A constant adds nothing, even where the function has no slope.
            moved = [slope * dx for slope, (_, dx) in zip(by, inputs, strict=True) if np.any(dx)]
            return function.value(*arguments), sum(moved, 0.0)
    raise AssertionError("the tree was checked")


# An expression in a kernel


@dataclass
class Statements:
    """Statements of restricted Python that compute expressions; `texts` replace the names in these."""

    texts: Mapping[str, str]
    lines: list[str] = field(default_factory=list)
    count: int = 0

    def of(self, node: ast.expr) -> str:
        """Return a name or an expression for the value, after adding the statements that it needs."""
        match node:
            case ast.Constant(value=value):
                return repr(float(value))  # type: ignore[arg-type]
            case ast.Name(id=name):
                return self.texts[name]
            case ast.UnaryOp(op=op, operand=operand):
                return f"(-{self.of(operand)})" if isinstance(op, ast.USub) else self.of(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self._power(left, power_of(right))
            case ast.BinOp(left=left, op=ast.Div(), right=ast.Constant(value=value)) if value != 0.0:
                return f"({self.of(left)} / {float(value)!r})"  # type: ignore[arg-type]
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return self._kept(QUOTIENT, self.of(left), self.of(right))
            case ast.BinOp(left=left, op=op, right=right):
                return f"({self.of(left)} {OPERATIONS[type(op)]} {self.of(right)})"
            case ast.Call(func=ast.Name(id=name), args=args):
                return self._kept(FUNCTIONS[name].source, *(self.of(argument) for argument in args))
        raise AssertionError("the tree was checked")

    def _power(self, base: ast.expr, power: int) -> str:
        """Return a power as a product."""
        if power == 0:
            return "1.0"
        product = " * ".join([self._named(self.of(base))] * abs(power))
        return f"({product})" if power > 0 else self._kept(QUOTIENT, "1.0", product)

    def _kept(self, statements: Sequence[str], *arguments: str) -> str:
        operands = dict(zip("xy", (self._named(argument) for argument in arguments), strict=False))
        letter = self._new()
        self.lines += [line.format(f=letter, **operands) for line in statements]
        return letter

    def _named(self, text: str) -> str:
        """Return a short text itself, otherwise the name of a variable that is computed once."""
        if re.fullmatch(r"[\w.]+(\[[\w +]+\])?", text):
            return text
        letter = self._new()
        self.lines.append(f"{letter} = {text}")
        return letter

    def _new(self) -> str:
        self.count += 1
        return f"part_{self.count}"


# An expression on a page

ATOM, POWER, FACTOR, NEGATIVE, SUM = 4, 3, 2, 1, 0
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def expression_notation(tree: ast.expr, texts: Mapping[str, str]) -> str:
    """Return the expression in the notation of `trihedron.tools.document.notation`, with a text for each name."""
    return _typeset(tree, texts)[0]


def _typeset(node: ast.expr, texts: Mapping[str, str]) -> tuple[str, int]:
    """Return the text and its binding strength."""

    def bound(part: ast.expr, least: int) -> str:
        text, level = _typeset(part, texts)
        return text if level >= least else f"({text})"

    match node:
        case ast.Constant(value=value):
            return (f"{value:g}", ATOM)
        case ast.Name(id=name):
            return (texts[name], ATOM)
        case ast.UnaryOp(op=op, operand=operand):
            return (f"− {bound(operand, FACTOR)}", NEGATIVE) if isinstance(op, ast.USub) else _typeset(operand, texts)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return (f"{bound(left, ATOM)}{str(power_of(right)).translate(_RAISED)}", POWER)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            dot = " · " if isinstance(right, ast.Constant) else " "
            return (f"{bound(left, NEGATIVE)}{dot}{bound(right, FACTOR)}", FACTOR)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return (f"{bound(left, NEGATIVE)} / {bound(right, POWER)}", FACTOR)
        case ast.BinOp(left=left, op=op, right=right):
            sign = "+" if isinstance(op, ast.Add) else "−"
            return (f"{bound(left, SUM)} {sign} {bound(right, FACTOR)}", SUM)
        case ast.Call(func=ast.Name(id=name), args=[argument]) if name == "abs":
            return (f"|{_typeset(argument, texts)[0]}|", ATOM)
        case ast.Call(func=ast.Name(id=name), args=args):
            return (f"{name}({', '.join(_typeset(argument, texts)[0] for argument in args)})", ATOM)
    raise AssertionError("the tree was checked")
