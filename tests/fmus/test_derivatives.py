"""Directional derivatives of native FMUs against differences of the FMU's own outputs, and against formulas."""

import ctypes as ct
import random
import zipfile
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from component_kinds import all_kinds, draw_inputs, draw_parameters, title
from native_driver import ERROR, OK
from native_model import Model, numbering, open_fmu
from trihedron.fmus import build, components, host_compiler
from trihedron.fmus.component import Component, Variable, extend

pytestmark = pytest.mark.skipif(host_compiler() is None, reason="skipped: no C compiler")

START = 0.3
ROTATION = [2 / 3, -1 / 3, 2 / 3, 2 / 3, 2 / 3, -1 / 3, -1 / 3, 2 / 3, 2 / 3]
STENCIL = {1: 2 / 3, 2: -1 / 12}


class Subject:
    """An instance in its initialisation; every real input and parameter has a value of its own."""

    def __init__(self, component: Component, fmi: int, folder) -> None:
        self.component = component
        path = build(component.name, folder, component.effects, flavour="native", fmi=fmi)
        self.model = Model.of(open_fmu(path, folder / "unpacked"), component)
        self.library = self.model.library
        rng = random.Random(title(component))
        elements = draw_parameters(component, rng) | draw_inputs(component, rng)
        self.values: dict[str, list[Any]] = {}
        for v in component.interface:
            if v.causality != "output":
                starts = dict(zip(v.elements, v.starts, strict=True))
                self.values[v.name] = [elements.get(element, start) for element, start in starts.items()]
        if component.name == "TurntableMotion":
            self.values |= {"mounting": ROTATION, "encoder_fluctuation_bound": [0.01]}
        for name in self.values:
            assert self.put(name) == OK, self.library.log
        assert self.library.enter(self.model.instance, START) == OK

    def put(self, name: str) -> int:
        return self.model.set(name, self.values[name])

    def derivative(self, outputs: list[Variable], cause: Variable, seed: list[float]) -> tuple[int, list[float]]:
        numbers = numbering(self.component, self.library.fmi)
        unknowns: list[int] = []
        for v in outputs:
            unknowns += numbers[v.name]
        count = sum(len(v.elements) for v in outputs)
        at, of = (ct.c_uint * len(unknowns))(*unknowns), numbers[cause.name]
        values, along = (ct.c_double * count)(), (ct.c_double * len(seed))(*seed)
        sizes = [[], []] if self.library.fmi == 2 else [[ct.c_size_t(len(seed))], [ct.c_size_t(count)]]
        knowns = ((ct.c_uint * len(of))(*of), ct.c_size_t(len(of)))
        seeds = (at, ct.c_size_t(len(unknowns)), *knowns, along, *sizes[0], values, *sizes[1])
        return self.library.call("GetDirectionalDerivative", self.model.instance, *seeds), list(values)

    def difference(self, outputs: list[Variable], cause: Variable, element: int, h: float) -> np.ndarray:
        """Return the derivative by the five-point rule."""
        state, total = list(self.values[cause.name]), np.zeros(sum(len(v.elements) for v in outputs))
        for steps, weight in STENCIL.items():
            ends = []
            for side in (steps * h, -steps * h):
                self.values[cause.name] = [x + side * (i == element) for i, x in enumerate(state)]
                assert self.put(cause.name) == OK, self.library.log
                ends.append(np.concatenate([self.model.get(v) for v in outputs]))
            total += weight / h * (ends[0] - ends[1])
        self.values[cause.name] = state
        assert self.put(cause.name) == OK
        return total

    def compare(self, knowns: list[Variable]) -> dict[tuple[str, str], float]:
        """Return the largest derivative of each output by each known; assert that all agree with the differences."""
        outputs = [v for v in self.component.interface if v.causality == "output" and v.type == "real"]
        largest: dict[tuple[str, str], float] = {}
        for cause in knowns:
            for k in range(len(cause.elements)):
                seed = [float(i == k) for i in range(len(cause.elements))]
                before = self.model.outputs()
                status, exact = self.derivative(outputs, cause, seed)
                assert status == OK, self.library.log
                assert self.model.outputs() == before
                # A mounting is checked to 1e-6.
                near = self.difference(outputs, cause, k, 1e-7 if cause.name == "mounting" else 1e-5)
                scale = 1.0 + np.abs(near)
                assert np.all(np.abs(near - exact) <= (1e-6 if cause.name == "mounting" else 1e-8) * scale), cause.name
                every = iter(exact)
                for v in outputs:
                    size = max(abs(next(every)) for _ in v.elements)
                    largest[v.name, cause.name] = max(size, largest.get((v.name, cause.name), 0.0))
        return largest


