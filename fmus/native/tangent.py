"""Derivatives of kernels: forward differentiation of restricted Python into restricted Python.

The tangent of a kernel computes the same values as the kernel, the same bits, and carries a derivative along. Beside
every float and every vector ``x`` goes ``x_dot``, its derivative along a direction. Each statement is differentiated by
the rules of calculus, so the derivative is exact to rounding. Where a function has none, the derivative of the branch
taken is used. A root, a size and an angle of zero count as flat; so do the results of `floor` and `int`.
"""

import ast
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from ..source import SourcePart
from .translate import FLOAT, INT, RestrictionError

SLOPE = "slope"
"""Argument of every tangent (1,): a kernel that returns a float leaves the derivative of it there."""

RULES = '''
def slope_of_root(x: float) -> float:
    """Derivative of the root; flat at zero, as a length is that stays zero."""
    if x > 0.0:
        return 0.5 / math.sqrt(x)
    return 0.0


def slope_of_size(x: float) -> float:
    """Derivative of the absolute value; flat at zero."""
    if x > 0.0:
        return 1.0
    if x < 0.0:
        return -1.0
    return 0.0


def slope_of_angle(y: float, y_dot: float, x: float, x_dot: float) -> float:
    """Derivative of atan2(y, x); flat at the origin."""
    square = x * x + y * y
    if square > 0.0:
        return (x * y_dot - y * x_dot) / square
    return 0.0
'''


def tangent_name(kernel: str) -> str:
    """Return the name of the tangent of a kernel."""
    return f"tangent_{kernel}"


def tangents(parts: Sequence[SourcePart], kernel_names: Sequence[str]) -> list[SourcePart]:
    """Return the tangents of kernels and of the kernels that they call, each before its use.

    Parameters
    ----------
    parts : sequence of Part
        a flat source
    wanted : sequence of str
        names of kernels in it

    Raises
    ------
    RestrictionError
        a call in a place that may be passed over, or code that is not restricted Python
    """
    kernels: dict[str, ast.FunctionDef] = {}
    origins: dict[str, SourcePart] = {}
    for part in parts:
        for node in ast.parse(part.text).body:
            if isinstance(node, ast.FunctionDef):
                kernels[node.name], origins[node.name] = node, part
    texts: dict[str, str] = {}
    open_ = list(kernel_names)
    while open_:
        name = open_.pop()
        if name not in texts:
            tangent = _Tangent(kernels, name, origins[name])
            texts[name] = tangent.text()
            open_ += tangent.called
    tangent_parts = [SourcePart(RULES, "tangent.py", 1)]
    tangent_parts += [replace(origins[name], text=texts[name]) for name in kernels if name in texts]
    return tangent_parts


def _kinds(node: ast.FunctionDef) -> list[str]:
    kinds = []
    for argument in node.args.args:
        kinds.append(ast.unparse(argument.annotation) if argument.annotation else "")
    return kinds


Pair = tuple[ast.expr, ast.expr | None]
"""A value and its derivative, None where that is zero whatever happens."""

ZERO = ast.Constant(0.0)


def _name(text: str) -> ast.Name:
    return ast.Name(text, ast.Load())


def _sum(a: ast.expr | None, b: ast.expr | None) -> ast.expr | None:
    if a is None or b is None:
        return a or b
    return ast.BinOp(a, ast.Add(), b)


def _times(a: ast.expr, b: ast.expr | None) -> ast.expr | None:
    if b is None:
        return None
    return ast.BinOp(a, ast.Mult(), b)


def _difference(a: ast.expr | None, b: ast.expr | None) -> ast.expr | None:
    if b is None:
        return a
    return ast.BinOp(a or ZERO, ast.Sub(), b)


