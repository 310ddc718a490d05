"""Kernels in restricted Python as functions in C99 that compute the same bits, operation by operation."""

import ast
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from ..source import SourcePart

FLOAT, INT, VECTOR, WHOLE, NOTHING = "float", "int", "Vector", "whole", "None"
"""A number, an index, an array; a whole number that `math.floor` made, held as a number; no value."""

MATH = {"sqrt": 1, "exp": 1, "log": 1, "sin": 1, "cos": 1, "atan2": 2, "floor": 1, "fabs": 1}
"""Functions of `math` that kernels may call, with their numbers of arguments."""


COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
OPERATORS = {ast.Add: ("+", 5), ast.Sub: ("-", 5), ast.Mult: ("*", 6), ast.Div: ("/", 6)}
UNARY, ATOM = 7, 9

RESERVED = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
atan2 cos exp fabs floor log sin sqrt whole
"""
"""The words of C, and the functions of the translated source, that no variable may have for its name."""


def kernel_name(name: str) -> str:
    """Return the name of a kernel in C, which differs from names of C's library such as `remainder`."""
    return f"kernel_{name}"


def variable_name(name: str) -> str:
    """Return the name of an argument or a variable in C."""
    if name in RESERVED.split():
        return f"{name}_"
    return name


def constant_name(name: str) -> str:
    """Return the name of a constant in C."""
    return f"k_{name}"


class RestrictionError(TypeError):
    """A kernel uses what restricted Python does not have; the message names file, line and construct."""


@dataclass(frozen=True)
class Signature:
    """Signature of a kernel.

    Attributes
    ----------
    name : str
    arguments : tuple of str
    kinds : tuple of str
        of the arguments
    result : str
        kind of its value
    changed : frozenset of str
        names of the vectors that it writes into
    """

    name: str
    arguments: tuple[str, ...]
    kinds: tuple[str, ...]
    result: str
    changed: frozenset[str]


class Value(NamedTuple):
    """An expression in C: its text, how strongly that binds, and its kind."""

    text: str
    level: int
    kind: str

    def bound(self, level: int) -> str:
        """The text, in brackets where it binds less strongly than its surroundings."""
        if self.level >= level:
            return self.text
        return f"({self.text})"


