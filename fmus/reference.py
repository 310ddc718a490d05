"""Reference results of a component, from plain Python: beside an FMU for the cross-check, in it as FMI-LS-REF.

`_in.csv` has every input. In FMI 3.0 an array is one column whose elements are parted by blanks, as fmusim reads it.
Whole numbers and flags are written as such.
"""

import math
from collections.abc import Iterable
from functools import cache
from xml.etree.ElementTree import Element, SubElement

from .component import Component, Variable
from .parameters import xml_bytes
from .source import instantiate, references

STEPS = 200
MOST_OUTPUTS = 9
"""With the time, ten columns."""
SWINGS = {"rad": 0.01, "m/s2": 10.0, "degC": 5.0}
"""How far an input swings, by its unit."""

LAYER = "org.fmi-standard.fmi-ls-ref"
LAYER_VERSION = "1.0.0-alpha.1"
MANIFEST = "http://fmi-standard.org/fmi-ls-manifest"


def swing(variable: Variable, element: int, step: int) -> float:
    """Value of an input's element in the step of that number: a swing about its start; whole numbers count up."""
    start = variable.starts[element]
    if variable.type != "real":
        return start + 1.0 + step // 50
    return start + SWINGS.get(variable.unit, 0.1) * math.sin(0.05 * (element + 1) * step + element)


@cache
def reference_texts(component: Component, fmi: int) -> dict[str, str]:
    """The files by the endings of their names: ``_in.csv`` where there are inputs, ``_ref.csv`` and ``_ref.opt``.

    Raises
    ------
    ValueError
        the component refuses its start values, or the inputs
    """
    model, numbers = instantiate(component), references(component)
    inputs, outputs = ([v for v in component.interface if v.causality == c] for c in ("input", "output"))
    # What stands in each column: a variable and numbers of its elements.
    driven, output_parts = ([(v, part) for v in every for part in _parts(v, fmi)] for every in (inputs, outputs))
    output_parts = output_parts[:MOST_OUTPUTS]

    def row(time: float, columns: Iterable[tuple[Variable, range]]) -> str:
        cells = (" ".join(_cell(v, model.get(numbers[v.elements[i]])) for i in part) for v, part in columns)
        return ",".join([repr(time), *cells])

    def heads(columns: Iterable[tuple[Variable, range]]) -> str:
        names = (v.elements[part[0]] if fmi == 2 else v.name for v, part in columns)
        return ",".join(f'"{name}"' for name in ("time", *names))

    input_lines, output_lines = [heads(driven)], [heads(output_parts)]
    for k in range(STEPS):
        for variable in inputs:
            for i, element in enumerate(variable.elements):
                model.set(numbers[element], swing(variable, i, k))
        time = k * component.step_size
        if k == 0:
            if model.initialise(0.0) != 0:
                raise ValueError(f"{component.name} is not initialised with its start values")
            output_lines.append(row(0.0, output_parts))
        input_lines.append(row(time, driven))
        if model.do_step(time, component.step_size) != 0:
            raise ValueError(f"{component.name} refuses the inputs of the reference results")
        output_lines.append(row((k + 1) * component.step_size, output_parts))
    options = {"StartTime": 0.0, "StopTime": STEPS * component.step_size, "StepSize": component.step_size}
    lines = {
        "_ref.opt": [f"{name},{value!r}" for name, value in (*options.items(), ("RelTol", 1e-9))],
        "_ref.csv": output_lines,
    }
    if driven:
        lines["_in.csv"] = input_lines
    return {ending: "\n".join(every) + "\n" for ending, every in lines.items()}


def _parts(variable: Variable, fmi: int) -> list[range]:
    """Elements of a variable that share a column: in FMI 3.0 all."""
    count = len(variable.elements)
    return [range(count)] if fmi == 3 else [range(i, i + 1) for i in range(count)]


def _cell(variable: Variable, value: float) -> str:
    return repr(float(value)) if variable.type == "real" else str(int(value))


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