def dependencies(component: Component, path) -> dict[str, set[str]]:
    """Return, by ModelStructure, the inputs that each output follows at once."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    variables = root.find("ModelVariables")
    structure = root.find("ModelStructure/Outputs") or root.find("ModelStructure")
    assert variables is not None
    assert structure is not None
    if root.get("fmiVersion") == "2.0":
        names = {str(i): str(v.get("name")).partition("[")[0] for i, v in enumerate(variables, start=1)}
        listed = [(e.get("index"), e.get("dependencies")) for e in structure]
    else:
        names = {str(v.get("valueReference")): str(v.get("name")) for v in variables}
        listed = [(e.get("valueReference"), e.get("dependencies")) for e in structure if e.tag == "Output"]
    causes: dict[str, set[str]] = {}
    for at, on in listed:
        causes[names[str(at)]] = {names[number] for number in str(on).split()}
    return causes


def kinds() -> list[Component]:
    """Return every component with derivatives, and the extended ones without rounding effects."""
    selected = []
    for component in all_kinds():
        smooth = tuple(place for place in component.effects if not place.definition.rounds)
        kind = component if smooth == component.effects else extend(components()[component.name], smooth)
        selected += [kind] if kind.derivatives else []
    return selected


@pytest.mark.first(14)
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("component", kinds(), ids=title)
def test_derivatives_are_those_of_the_outputs(component, fmi, tmp_path):
    subject = Subject(component, fmi, tmp_path)
    real = [v for v in component.interface if v.causality != "output" and v.type == "real"]
    subject.compare(real)
    library, instance = subject.library, subject.model.instance
    assert library.leave(instance) == OK, library.log
    for k in range(2):
        assert library.step(instance, START + 0.02 * k, 0.02) == OK, library.log
    inputs = [v for v in real if v.causality == "input"]
    largest = subject.compare(inputs)
    follows = dependencies(component, tmp_path / f"{component.name}.fmu")
    for (name, cause), size in largest.items():
        assert size == 0.0 or cause in follows[name]


@pytest.mark.first(1)
@pytest.mark.parametrize("fmi", [2, 3])
def test_what_is_rounded_or_comes_in_steps_has_no_derivatives(fmi, tmp_path):
    rounded = [c for c in all_kinds() if not c.derivatives]
    assert {title(c) for c in rounded} >= {"AttitudeComputer", "AccelerometerBlock extended"}
    for component in rounded:
        subject = Subject(component, fmi, tmp_path / title(component).replace(" ", "-"))
        outputs = [v for v in component.interface if v.causality == "output" and v.type == "real"]
        cause = next(v for v in component.interface if v.causality != "output" and v.type == "real")
        status, _ = subject.derivative(outputs, cause, [0.0] * len(cause.elements))
        assert status == ERROR
        assert "does not provide" in subject.library.log[-1][2]


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_block_has_the_scale_factor_of_the_sign_also_at_zero(fmi, tmp_path):
    """The reading's derivative is I + Γ, with Γ⁺ for positive inputs and Γ⁻ for the others, zero among them."""
    component = components()["AccelerometerBlock"]
    subject = Subject(component, fmi, tmp_path)
    assert subject.library.leave(subject.model.instance) == OK
    subject.values["specific_force"] = [3.0, -2.0, 0.0]
    assert subject.put("specific_force") == OK
    cause = next(v for v in component.interface if v.name == "specific_force")
    reading = [v for v in component.interface if v.name == "reading"]
    plus, minus = subject.values["scale_error_plus"], subject.values["scale_error_minus"]
    gamma = np.diag([plus[0], minus[1], minus[2]])
    for i, j in ((2, 1), (3, 1), (1, 2), (3, 2), (1, 3), (2, 3)):
        gamma[i - 1, j - 1] = subject.values[f"gamma_{i}{j}"][0]
    seed = [0.3, -0.7, 1.1]
    status, values = subject.derivative(reading, cause, seed)
    assert status == OK
    assert values == pytest.approx((np.eye(3) + gamma) @ seed, rel=4e-16, abs=1e-16)


@pytest.mark.parametrize("fmi", [2, 3])
def test_derivatives_of_other_things_are_refused(fmi, tmp_path):
    component = components()["AccelerometerCompensation"]
    subject = Subject(component, fmi, tmp_path)
    cause = next(v for v in component.interface if v.name == "reading")
    instance = next(v for v in component.interface if v.name == "specific_force")
    for outputs, of in (([cause], cause), ([instance], instance)):
        status, _ = subject.derivative(outputs, of, [1.0] * 3)
        assert status == ERROR
        assert "GetDirectionalDerivative: a" in subject.library.log[-1][2]