@dataclass
class Scope:
    """Names in a kernel's body: constants, kernels before it, its arguments and variables.

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
        excerpt = text if len(text) <= 60 else text[:57] + "..."
        return RestrictionError(f"{self.origin}, line {line}: '{excerpt}': {reason}")

    def value(self, node: ast.expr) -> Value:
        """An expression in C, which is refused where it is not in restricted Python."""
        match node:
            case ast.Constant(value=bool()):
                raise self.refuse(node, "truth values are no numbers in restricted Python")
            case ast.Constant(value=int() as number):
                return Value(repr(number), ATOM, INT)
            case ast.Constant(value=float(number)) if number - number == 0.0:
                return Value(repr(number), ATOM, FLOAT)
            case ast.Name(id=name) if name in self.variables:
                return Value(variable_name(name), ATOM, self.variables[name])
            case ast.Name(id=name) if name in self.constants:
                return Value(constant_name(name), ATOM, self.constants[name])
            case ast.Name():
                raise self.refuse(node, "has no value yet, or is neither a number nor a kernel")
            case ast.Attribute(value=ast.Name(id="math"), attr="pi"):
                return Value("MATH_PI", ATOM, FLOAT)
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                if self.variables.get(name) != VECTOR:
                    raise self.refuse(node, f"{name} is not a vector")
                at = self.value(index)
                if at.kind != INT:
                    raise self.refuse(node, "an index is a whole number")
                return Value(f"{variable_name(name)}[{at.text}]", ATOM, FLOAT)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                number = self.number(operand)
                if number.kind == WHOLE:
                    raise self.refuse(node, "the sign of a floor's zero is lost: add to 0.0 first")
                return Value(f"-{number.bound(UNARY + 1)}", UNARY, number.kind)
            case ast.BinOp():
                return self._operation(node)
            case ast.Call():
                return self.call(node)
        raise self.refuse(node, "is not in restricted Python")

    def number(self, node: ast.expr) -> Value:
        """An expression that must be a number."""
        value = self.value(node)
        if value.kind in (VECTOR, NOTHING):
            raise self.refuse(node, "is not a number")
        return value

    def _operation(self, node: ast.BinOp) -> Value:
        first_operand, second = self.number(node.left), self.number(node.right)
        kinds = {first_operand.kind, second.kind}
        if type(node.op) not in OPERATORS:
            raise self.refuse(node, f"operator {type(node.op).__name__} is not in restricted Python")
        if WHOLE in kinds and FLOAT not in kinds:
            raise self.refuse(node, "whole numbers of any size are not in restricted Python: one side must be a float")
        sign, level = OPERATORS[type(node.op)]
        divides = isinstance(node.op, ast.Div)
        first = (
            f"(double){first_operand.bound(UNARY)}"
            if divides and first_operand.kind == INT
            else first_operand.bound(level)
        )
        kind = FLOAT if divides or FLOAT in kinds else INT
        return Value(f"{first} {sign} {second.bound(level + 1)}", level, kind)

    def call(self, node: ast.Call) -> Value:
        """Return a call in C; its value may be nothing."""
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise self.refuse(node, "keyword arguments are not in restricted Python")
        match node.func:
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in MATH:
                if len(node.args) != MATH[name]:
                    raise self.refuse(node, f"math.{name} takes {MATH[name]} argument(s)")
                text = f"{name}({', '.join(self.number(argument).text for argument in node.args)})"
                # Python's floor is an int, which has no negative zero.
                if name == "floor":
                    return Value(f"{text} + 0.0", 5, WHOLE)
                return Value(text, ATOM, FLOAT)
            case ast.Name(id="float") if len(node.args) == 1:
                return Value(f"(double){self.number(node.args[0]).bound(UNARY)}", UNARY, FLOAT)
            case ast.Name(id="int") if len(node.args) == 1:
                operand = self.number(node.args[0])
                if operand.kind == INT:
                    return operand
                return Value(f"whole({operand.text})", ATOM, INT)
            case ast.Name(id=name) if name in self.kernels:
                arguments = ", ".join(self._arguments(node, self.kernels[name]))
                return Value(f"{kernel_name(name)}({arguments})", ATOM, self.kernels[name].result)
        raise self.refuse(node, "is neither a kernel nor a function of math that restricted Python has")

    def _arguments(self, node: ast.Call, kernel: Signature) -> Iterator[str]:
        if len(node.args) != len(kernel.kinds):
            raise self.refuse(node, f"{kernel.name} takes {len(kernel.kinds)} arguments")
        for argument, name, kind in zip(node.args, kernel.arguments, kernel.kinds, strict=True):
            value = self.value(argument)
            if VECTOR in (kind, value.kind):
                if kind != value.kind or not isinstance(argument, ast.Name):
                    raise self.refuse(argument, f"{kernel.name}'s {name} is a {kind}; a vector is passed by its name")
            elif value.kind == NOTHING or (kind == INT and value.kind != INT):
                raise self.refuse(argument, f"{kernel.name}'s {name} is a {kind}")
            yield value.text

    def condition(self, node: ast.expr) -> str:
        """Return the condition of `if` and `while` in C."""
        match node:
            case ast.BoolOp(op=op, values=values):
                texts = [f"({self.condition(v)})" if isinstance(v, ast.BoolOp) else self.condition(v) for v in values]
                return (" && " if isinstance(op, ast.And) else " || ").join(texts)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"!({self.condition(operand)})"
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARISONS:
                return f"{self.number(left).text} {COMPARISONS[type(op)]} {self.number(right).text}"
        raise self.refuse(node, "a condition is made of single comparisons of numbers, and, or, not")

    def check_order(self, nodes: list[ast.expr]) -> None:
        """Refuse expressions of one statement whose value depends on which is taken first: C leaves that open."""
        calls: list[ast.Call] = []
        for node in nodes:
            calls += [n for n in ast.walk(node) if isinstance(n, ast.Call) and self.changed(n)]
        if not calls:
            return
        if len(calls) > 1:
            raise self.refuse(calls[1], "a second call that changes a vector in one statement: give it its own")
        inside = set(ast.walk(calls[0]))
        for node in nodes:
            for inner in ast.walk(node):
                if isinstance(inner, ast.Name) and inner.id in self.changed(calls[0]) and inner not in inside:
                    raise self.refuse(calls[0], f"changes {inner.id}, which the same statement reads")

    def changed(self, node: ast.Call) -> set[str]:
        """Names of the vectors that a call writes into."""
        if not (isinstance(node.func, ast.Name) and node.func.id in self.kernels):
            return set()
        kernel = self.kernels[node.func.id]
        pairs = zip(node.args, kernel.arguments, strict=True)
        return {a.id for a, name in pairs if name in kernel.changed and isinstance(a, ast.Name)}


TYPES = {FLOAT: "double", INT: "int64_t", WHOLE: "double", NOTHING: "void"}
WIDTH = 110

HEAD = """#include <math.h>
#include <stdint.h>
"""

PI = "static const double MATH_PI = 3.141592653589793;\n"

WHOLE_NUMBER = """/* int() of Python; what does not fit is the nearest that does, not undefined. */
static int64_t whole(double x)
{
    if (x >= 9223372036854775807.0) {
        return INT64_MAX;
    }
    if (!(x > -9223372036854775808.0)) {
        return INT64_MIN;
    }
    return (int64_t)x;
}
"""


def translate(parts: Sequence[SourcePart]) -> tuple[str, dict[str, Signature]]:
    """Translate constants and kernels, each before its use.

    Parameters
    ----------
    parts : sequence of Part
        as `flat_parts` gives them

    Returns
    -------
    str
        C99 source of static functions ``kernel_<name>``
    dict
        kernel's name to its signature

    Raises
    ------
    RestrictionError
        names file, line and construct that is not in restricted Python
    """
    constants: dict[str, str] = {}
    kernels: dict[str, Signature] = {}
    texts: list[str] = []
    for part in parts:
        scope = Scope(constants, kernels, part.origin, part.first_line)
        for node in ast.parse(part.text).body:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    text, _, constants[name] = scope.value(value)
                    texts.append(f"static const {TYPES[constants[name]]} {constant_name(name)} = {text};\n")
                case ast.FunctionDef():
                    function = _Function(node, scope)
                    texts.append(function.text())
                    kernels[node.name] = function.signature
                case _:
                    raise scope.refuse(node, "is neither a kernel nor a constant")
    body = "\n".join(texts)
    needed = [text for sign, text in (("MATH_PI", PI), ("whole(", WHOLE_NUMBER)) if sign in body]
    return "\n".join([HEAD, *needed, body]), kernels


class _Function:
    """One kernel on its way to C: its variables are found while its statements are written."""

    def __init__(self, node: ast.FunctionDef, scope: Scope) -> None:
        self.node, self.scope = node, scope
        arguments = node.args
        if arguments.vararg or arguments.kwarg or arguments.kwonlyargs or arguments.defaults or arguments.posonlyargs:
            raise scope.refuse(node, "arguments are plain names without default values")
        kinds = []
        for argument in arguments.args:
            kind = ast.unparse(argument.annotation) if argument.annotation else ""
            if kind not in (FLOAT, INT, VECTOR):
                raise scope.refuse(argument, "an argument is annotated as float, int or Vector")
            kinds.append(kind)
            scope.variables[argument.arg] = kind
        self.result = ast.unparse(node.returns) if node.returns else ""
        if self.result not in (FLOAT, INT, NOTHING):
            raise scope.refuse(node, "a kernel returns float, int or None, and says so")
        self.locals: list[str] = []
        self.counters: list[str] = []
        self.changed: set[str] = set()
        self.lines: list[str] = []
        self._body(node.body, 1)
        if self.result != NOTHING and not _returns(node.body):
            raise scope.refuse(node, "does not return on every way through it")
        names = tuple(a.arg for a in arguments.args)
        self.signature = Signature(node.name, names, tuple(kinds), self.result, frozenset(self.changed))

    def text(self) -> str:
        """The function in C."""
        declared = []
        for name, kind in zip(self.signature.arguments, self.signature.kinds, strict=True):
            if kind == VECTOR:
                declared.append(f"{'' if name in self.changed else 'const '}double *{variable_name(name)}")
            else:
                declared.append(f"{TYPES[kind]} {variable_name(name)}")
        head = f"static inline {TYPES[self.result]} {kernel_name(self.node.name)}({', '.join(declared) or 'void'})"
        lines = _wrapped(head, 0)
        summary = (ast.get_docstring(self.node) or "").partition("\n\n")[0]
        if summary:
            comment = " ".join(summary.split()).replace("*/", "* /")
            lines = textwrap.wrap(f"/* {comment} */", WIDTH, subsequent_indent="   ") + lines
        lines.append("{")
        for name in self.locals:
            zero = "0" if self.scope.variables[name] == INT else "0.0"
            lines.append(f"    {TYPES[self.scope.variables[name]]} {variable_name(name)} = {zero};")
        names_read = {n.id for n in ast.walk(self.node) if isinstance(n, ast.Name)}
        lines += [f"    (void){variable_name(name)};" for name in self.signature.arguments if name not in names_read]
        return "\n".join([*lines, *self.lines, "}", ""])

    def _say(self, text: str, depth: int) -> None:
        self.lines += _wrapped(text, depth)

    def _body(self, statements: Sequence[ast.stmt], depth: int) -> None:
        for statement in statements:
            self._statement(statement, depth)

    def _statement(self, node: ast.stmt, depth: int) -> None:
        scope = self.scope
        match node:
            case ast.Pass() | ast.Expr(value=ast.Constant(value=str())):
                pass
            case ast.Expr(value=ast.Call() as call):
                text = scope.call(call).text
                self._check(call.args, call)
                self._say(f"{text};", depth)
            case ast.Assign(targets=[target], value=value):
                self._assign(node, target, value, depth)
            case ast.If():
                self._if(node, depth, "if")
            case ast.While(test=test, body=body, orelse=[]):
                self._say(f"while ({self._test(test)}) {{", depth)
                self._body(body, depth + 1)
                self._say("}", depth)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range")), orelse=[]):
                self._for(node, name, depth)
            case ast.Return(value=None) if self.result == NOTHING:
                self._say("return;", depth)
            case ast.Return(value=ast.expr() as value) if self.result != NOTHING:
                text, _, kind = scope.number(value)
                if self.result == INT and kind != INT:
                    raise scope.refuse(node, "the kernel returns int")
                self._check([value], value)
                self._say(f"return {text};", depth)
            case _:
                raise scope.refuse(node, f"statement {type(node).__name__} of this form is not in restricted Python")

    def _test(self, test: ast.expr) -> str:
        text = self.scope.condition(test)
        self._check([test], test)
        return text

    def _check(self, nodes: list[ast.expr], value: ast.expr) -> None:
        """Refuse a statement whose order C leaves open; note the vectors that its calls change."""
        self.scope.check_order(nodes)
        for node in ast.walk(value):
            if isinstance(node, ast.Call):
                self.changed |= self.scope.changed(node)

    def _if(self, node: ast.If, depth: int, word: str) -> None:
        self._say(f"{word} ({self._test(node.test)}) {{", depth)
        self._body(node.body, depth + 1)
        match node.orelse:
            case []:
                self._say("}", depth)
            case [ast.If() as other]:
                self._if(other, depth, "} else if")
            case _:
                self._say("} else {", depth)
                self._body(node.orelse, depth + 1)
                self._say("}", depth)

    def _assign(self, node: ast.Assign, target: ast.expr, value: ast.expr, depth: int) -> None:
        scope = self.scope
        text, _, kind = scope.number(value)
        self._check([value, target], value)
        match target:
            case ast.Subscript(value=ast.Name(id=name)):
                self.changed.add(name)
            case ast.Name(id=name):
                if name in self.counters:
                    raise scope.refuse(node, f"{name} counts a loop: it is not assigned to")
                if name not in scope.variables:
                    scope.variables[name] = kind
                    self.locals.append(name)
                elif scope.variables[name] != kind and {scope.variables[name], kind} != {FLOAT, WHOLE}:
                    raise scope.refuse(node, f"{name} is a {scope.variables[name]} and becomes a {kind}")
                elif scope.variables[name] != kind:
                    raise scope.refuse(node, f"{name} is a float and a floor's whole number: add 0.0 to the floor")
            case _:
                raise scope.refuse(node, "one name or one element is assigned to")
        self._say(f"{scope.value(target).text} = {text};", depth)

    def _for(self, node: ast.For, name: str, depth: int) -> None:
        scope = self.scope
        call = node.iter
        assert isinstance(call, ast.Call)
        if call.keywords or len(call.args) not in (1, 2):
            raise scope.refuse(call, "a range has an end, or a start and an end")
        if name in scope.variables or name in scope.constants:
            raise scope.refuse(node, f"{name} counts this loop only: it may have no other value")
        ends = [scope.value(bound) for bound in call.args]
        if any(end.kind != INT for end in ends):
            raise scope.refuse(call, "the ends of a range are whole numbers")
        scope.check_order(call.args)
        assigned = {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
        for bound in (n for argument in call.args for n in ast.walk(argument)):
            if isinstance(bound, ast.Name) and bound.id in assigned:
                raise scope.refuse(call, f"the loop changes {bound.id}, an end of its own range")
            if isinstance(bound, ast.Call):
                raise scope.refuse(call, "the ends of a range call nothing: give them a name")
            if isinstance(bound, ast.Subscript):
                raise scope.refuse(call, "the ends of a range are no elements: give them a name")
        first = ends[0].text if len(ends) == 2 else "0"
        counter = variable_name(name)
        self._say(f"for (int64_t {counter} = {first}; {counter} < {ends[-1].text}; {counter}++) {{", depth)
        scope.variables[name] = INT
        self.counters.append(name)
        self._body(node.body, depth + 1)
        self.counters.remove(name)
        del scope.variables[name]
        self._say("}", depth)


def _returns(body: Sequence[ast.stmt]) -> bool:
    """Return True if every way through these statements ends with a return."""
    last = body[-1]
    if isinstance(last, ast.If):
        return bool(last.orelse) and _returns(last.body) and _returns(last.orelse)
    return isinstance(last, ast.Return)


def _wrapped(text: str, depth: int) -> list[str]:
    indent = "    " * depth
    # A pointer's star stays with its name.
    joined = text.replace(" *", "\0*")
    lines = textwrap.wrap(
        joined, WIDTH, initial_indent=indent, subsequent_indent=indent + "    ", break_long_words=False
    )
    return [line.replace("\0*", " *") for line in lines]