def _called(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(_name(name), list(arguments), [])


def _of_math(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Attribute(_name("math"), name, ast.Load()), list(arguments), [])


class _Read(ast.NodeTransformer):
    """Leaves out derivatives of variables that nothing reads: those of what only decides."""

    def __init__(self, body: Sequence[ast.stmt]) -> None:
        nodes = list(ast.walk(ast.Module(list(body), [])))
        written = {id(node.targets[0]) for node in nodes if isinstance(node, ast.Assign)}
        self.read = {node.id for node in nodes if isinstance(node, ast.Name) and id(node) not in written}

    def visit_Assign(self, node: ast.Assign) -> ast.Assign | None:
        target = node.targets[0]
        is_read = not isinstance(target, ast.Name) or target.id in self.read or not target.id.endswith("_dot")
        if is_read:
            return node
        return None


@dataclass
class _Tangent:
    """A kernel on its way to its tangent."""

    kernels: dict[str, ast.FunctionDef]
    name: str
    part: SourcePart
    # Local variables that have a derivative, found by going through the kernel until there are no more.
    moving: set[str] = field(default_factory=set)
    called: set[str] = field(default_factory=set)
    count: int = 0
    out: list[ast.stmt] = field(default_factory=list)

    def refuse(self, node: ast.AST, reason: str) -> RestrictionError:
        line = self.part.first_line + getattr(node, "lineno", 1) - 1
        return RestrictionError(f"{self.part.origin}, line {line}: '{ast.unparse(node)}': {reason}")

    def text(self) -> str:
        """Source of the tangent."""
        node = self.kernels[self.name]
        names, kinds = [a.arg for a in node.args.args], _kinds(node)
        self.moving = {name for name, kind in zip(names, kinds, strict=True) if kind != INT}
        self.returns = ast.unparse(node.returns) if node.returns else ""
        count_before = -1
        while count_before < len(self.moving):
            count_before, self.count = len(self.moving), 0
            body = self.body(node.body)
        arguments: list[str] = []
        for name, kind in zip(names, kinds, strict=True):
            arguments.append(f"{name}: {kind}")
            if kind != INT:
                arguments.append(f"{name}_dot: {kind}")
        arguments.append(f"{SLOPE}: Vector")
        docstring = f'    """Tangent of {self.name}."""'
        head = f"def {tangent_name(self.name)}({', '.join(arguments)}) -> {self.returns}:"
        module, lines, count_before = ast.fix_missing_locations(ast.Module(body or [ast.Pass()], [])), [""], -1
        # What nothing reads may have been all that read another.
        while count_before != len(lines):
            count_before = len(lines)
            module = _Read(module.body).visit(module)
            lines = ast.unparse(module).splitlines()
        body_lines = "".join(f"    {line}\n" for line in lines)
        return f"{head}\n{docstring}\n{body_lines}"

    def body(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Statements with those that carry the derivatives along."""
        outer, self.out = self.out, []
        for statement in statements:
            self.statement(statement)
        inner_statements, self.out = self.out, outer
        return inner_statements

    def statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(value=ast.Call() as call):
                self.out.append(ast.Expr(self.tangent_call(call)))
            case ast.Expr() | ast.Pass():
                pass
            case ast.Assign(targets=[target], value=value):
                self.assign(target, value)
            case ast.If(test=test, body=body, orelse=orelse):
                self.plain(test)
                self.out.append(ast.If(test, self.body(body) or [ast.Pass()], self.body(orelse)))
            case ast.While(test=test, body=body):
                self.plain(test)
                self.out.append(ast.While(test, self.body(body), []))
            case ast.For(target=target, iter=each, body=body):
                self.out.append(ast.For(target, each, self.body(body) or [ast.Pass()], []))
            case ast.Return(value=None):
                self.out.append(node)
            case ast.Return(value=ast.expr() as value):
                primal, dot = self.pair(value)
                if self.returns == FLOAT:
                    self.out.append(ast.Assign([ast.Subscript(_name(SLOPE), ast.Constant(0))], dot or ZERO))
                self.out.append(ast.Return(primal))
            case _:
                raise self.refuse(node, "has no tangent")

    def assign(self, target: ast.expr, value: ast.expr) -> None:
        primal, dot = self.pair(value)
        if isinstance(target, ast.Name):
            if dot is not None:
                self.moving.add(target.id)
            if target.id in self.moving:
                self.out.append(ast.Assign([_name(f"{target.id}_dot")], dot or ZERO))
        else:
            assert isinstance(target, ast.Subscript)
            assert isinstance(target.value, ast.Name)
            place = ast.Subscript(_name(f"{target.value.id}_dot"), target.slice)
            self.out.append(ast.Assign([place], dot or ZERO))
        self.out.append(ast.Assign([target], primal))

    def plain(self, node: ast.expr) -> None:
        """Refuse a condition with side effects: the derivatives of its calls would be missing."""
        for inner in ast.walk(node):
            if isinstance(inner, ast.Call) and isinstance(inner.func, ast.Name) and self.changes(inner.func.id):
                raise self.refuse(inner, "changes a vector in a condition: give its value a name before")

    def changes(self, kernel: str) -> bool:
        """Return True if a kernel writes into a vector."""
        if kernel not in self.kernels:
            return False
        nodes = list(ast.walk(self.kernels[kernel]))
        stores = any(isinstance(n, ast.Subscript) and isinstance(n.ctx, ast.Store) for n in nodes)
        return stores or any(
            self.changes(n.func.id) for n in nodes if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)
        )

    def tangent_call(self, node: ast.Call) -> ast.Call:
        """A call of a kernel as one of its tangent."""
        if not isinstance(node.func, ast.Name) or node.func.id not in self.kernels:
            raise self.refuse(node, "has no tangent")
        self.called.add(node.func.id)
        arguments: list[ast.expr] = []
        for argument, kind in zip(node.args, _kinds(self.kernels[node.func.id]), strict=True):
            primal, dot = self.pair(argument)
            arguments.append(primal)
            if kind != INT:
                arguments.append(dot or ZERO)
        return _called(tangent_name(node.func.id), *arguments, _name(SLOPE))

    def pair(self, node: ast.expr) -> Pair:
        """An expression and its derivative; calls of kernels are done before, and named."""
        match node:
            case ast.Name(id=name):
                if name in self.moving:
                    return node, _name(f"{name}_dot")
            case ast.Subscript(value=ast.Name(id=name), slice=at):
                return node, ast.Subscript(_name(f"{name}_dot"), at)
            case ast.UnaryOp(op=op, operand=operand):
                primal, dot = self.pair(operand)
                return ast.UnaryOp(op, primal), dot and ast.UnaryOp(op, dot)
            case ast.BinOp(left=left, op=op, right=right):
                return self.operation(self.pair(left), op, self.pair(right))
            case ast.Call(func=ast.Attribute(attr=name), args=arguments):
                return self.function(name, [self.pair(argument) for argument in arguments])
            case ast.Call(func=ast.Name(id="float"), args=[argument]):
                primal, dot = self.pair(argument)
                return _called("float", primal), dot
            case ast.Call(func=ast.Name(id="int"), args=[argument]):
                return _called("int", self.pair(argument)[0]), None
            case ast.Call(func=ast.Name(id=kernel)):
                call = self.tangent_call(node)
                self.count += 1
                value = f"value_{self.count}"
                self.out.append(ast.Assign([_name(value)], call))
                if ast.unparse(self.kernels[kernel].returns or ast.Constant(None)) != FLOAT:
                    return _name(value), None
                self.out.append(ast.Assign([_name(f"{value}_dot")], ast.Subscript(_name(SLOPE), ast.Constant(0))))
                return _name(value), _name(f"{value}_dot")
        return node, None

    def operation(self, first: Pair, op: ast.operator, second: Pair) -> Pair:
        (a, da), (b, db) = first, second
        value = ast.BinOp(a, op, b)
        match op:
            case ast.Add():
                return value, _sum(da, db)
            case ast.Sub():
                return value, _difference(da, db)
            case ast.Mult():
                return value, _sum(_times(b, da), _times(a, db))
        over = _difference(da, _times(value, db))
        return value, over and ast.BinOp(over, ast.Div(), b)

    def function(self, name: str, arguments: list[Pair]) -> Pair:
        value = _of_math(name, *(a for a, _ in arguments))
        if name == "floor" or all(dot is None for _, dot in arguments):
            return value, None
        x, dot = arguments[0]
        if name == "atan2":
            y, y_dot = arguments[0]
            x, x_dot = arguments[1]
            return value, _called("slope_of_angle", y, y_dot or ZERO, x, x_dot or ZERO)
        slopes = {
            "sqrt": _called("slope_of_root", x),
            "fabs": _called("slope_of_size", x),
            "exp": value,
            "log": ast.BinOp(ast.Constant(1.0), ast.Div(), x),
            "sin": _of_math("cos", x),
            "cos": ast.UnaryOp(ast.USub(), _of_math("sin", x)),
        }
        return value, _times(slopes[name], dot)
