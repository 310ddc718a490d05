"""One self-contained source from a component's kernels and the kernels of the effects that extend it."""

import ast
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from ..models.effects import CATALOGUE
from .component import Component


@dataclass(frozen=True)
class Part:
    """A constant or a kernel of a flat source.

    Attributes
    ----------
    text : str
        its source
    origin : str
        name of the file that it comes from
    first_line : int
        line of that file on which it begins
    """

    text: str
    origin: str
    first_line: int


def called_names(function: Callable[..., Any]) -> list[str]:
    """Names that a kernel reads and does not bind itself, in order of appearance."""
    tree = ast.parse(inspect.getsource(function))
    bound = set(inspect.signature(function).parameters)
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            if isinstance(node.ctx, ast.Store):
                bound.add(node.id)
            elif node.id not in names:
                names.append(node.id)
    return [name for name in names if name not in bound]


def hook_source(hook: Callable[..., Any], component: Component) -> str:
    """Source of a stage's hook that calls the kernels of the effects at that stage after what the nominal one does.

    Where the nominal hook zeroes what is added, what each effect adds is evaluated on the un-extended values of the
    stage and summed, so their order does not matter; where it does nothing, they change the last argument in turn. A
    hook that returns whether there are effects returns 1.0.
    """
    function = ast.parse(inspect.getsource(hook)).body[0]
    assert isinstance(function, ast.FunctionDef)
    returns = isinstance(function.body[-1], ast.Return)
    function.body = function.body[:-1] if returns else function.body
    names = [argument.arg for argument in function.args.args]
    lines = [ast.unparse(function)]
    at = 0
    for place in component.effects:
        effect = CATALOGUE[place.effect].at(place)
        count = len(effect.parameters)
        if effect.stage == hook.__name__ and effect.kernel is not None:
            numbers = [str(number) for number in effect.place_numbers(place)]
            values = [f"effect[{at + i}]" for i in range(count)]
            arguments = ", ".join([*names[:2], *numbers, *values, names[-1]])
            lines.append(f"    {effect.kernel.__name__}({arguments})")
        at += count
    if returns:
        lines.append("    return 1.0")
    return "\n".join(lines)


def flat_source(component: Component) -> str:
    """All kernels of a component, every function before its use, as one text that imports nothing but `math`.

    Parameters
    ----------
    component : Component
        with the effects that extend it

    Raises
    ------
    TypeError
        a kernel uses something that is not a kernel, a number or `math`
    """
    return "\n\n\n".join(part.text for part in flat_parts(component)) + "\n"


def flat_parts(component: Component) -> tuple[Part, ...]:
    """The parts of a component's flat source, in order; raises as `flat_source` does."""
    parts: dict[str, Part] = {}
    stages = {CATALOGUE[place.effect].stage for place in component.effects}

    def add(function: Callable[..., Any], text: str | None = None) -> None:
        lines, first = inspect.getsourcelines(function)
        origin = Path(inspect.getsourcefile(function) or "").name
        parts[function.__name__] = Part(text or "".join(lines).rstrip(), origin, first)

    def include(function: Callable[..., Any]) -> None:
        if function.__name__ in stages:
            for place in component.effects:
                effect = CATALOGUE[place.effect].at(place)
                if effect.stage == function.__name__ and effect.kernel is not None:
                    include_names(effect.kernel)
                    if effect.kernel.__name__ not in parts:
                        add(effect.kernel)
            add(function, hook_source(function, component))
            return
        include_names(function)
        add(function)

    def include_names(function: Callable[..., Any]) -> None:
        for name in called_names(function):
            if name in parts:
                continue
            value = function.__globals__.get(name)
            if isinstance(value, int | float) and not isinstance(value, bool):
                parts[name] = Part(f"{name} = {value!r}", Path(inspect.getsourcefile(function) or "").name, 1)
            elif inspect.isfunction(value):
                include(value)
            elif not (isinstance(value, ModuleType) and value.__name__ == "math") and name not in PERMITTED:
                raise TypeError(f"kernel {function.__name__} uses {name}, which is not restricted Python")

    for kernel in component.kernels.values():
        include(kernel)
    return tuple(parts.values())


PERMITTED = frozenset({"range", "int", "float", "None", "Vector"})
"""Names of Python that a kernel may use beside numbers, kernels and `math`."""
