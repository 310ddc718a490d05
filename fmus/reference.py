"""Reference results of a component, from plain Python: beside an FMU for the cross-check, in it as FMI-LS-REF.

`_in.csv` has every input. In FMI 3.0 an array is one column whose elements are parted by blanks, as fmusim reads it.
Whole numbers and flags are written as such.
"""

import math
from collections.abc import Iterable
from functools import cache
from xml.etree.ElementTree import Element, SubElement

from .component import Causality, Component, Variable
from .parameters import xml_bytes
from .source import instantiate, references

STEPS = 200
MOST_OUTPUTS = 9
"""With the time, ten columns."""
SWINGS = {"rad": 0.01, "m/s2": 10.0, "degC": 5.0}
"""Amplitude of an input, by its unit."""

LAYER = "org.fmi-standard.fmi-ls-ref"
LAYER_VERSION = "1.0.0-alpha.1"
MANIFEST = "http://fmi-standard.org/fmi-ls-manifest"


def swing(variable: Variable, element: int, step: int) -> float:
    """Value of an input's element in the step of that number: a swing about its start; whole numbers count up."""
    start = variable.starts[element]
    if variable.type != "real":
        return start + 1.0 + step // 50
    return start + SWINGS.get(variable.unit, 0.1) * math.sin(0.05 * (element + 1) * step + element)


Column = tuple[str, Variable, tuple[str, ...]]
"""Head of a column of a table, its variable, and those of the variable's elements that stand in it."""


@cache
def reference_texts(component: Component, fmi: int) -> dict[str, str]:
    """The files by the endings of their names: ``_in.csv`` where there are inputs, ``_ref.csv`` and ``_ref.opt``.

    Raises
    ------
    ValueError
        the component refuses its start values, or the inputs
    """
    model, numbers = instantiate(component), references(component)
    driven, shown = _columns(component, "input", fmi), _columns(component, "output", fmi)[:MOST_OUTPUTS]

    def row(time: float, columns: Iterable[Column]) -> str:
        line = repr(time)
        for _, variable, elements in columns:
            line += "," + " ".join(_cell(variable, model.get(numbers[element])) for element in elements)
        return line

    def heads(columns: Iterable[Column]) -> str:
        line = '"time"'
        for name, _, _ in columns:
            line += f',"{name}"'
        return line

    input_lines, output_lines = [heads(driven)], [heads(shown)]
    for k in range(STEPS):
        for variable in component.of("input"):
            for i, element in enumerate(variable.elements):
                model.set(numbers[element], swing(variable, i, k))
        time = k * component.step_size
        if k == 0:
            if model.initialise(0.0) != 0:
                raise ValueError(f"{component.name} is not initialised with its start values")
            output_lines.append(row(0.0, shown))
        input_lines.append(row(time, driven))
        if model.do_step(time, component.step_size) != 0:
            raise ValueError(f"{component.name} refuses the inputs of the reference results")
        output_lines.append(row((k + 1) * component.step_size, shown))
    step = component.step_size
    options = f"StartTime,0.0\nStopTime,{STEPS * step!r}\nStepSize,{step!r}\nRelTol,{1e-9!r}\n"
    texts = {"_ref.opt": options, "_ref.csv": "\n".join(output_lines) + "\n"}
    if driven:
        texts["_in.csv"] = "\n".join(input_lines) + "\n"
    return texts


def _columns(component: Component, causality: Causality, fmi: int) -> list[Column]:
    """The columns of a table: in FMI 3.0 one for each variable, in FMI 2.0 one for each element."""
    columns: list[Column] = []
    for variable in component.of(causality):
        if fmi == 3:
            columns.append((variable.name, variable, variable.elements))
        else:
            columns += [(element, variable, (element,)) for element in variable.elements]
    return columns


def _cell(variable: Variable, value: float) -> str:
    if variable.type == "real":
        return repr(float(value))
    return str(int(value))


def layered_reference(component: Component, fmi: int) -> dict[str, bytes]:
    """The same files inside the FMU, as the layered standard FMI-LS-REF has them; none where the component refuses."""
    try:
        texts = reference_texts(component, fmi)
    except ValueError:
        return {}
    files = {}
    root = Element(
        "fmiReferences",
        {"xmlns:fmi-ls": MANIFEST, "fmi-ls:fmi-ls-name": LAYER, "fmi-ls:fmi-ls-version": LAYER_VERSION},
    )
    description = f"{STEPS} steps of {component.step_size:g} s, from plain Python"
    for ending, name, role, what in (
        ("_in.csv", f"{component.name}_in.csv", "stimulus", "Inputs"),
        ("_ref.csv", f"{component.name}_out.csv", "result", "Outputs"),
    ):
        if ending in texts:
            SubElement(root, "Related", type="text/csv", source=name, role=role, description=f"{what} of {description}")
            files[f"extra/{LAYER}/{name}"] = texts[ending].encode()
    return files | {f"extra/{LAYER}/fmi-ls-manifest.xml": xml_bytes(root)}
