"""Kernels in restricted Python as functions in C99 that compute the same bits."""

import ast
import textwrap
from collections.abc import Sequence

from ..flat_source import Part
from .expressions import condition, constant_name, expression, kernel_name, variable_name
from .kinds import FLOAT, INT, NOTHING, VECTOR, WHOLE, Scope, Signature

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


def translate(parts: Sequence[Part]) -> tuple[str, dict[str, Signature]]:
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
        names file, line and construct of what is not in restricted Python
    """
    constants: dict[str, str] = {}
    kernels: dict[str, Signature] = {}
    texts: list[str] = []
    for part in parts:
        scope = Scope(constants, kernels, part.origin, part.first_line)
        for node in ast.parse(part.text).body:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    constants[name] = scope.kind(value)
                    kind = TYPES[constants[name]]
                    texts.append(f"static const {kind} {constant_name(name)} = {expression(value, scope)};\n")
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
        head = f"static {TYPES[self.result]} {kernel_name(self.node.name)}({', '.join(declared) or 'void'})"
        lines = _wrapped(head, 0)
        summary = (ast.get_docstring(self.node) or "").partition("\n\n")[0]
        if summary:
            comment = " ".join(summary.split()).replace("*/", "* /")
            lines = textwrap.wrap(f"/* {comment} */", WIDTH, subsequent_indent="   ") + lines
        lines.append("{")
        for name in self.locals:
            zero = "0" if self.scope.variables[name] == INT else "0.0"
            lines.append(f"    {TYPES[self.scope.variables[name]]} {variable_name(name)} = {zero};")
        used = {n.id for n in ast.walk(self.node) if isinstance(n, ast.Name)}
        lines += [f"    (void){variable_name(name)};" for name in self.signature.arguments if name not in used]
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
                scope.call(call)
                scope.check_order(call.args)
                self._note_changes(call)
                self._say(f"{expression(call, scope)};", depth)
            case ast.Assign(targets=[target], value=value):
                scope.check_order([value, target])
                self._note_changes(value)
                self._assign(node, target, value, depth)
            case ast.If():
                self._if(node, depth, "if")
            case ast.While(test=test, body=body, orelse=[]):
                self._test(test)
                self._say(f"while ({condition(test, scope)}) {{", depth)
                self._body(body, depth + 1)
                self._say("}", depth)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range")), orelse=[]):
                self._for(node, name, depth)
            case ast.Return(value=None) if self.result == NOTHING:
                self._say("return;", depth)
            case ast.Return(value=ast.expr() as value) if self.result != NOTHING:
                kind = scope.number(value)
                if self.result == INT and kind != INT:
                    raise scope.refuse(node, "the kernel returns int")
                scope.check_order([value])
                self._note_changes(value)
                self._say(f"return {expression(value, scope)};", depth)
            case _:
                raise scope.refuse(node, f"statement {type(node).__name__} of this form is not in restricted Python")

    def _test(self, test: ast.expr) -> None:
        self.scope.condition(test)
        self.scope.check_order([test])
        self._note_changes(test)

    def _if(self, node: ast.If, depth: int, word: str) -> None:
        self._test(node.test)
        self._say(f"{word} ({condition(node.test, self.scope)}) {{", depth)
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
        kind = scope.number(value)
        match target:
            case ast.Subscript(value=ast.Name(id=name)):
                scope.kind(target)
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
        self._say(f"{expression(target, scope)} = {expression(value, scope)};", depth)

    def _for(self, node: ast.For, name: str, depth: int) -> None:
        scope = self.scope
        call = node.iter
        assert isinstance(call, ast.Call)
        if call.keywords or len(call.args) not in (1, 2):
            raise scope.refuse(call, "a range has an end, or a start and an end")
        if name in scope.variables or name in scope.constants:
            raise scope.refuse(node, f"{name} counts this loop only: it may have no other value")
        if any(scope.kind(bound) != INT for bound in call.args):
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
        first = expression(call.args[0], scope) if len(call.args) == 2 else "0"
        last = expression(call.args[-1], scope)
        counter = variable_name(name)
        self._say(f"for (int64_t {counter} = {first}; {counter} < {last}; {counter}++) {{", depth)
        scope.variables[name] = INT
        self.counters.append(name)
        self._body(node.body, depth + 1)
        self.counters.remove(name)
        del scope.variables[name]
        self._say("}", depth)

    def _note_changes(self, value: ast.expr) -> None:
        for node in ast.walk(value):
            if isinstance(node, ast.Call):
                self.changed |= self.scope.changed(node)


def _returns(body: Sequence[ast.stmt]) -> bool:
    """Whether every way through these statements ends with a return."""
    last = body[-1]
    if isinstance(last, ast.If):
        return bool(last.orelse) and _returns(last.body) and _returns(last.orelse)
    return isinstance(last, ast.Return)


def _wrapped(text: str, depth: int) -> list[str]:
    indent = "    " * depth
    # A pointer's star stays with its name.
    kept = text.replace(" *", "\0*")
    lines = textwrap.wrap(kept, WIDTH, initial_indent=indent, subsequent_indent=indent + "    ", break_long_words=False)
    return [line.replace("\0*", " *") for line in lines]
