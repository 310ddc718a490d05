"""Expressions of restricted Python as C99, operation by operation in the same order."""

import ast

from .kinds import INT, Scope

COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
OPERATORS = {ast.Add: ("+", 5), ast.Sub: ("-", 5), ast.Mult: ("*", 6), ast.Div: ("/", 6)}
UNARY, ATOM = 7, 9

RESERVED = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
atan2 cos fabs floor sin sqrt whole
"""
"""The words of C, and the functions of the translated source, that no variable may have for its name."""


def kernel_name(name: str) -> str:
    """What a kernel is called in C: `remainder`, say, is a function of C's own."""
    return f"kernel_{name}"


def variable_name(name: str) -> str:
    """What an argument or a variable is called in C."""
    return f"{name}_" if name in RESERVED.split() else name


def constant_name(name: str) -> str:
    """What a constant is called in C."""
    return f"k_{name}"


def number_text(value: float) -> str:
    """A constant; the shortest text that reads back to the same number."""
    return repr(value)


def expression(node: ast.expr, scope: Scope) -> str:
    """An expression in C; the scope has found it to be in restricted Python."""
    return _expression(node, scope)[0]


def _expression(node: ast.expr, scope: Scope) -> tuple[str, int]:
    """The text and how strongly it binds."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return number_text(value), ATOM
        case ast.Name(id=name):
            return variable_name(name) if name in scope.variables else constant_name(name), ATOM
        case ast.Attribute():
            return "MATH_PI", ATOM
        case ast.Subscript(value=ast.Name(id=name), slice=index):
            return f"{variable_name(name)}[{expression(index, scope)}]", ATOM
        case ast.UnaryOp(operand=operand):
            return f"-{_bound(operand, scope, UNARY + 1)}", UNARY
        case ast.BinOp(left=left, op=op, right=right):
            sign, level = OPERATORS[type(op)]
            first = _bound(left, scope, level)
            if isinstance(op, ast.Div) and scope.kind(left) == INT:
                first = f"(double){_bound(left, scope, UNARY)}"
            return f"{first} {sign} {_bound(right, scope, level + 1)}", level
        case ast.Call():
            return _call(node, scope)
    raise scope.refuse(node, "is not in restricted Python")


def _bound(node: ast.expr, scope: Scope, level: int) -> str:
    text, own = _expression(node, scope)
    return text if own >= level else f"({text})"


def _call(node: ast.Call, scope: Scope) -> tuple[str, int]:
    arguments = [expression(argument, scope) for argument in node.args]
    match node.func:
        case ast.Attribute(attr="floor"):
            # Python's floor is an int, which has no negative zero.
            return f"floor({arguments[0]}) + 0.0", 5
        case ast.Attribute(attr=name):
            return f"{name}({', '.join(arguments)})", ATOM
        case ast.Name(id="float"):
            return f"(double){_bound(node.args[0], scope, UNARY)}", UNARY
        case ast.Name(id="int"):
            if scope.kind(node.args[0]) == INT:
                return arguments[0], _expression(node.args[0], scope)[1]
            return f"whole({arguments[0]})", ATOM
        case ast.Name(id=name):
            return f"{kernel_name(name)}({', '.join(arguments)})", ATOM
    raise scope.refuse(node, "is not in restricted Python")


def condition(node: ast.expr, scope: Scope) -> str:
    """A condition in C."""
    match node:
        case ast.BoolOp(op=op, values=values):
            joint = " && " if isinstance(op, ast.And) else " || "
            return joint.join(
                f"({condition(v, scope)})" if isinstance(v, ast.BoolOp) else condition(v, scope) for v in values
            )
        case ast.UnaryOp(operand=operand):
            return f"!({condition(operand, scope)})"
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return f"{expression(left, scope)} {COMPARISONS[type(op)]} {expression(right, scope)}"
    raise scope.refuse(node, "is not a condition of restricted Python")
