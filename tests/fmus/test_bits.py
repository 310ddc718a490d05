"""Every flavour computes the bits of plain Python: native FMUs of both versions, the PythonFMU flavour, numba."""

import random
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from component_kinds import all_kinds, draw_inputs, draw_parameters, outputs_of, setter_of, title
from named import Named
from native_driver import OK
from native_model import Model, numbering, open_fmu
from trihedron.fmus import build, host_compiler
from trihedron.fmus.component import Component
from trihedron.fmus.source import Instance, flat_source, instance_rows, instantiate

needs_compiler = pytest.mark.skipif(host_compiler() is None, reason="skipped: no C compiler")

STEPS, MANY_STEPS = 300, 10_000


class Compiled(Instance):
    """An instance whose kernels numba has compiled: its memory is arrays."""

    def __init__(self, component: Component) -> None:
        namespace: dict[str, Any] = {}
        exec("import math\nVector = None\n" + flat_source(component), namespace)
        plain = {name: f for name, f in namespace.items() if callable(f) and hasattr(f, "__code__")}
        for name, function in plain.items():
            namespace[name] = numba.njit(fastmath=False)(function)
        kernels = {name: namespace[name] for name in component.kernels}
        super().__init__(instance_rows(component), kernels, component.arguments, component.effect_count)
        arrays = {name: np.array(values, dtype=float) for name, values in self.memory.items()}
        cells: Any = [(arrays[self._owner(values)], i) for values, i in self.cells]
        memory: Any = arrays
        self.cells, self.memory = cells, memory

    def _owner(self, values: list[float]) -> str:
        return next(name for name, memory in self.memory.items() if memory is values)


def by_variable(component: Component, elements: dict[str, float]) -> dict[str, list[float]]:
    """Return values of whole variables from those of elements; a variable needs all its elements."""
    values: dict[str, list[float]] = {}
    for v in component.interface:
        if set(v.elements) <= elements.keys():
            values[v.name] = [elements[element] for element in v.elements]
    return values


def plan(component: Component, steps: int) -> tuple[dict[str, float], list[dict[str, float]], list[float]]:
    """Draw parameters, inputs for each step, and lengths of steps."""
    rng = random.Random(f"{component.name} {len(component.effects)}")
    parameters = draw_parameters(component, rng)
    inputs = draw_inputs(component, rng)
    every = []
    for k in range(steps):
        if k % 25 == 0 or "increment" in {v.name for v in component.interface if v.causality == "input"}:
            inputs = draw_inputs(component, rng)
        every.append(inputs)
    return parameters, every, [0.02] * steps


def run_instance(model: Instance, component: Component, steps: int) -> list[list[float]]:
    instance = Named(component, None, model)
    parameters, inputs, lengths = plan(component, steps)
    instance.put(**parameters).begin()
    outputs = [instance.outputs()]
    for k in range(steps):
        outputs.append(instance.put(**inputs[k]).step(k * lengths[k], lengths[k]).outputs())
    return outputs


def run_native(component: Component, folder: Path, steps: int, fmi: int) -> list[list[float]]:
    path = build(component.name, folder, component.effects, flavour="native", fmi=fmi)
    library = open_fmu(path, folder / f"unpacked-{fmi}")
    model = Model.of(library, component)
    parameters, inputs, lengths = plan(component, steps)
    assert library.enter(model.instance) == OK
    for name, values in by_variable(component, parameters).items():
        assert model.set(name, values) == OK, library.log
    assert library.leave(model.instance) == OK, library.log
    outputs = [model.outputs()]
    for k in range(steps):
        for name, values in by_variable(component, inputs[k]).items():
            assert model.set(name, values) == OK
        assert library.step(model.instance, k * lengths[k], lengths[k]) == OK, library.log
        outputs.append(model.outputs())
    library.free(model.instance)
    assert library.log == []
    return outputs


def run_python_fmu(component: Component, folder: Path, steps: int, slaves: Any) -> list[list[float]]:
    slave = slaves(build(component.name, folder / "python", component.effects))
    parameters, inputs, lengths = plan(component, steps)
    set_values = setter_of(slave, component)
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    set_values(parameters)
    slave.exitInitializationMode()
    outputs = [outputs_of(slave, component)]
    for k in range(steps):
        set_values(inputs[k])
        slave.doStep(k * lengths[k], lengths[k])
        outputs.append(outputs_of(slave, component))
    return outputs


def same_bits(first: list[list[float]], second: list[list[float]]) -> bool:
    return np.array(first).tobytes() == np.array(second).tobytes()


@pytest.mark.first(1)
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_the_python_flavour_gives_the_bits_of_plain_python(component, tmp_path, slaves):
    plain = run_instance(instantiate(component), component, STEPS)
    assert same_bits(run_python_fmu(component, tmp_path, STEPS, slaves), plain)


@pytest.mark.first(1)
@needs_compiler
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_native_fmus_give_the_bits_of_plain_python(component, tmp_path):
    """Test one version each: the machine code comes from the same C, and `make acceptance` runs every kind in both."""
    plain = run_instance(instantiate(component), component, STEPS)
    assert same_bits(run_native(component, tmp_path, STEPS, 3 if component.effects else 2), plain)


@needs_compiler
@pytest.mark.acceptance
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_the_same_bits_from_all_five_over_ten_thousand_steps(component, tmp_path, slaves):
    plain = run_instance(instantiate(component), component, MANY_STEPS)
    assert same_bits(run_native(component, tmp_path, MANY_STEPS, 2), plain)
    assert same_bits(run_native(component, tmp_path, MANY_STEPS, 3), plain)
    assert same_bits(run_instance(Compiled(component), component, MANY_STEPS), plain)
    assert same_bits(run_python_fmu(component, tmp_path, MANY_STEPS, slaves), plain)


@pytest.mark.acceptance
@needs_compiler
def test_value_references_are_those_of_the_model_description(tmp_path, monkeypatch):
    import fmpy

    monkeypatch.setattr("trihedron.fmus.native.c_source.binary", lambda *_, **__: b"")
    for component in all_kinds():
        fmi = 3 if component.effects else 2
        path = build(component.name, tmp_path / f"{fmi}", component.effects, flavour="native", fmi=fmi)
        described = {v.name: int(v.valueReference) for v in fmpy.read_model_description(path).modelVariables}
        for name, numbers in numbering(component, fmi).items():
            first = name if name in described else f"{name}[1]"
            assert described[first] == numbers[0]
