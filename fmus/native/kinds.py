"""Kinds of the expressions of restricted Python, and where a kernel leaves what can be translated."""

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field

FLOAT, INT, VECTOR, WHOLE, NOTHING = "float", "int", "Vector", "whole", "None"
"""A number, an index, an array; a whole number that `math.floor` made, held as a number; no value."""

MATH = {"sqrt": 1, "sin": 1, "cos": 1, "atan2": 2, "floor": 1, "fabs": 1}
"""Functions of `math` that kernels may call, with their numbers of arguments."""


class RestrictionError(TypeError):
    """A kernel uses what restricted Python does not have; the message names file, line and construct."""


@dataclass(frozen=True)
class Signature:
    """How a kernel is called.

    Attributes
    ----------
    name : str
    arguments : tuple of str
    kinds : tuple of str
        of the arguments
    result : str
        kind of what it returns
    changed : frozenset of str
        names of the vectors that it writes into
    """

    name: str
    arguments: tuple[str, ...]
    kinds: tuple[str, ...]
    result: str
    changed: frozenset[str]


@dataclass
class Scope:
    """What a kernel's body knows: constants, kernels before it, its arguments and variables.

    Attributes
    ----------
    constants, variables : mapping
        name to kind
    kernels : mapping
        name to signature
    origin : str
        file of the kernel
    first_line : int
        line of the file on which the kernel begins
    """

    constants: Mapping[str, str]
    kernels: Mapping[str, Signature]
    origin: str
    first_line: int
    variables: dict[str, str] = field(default_factory=dict)

    def refuse(self, node: ast.AST, reason: str) -> RestrictionError:
        """The refusal of a construct."""
        line = self.first_line + getattr(node, "lineno", 1) - 1
        text = " ".join(ast.unparse(node).split())
        shown = text if len(text) <= 60 else text[:57] + "..."
        return RestrictionError(f"{self.origin}, line {line}: '{shown}': {reason}")

    def kind(self, node: ast.expr) -> str:
        """Kind of an expression that has a value."""
        match node:
            case ast.Constant(value=bool()):
                raise self.refuse(node, "truth values are no numbers in restricted Python")
            case ast.Constant(value=int()):
                return INT
            case ast.Constant(value=float(value)) if value - value == 0.0:
                return FLOAT
            case ast.Name(id=name) if name in self.variables:
                return self.variables[name]
            case ast.Name(id=name) if name in self.constants:
                return self.constants[name]
            case ast.Name():
                raise self.refuse(node, "has no value yet, or is neither a number nor a kernel")
            case ast.Attribute(value=ast.Name(id="math"), attr="pi"):
                return FLOAT
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                if self.variables.get(name) != VECTOR:
                    raise self.refuse(node, f"{name} is not a vector")
                if self.kind(index) != INT:
                    raise self.refuse(node, "an index is a whole number")
                return FLOAT
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                kind = self.number(operand)
                if kind == WHOLE:
                    raise self.refuse(node, "the sign of a floor's zero is lost: add to 0.0 first")
                return kind
            case ast.BinOp():
                return self._operation(node)
            case ast.Call():
                return self.call(node)
        raise self.refuse(node, "is not in restricted Python")

    def number(self, node: ast.expr) -> str:
        """Kind of an expression that must be a number."""
        kind = self.kind(node)
        if kind in (VECTOR, NOTHING):
            raise self.refuse(node, "is not a number")
        return kind

    def _operation(self, node: ast.BinOp) -> str:
        kinds = {self.number(node.left), self.number(node.right)}
        if not isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div):
            raise self.refuse(node, f"operator {type(node.op).__name__} is not in restricted Python")
        if WHOLE in kinds and FLOAT not in kinds:
            raise self.refuse(node, "whole numbers of any size are not in restricted Python: one side must be a float")
        return FLOAT if isinstance(node.op, ast.Div) or FLOAT in kinds else INT

    def call(self, node: ast.Call) -> str:
        """Kind of what a call returns."""
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise self.refuse(node, "keyword arguments are not in restricted Python")
        match node.func:
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in MATH:
                if len(node.args) != MATH[name]:
                    raise self.refuse(node, f"math.{name} takes {MATH[name]} argument(s)")
                for argument in node.args:
                    self.number(argument)
                return WHOLE if name == "floor" else FLOAT
            case ast.Name(id="int" | "float" as name) if len(node.args) == 1:
                self.number(node.args[0])
                return INT if name == "int" else FLOAT
            case ast.Name(id=name) if name in self.kernels:
                self._check_arguments(node, self.kernels[name])
                return self.kernels[name].result
        raise self.refuse(node, "is neither a kernel nor a function of math that restricted Python has")

    def _check_arguments(self, node: ast.Call, kernel: Signature) -> None:
        if len(node.args) != len(kernel.kinds):
            raise self.refuse(node, f"{kernel.name} takes {len(kernel.kinds)} arguments")
        for argument, name, wanted in zip(node.args, kernel.arguments, kernel.kinds, strict=True):
            given = self.kind(argument)
            if wanted == VECTOR or given == VECTOR:
                if wanted != given or not isinstance(argument, ast.Name):
                    raise self.refuse(argument, f"{kernel.name}'s {name} is a {wanted}; a vector is passed by its name")
            elif given == NOTHING or (wanted == INT and given != INT):
                raise self.refuse(argument, f"{kernel.name}'s {name} is a {wanted}")

    def condition(self, node: ast.expr) -> None:
        """Refuse what cannot be decided by `if` and `while`."""
        match node:
            case ast.BoolOp(values=values):
                for value in values:
                    self.condition(value)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                self.condition(operand)
            case ast.Compare(left=left, ops=[ast.Lt() | ast.LtE() | ast.Gt() | ast.GtE() | ast.Eq() | ast.NotEq()]):
                self.number(left)
                self.number(node.comparators[0])
            case _:
                raise self.refuse(node, "a condition is made of single comparisons of numbers, and, or, not")

    def check_order(self, nodes: list[ast.expr]) -> None:
        """Refuse expressions of one statement whose value depends on which is taken first: C leaves that open."""
        calls = [n for node in nodes for n in ast.walk(node) if isinstance(n, ast.Call) and self.changed(n)]
        if not calls:
            return
        if len(calls) > 1:
            raise self.refuse(calls[1], "a second call that changes a vector in one statement: give it its own")
        inside = set(ast.walk(calls[0]))
        for node in nodes:
            for other in ast.walk(node):
                if isinstance(other, ast.Name) and other.id in self.changed(calls[0]) and other not in inside:
                    raise self.refuse(calls[0], f"changes {other.id}, which the same statement reads")

    def changed(self, node: ast.Call) -> set[str]:
        """Names of the vectors that a call writes into."""
        if not (isinstance(node.func, ast.Name) and node.func.id in self.kernels):
            return set()
        kernel = self.kernels[node.func.id]
        pairs = zip(node.args, kernel.arguments, strict=True)
        return {a.id for a, name in pairs if name in kernel.changed and isinstance(a, ast.Name)}
