"""model.h and model.c: a component's table and kernels in C."""

import hashlib
from dataclasses import dataclass

from ..component import Component, Variable
from ..flat_source import flat_parts
from ..in_process import effect_count, limits
from .expressions import kernel_name, number_text
from .kinds import Signature
from .translation import translate

MODEL_C = """/* {description}. Made by Trihedron from the component's kernels and table. */
#include "component.h"

{kernels}
#define NONE INFINITY

const Variable variables[] = {{
{variables}
}};

const double start_values[MEMORY_SIZE] = {{
{starts}
}};

const char *const messages[] = {{
{messages}
}};
{calls}"""

MODEL_H = """/* {description}. Made by Trihedron. */
#ifndef MODEL_H
#define MODEL_H

#define FMI_VERSION {fmi}
#define MODEL_TOKEN "{token}"
#define MODEL_HASH 0x{digest}ull
#define VARIABLE_COUNT {variables}u
#define MEMORY_SIZE {memory}

#endif
"""


@dataclass(frozen=True)
class Row:
    """What a value reference stands for: a variable, an element of an array in FMI 2.0, or an effect's parameter."""

    variable: Variable
    name: str
    place: int
    size: int


def places(component: Component) -> dict[str, int]:
    """Place of each variable's first element in the memory; the parameters of effects stand together, last."""
    at, found = 0, {}
    for variable in component.variables[: len(component.variables) - effect_count(component)]:
        found[variable.name] = at
        at += max(variable.size, 1)
    found["effect"] = at
    return found


def memory_size(component: Component) -> int:
    """Numbers in the memory; without effects there is still a place to point at."""
    return places(component)["effect"] + max(effect_count(component), 1)


def rows(component: Component, fmi: int) -> list[Row]:
    """The variables that the world sees, in the order of their value references from 1 on."""
    where = places(component)
    count = effect_count(component)
    found: list[Row] = []
    for variable in component.interface[: len(component.interface) - count]:
        at = where[variable.name]
        if fmi == 3 or not variable.size:
            found.append(Row(variable, variable.name, at, max(variable.size, 1)))
        else:
            found += [Row(variable, name, at + i, 1) for i, name in enumerate(variable.elements)]
    effects = component.interface[len(component.interface) - count :] if count else ()
    return found + [Row(v, v.name, where["effect"] + i, 1) for i, v in enumerate(effects)]


def _bound(value: float | None, sign: str) -> str:
    return f"{sign}NONE" if value is None else number_text(float(value))


def _row(row: Row) -> str:
    lower, upper = limits(row.variable)
    v = row.variable
    fixed = int(v.causality == "parameter" and v.variability == "fixed")
    parts = [f'"{row.name}"', v.type.upper(), v.causality.upper(), str(fixed), str(row.place), str(row.size)]
    return f"    {{{', '.join([*parts, _bound(lower, '-'), _bound(upper, '')])}}},"


def _text(message: str) -> str:
    return '    "' + message.replace("\\", "\\\\").replace('"', '\\"') + '",'


def _starts(component: Component) -> list[float]:
    count = effect_count(component)
    own = component.variables[: len(component.variables) - count]
    effects = component.variables[len(own) :]
    values = [float(x) for v in own for x in v.starts] + [float(v.starts[0]) for v in effects]
    return values if count else [*values, 0.0]


def _calls(component: Component, kernels: dict[str, Signature]) -> str:
    """The functions by which the component's kernels work on the memory."""
    where = places(component)
    scalars = {v.name for v in component.variables if not v.size and v.causality in ("parameter", "input")}
    texts = []
    for kernel in ("initialise", "step", "respond"):
        kind = "void" if kernel == "respond" else "int64_t"
        body = ["    (void)memory;", "    (void)time;", "    (void)step;"]
        if kernel in component.kernels:
            arguments = []
            for name, wanted in zip(kernels[kernel].arguments, kernels[kernel].kinds, strict=True):
                if name in ("time", "step"):
                    arguments.append(name)
                elif name in scalars:
                    arguments.append(f"memory[{where[name]}]")
                else:
                    arguments.append(f"memory + {where[name]}")
                if (arguments[-1].startswith("memory +")) != (wanted == "Vector"):
                    raise TypeError(
                        f"kernel {kernel} of {component.name}: {name} is a {wanted} there, not in the table"
                    )
            call = f"{kernel_name(kernel)}({', '.join(arguments)});"
            body.append(f"    {call}" if kind == "void" else f"    return {call}")
        texts.append(
            f"\n{kind} model_{kernel}(double *memory, double time, double step)\n{{\n" + "\n".join(body) + "\n}\n"
        )
    return "".join(texts)


def model_c(component: Component, fmi: int) -> str:
    """Source of the table, the start values and the kernels.

    Raises
    ------
    RestrictionError
        a kernel is not in restricted Python
    """
    text, kernels = translate(flat_parts(component))
    return MODEL_C.format(
        description=component.description,
        kernels=text,
        variables="\n".join(_row(row) for row in rows(component, fmi)),
        starts="\n".join(f"    {number_text(value)}," for value in _starts(component)),
        messages="\n".join(_text(m) for m in component.messages) or '    "",',
        calls=_calls(component, kernels),
    )


def model_h(component: Component, fmi: int, token: str, source: str) -> str:
    """Sizes and identity of the model whose model.c is `source`."""
    return MODEL_H.format(
        description=component.description,
        fmi=fmi,
        token=token,
        digest=hashlib.sha256(f"state 1\n{source}".encode()).hexdigest()[:16],
        variables=len(rows(component, fmi)),
        memory=memory_size(component),
    )
