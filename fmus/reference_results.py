"""Reference results of a component in the layout of the FMI cross-check: what an importer should reproduce."""

import math
from pathlib import Path

from .component import Component, Variable
from .in_process import instantiate, references

STEPS = 200
MOST_OUTPUTS = 9
"""With the time, ten columns."""

SWINGS = {"rad": 0.01, "m/s2": 10.0, "degC": 5.0}
"""How far an input swings, by its unit."""


def swing(variable: Variable, element: int, step: int) -> float:
    """Value of an input's element in the step of that number: a swing about its start; whole numbers count up."""
    start = variable.starts[element]
    if variable.type != "real":
        return start + 1.0 + step // 50
    return start + SWINGS.get(variable.unit, 0.1) * math.sin(0.05 * (element + 1) * step + element)


def _inputs(component: Component, fmi: int) -> list[Variable]:
    """The inputs that are driven: in FMI 3.0 those that FMPy can, so no discrete arrays and one shape of continuous."""
    inputs = [v for v in component.interface if v.causality == "input"]
    if fmi == 2:
        return inputs
    shapes = [v.size for v in inputs if v.variability == "continuous"]
    return [v for v in inputs if (v.size == shapes[0] if v.variability == "continuous" else v.size == 0)]


def _columns(variables: list[Variable], fmi: int) -> list[tuple[str, tuple[str, ...]]]:
    """Heads of the columns with the elements that stand in each."""
    if fmi == 3:
        return [(v.name, v.elements) for v in variables]
    return [(element, (element,)) for v in variables for element in v.elements]


def _cell(variable_values: list[float]) -> str:
    return " ".join(repr(float(value)) for value in variable_values)


def write_reference(component: Component, folder: Path, fmi: int) -> list[Path]:
    """Write ``<name>_in.csv`` where there are inputs, ``<name>_ref.csv`` and ``<name>_ref.opt``, from plain Python.

    Parameters
    ----------
    component : Component
    folder : Path
    fmi : int
        2 or 3: in FMI 3.0 an array is one column whose elements are parted by blanks

    Returns
    -------
    list of Path
        the files
    """
    model, numbers = instantiate(component), references(component)
    inputs = _inputs(component, fmi)
    driven = _columns(inputs, fmi)
    shown = _columns([v for v in component.interface if v.causality == "output"], fmi)[:MOST_OUTPUTS]
    elements = {e: (v, i) for v in inputs for i, e in enumerate(v.elements)}

    def row(time: float, columns: list[tuple[str, tuple[str, ...]]]) -> str:
        cells = [_cell([float(model.get(numbers[e])) for e in every]) for _, every in columns]
        return ",".join([repr(time), *cells])

    def drive(step: int) -> None:
        for element, (variable, i) in elements.items():
            model.set(numbers[element], swing(variable, i, step))

    drive(0)
    if model.initialise(0.0) != 0:
        raise ValueError(f"{component.name} is not initialised with its start values")
    given, seen = [row(0.0, driven)], [row(0.0, shown)]
    for k in range(STEPS):
        drive(k)
        if k > 0:
            given.append(row(k * component.step_size, driven))
        if model.do_step(k * component.step_size, component.step_size) != 0:
            raise ValueError(f"{component.name} refuses the inputs of the reference results")
        seen.append(row((k + 1) * component.step_size, shown))
    options = {
        "StartTime": 0.0,
        "StopTime": STEPS * component.step_size,
        "StepSize": component.step_size,
        "RelTol": 1e-9,
    }
    files = {
        "_ref.csv": [",".join(f'"{name}"' for name in ["time", *(n for n, _ in shown)]), *seen],
        "_ref.opt": [f"{name},{value!r}" for name, value in options.items()],
    }
    if driven:
        files["_in.csv"] = [",".join(f'"{name}"' for name in ["time", *(n for n, _ in driven)]), *given]
    paths = []
    for ending, lines in sorted(files.items()):
        path = folder / f"{component.name}{ending}"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
        paths.append(path)
    return paths
