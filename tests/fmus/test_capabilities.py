"""Every capability in the model description is tried, for every component and both versions of FMI."""

import random
import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy.fmi1 import FMICallException

from component_kinds import all_kinds, draw_inputs, elements_of, outputs_of, setter_of, title
from native_driver import OK
from native_model import Model, open_fmu
from trihedron.fmus import build, components, host_compiler
from trihedron.fmus.component import Component

needs_compiler = pytest.mark.skipif(host_compiler() is None, reason="skipped: no C compiler")

TRIED = {
    "canHandleVariableCommunicationStepSize",
    # Covered by the sequences of calls in test_native_conformance, and for Python in test_components.
    *("canGetAndSetFMUstate", "canSerializeFMUstate", "canGetAndSetFMUState", "canSerializeFMUState"),
    # Covered in test_derivatives.
    *("providesDirectionalDerivative", "providesDirectionalDerivatives"),
    # The instances here have no memory functions.
    "canNotUseMemoryManagementFunctions",
}
OVER_A_STEP = ("increment", "increment_reading")
UNIT = [0.02] * 50
UNEVEN = [0.005, 0.02, 0.1, 0.0123, 0.3, 0.0027, 0.25, 0.06, 0.24, 0.01]
"""Two step sequences for a second; the last step is short."""
PROGRAMME = {"positions": [3.0], "alpha": [0.1 * i for i in range(128)], "dwell_time": [0.2] * 128, "period": [0.01]}


def claims(path: Path) -> dict[str, bool]:
    """Return the flags of the model description's co-simulation."""
    with zipfile.ZipFile(path) as archive:
        interface = ElementTree.fromstring(archive.read("modelDescription.xml")).find("CoSimulation")
    assert interface is not None
    return {name: value == "true" for name, value in interface.attrib.items() if value in ("true", "false")}


class Driven:
    """A native or Python instance with the same inputs at every step; increments scale with its length."""

    def __init__(self, component: Component, path: Path, folder: Path, slaves=None) -> None:
        self.component = component
        rng = random.Random(component.name)
        self.inputs = draw_inputs(component, rng)
        self.slave = slaves(path) if slaves else None
        self.model = None if slaves else Model.of(open_fmu(path, folder), component)
        self.put(PROGRAMME if component.name == "PositionProgramme" else self.over(0.0))
        if self.slave is not None:
            self.slave.setupExperiment(startTime=0.0)
            self.slave.enterInitializationMode()
            self.slave.exitInitializationMode()
        elif self.model is not None:
            self.model.library.start(self.model.instance)

    def put(self, values: dict[str, list[float]]) -> None:
        if self.slave is not None:
            elements: dict[str, float] = {}
            for v in self.component.interface:
                elements |= dict(zip(v.elements, values.get(v.name, ()), strict=False))
            setter_of(self.slave, self.component)(elements)
        elif self.model is not None:
            assert all(self.model.set(name, every) == OK for name, every in values.items()), self.model.library.log

    def over(self, length: float) -> dict[str, list[float]]:
        """Return the inputs of a step of this length."""
        values = {}
        for v in self.component.interface:
            if v.causality == "input":
                share = length / 0.02 if v.name in OVER_A_STEP else 1.0
                values[v.name] = [share * self.inputs[e] for e in v.elements]
        return values

    def step(self, time: float, length: float) -> bool:
        """Return True if the step was done."""
        self.put(self.over(length))
        if self.model is not None:
            return self.model.library.step(self.model.instance, time, length) == OK
        assert self.slave is not None
        try:
            self.slave.doStep(time, length)
        except FMICallException:
            return False
        return True

    def outputs(self) -> dict[str, list[float]]:
        values = self.model.outputs() if self.model is not None else outputs_of(self.slave, self.component)
        by_name: dict[str, list[float]] = {}
        for v, value in zip(elements_of(self.component, "output").values(), values, strict=True):
            by_name.setdefault(v.name, []).append(value)
        return by_name

    def second(self, lengths: Sequence[float]) -> dict[str, list[float]]:
        """Return the outputs after a second in steps of these lengths; for increments their sums."""
        time, sums = 0.0, {}
        for length in lengths:
            assert self.step(time, length)
            time += length
            for name, values in self.outputs().items():
                if name in OVER_A_STEP:
                    sums[name] = [a + b for a, b in zip(sums.get(name, [0.0] * 9), values, strict=False)]
        assert time == pytest.approx(1.0)
        return self.outputs() | sums


@pytest.mark.first(4)
@pytest.mark.parametrize("flavour", ["native 2", "native 3", "python 2"])
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_every_declared_capability_is_there(component, flavour, tmp_path, slaves):
    kind, fmi = flavour.split()
    if kind == "native" and host_compiler() is None:
        pytest.skip("skipped: no C compiler")
    path = build(component.name, tmp_path, component.effects, flavour=kind, fmi=int(fmi))
    message = claims(path)
    assert {name for name, value in message.items() if value} <= TRIED
    extra = (slaves,) if kind == "python" else ()
    driven = Driven(component, path, tmp_path / "a", *extra)
    if message["canHandleVariableCommunicationStepSize"]:
        even, uneven = driven.second(UNIT), Driven(component, path, tmp_path / "b", *extra).second(UNEVEN)
        for name, values in even.items():
            assert uneven[name] == pytest.approx(values, rel=1e-9, abs=1e-9), name
    else:
        # It accepts its sample period, and no longer step.
        assert driven.step(0.0, 0.02)
        assert not driven.step(0.02, 0.03)


@needs_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_attitude_computer_takes_a_sample_in_parts(fmi, tmp_path):
    """The turns of the gyros over the parts of a sample add up, also if the last step of a run is short."""
    component = components()["AttitudeComputer"]
    path = build(component.name, tmp_path, flavour="native", fmi=fmi)
    complete = Driven(component, path, tmp_path / "a")
    parts = Driven(component, path, tmp_path / "b")
    time = 0.0
    for k, lengths in enumerate([[0.02], [0.02], [0.01, 0.01], [0.005, 0.015], [0.02], [0.0025] * 8]):
        assert complete.step(0.02 * k, 0.02)
        for n, length in enumerate(lengths):
            assert parts.step(time, length)
            time += length
            if n < len(lengths) - 1:
                assert parts.outputs()["updated"] == [0.0]
        assert parts.outputs()["updated"] == complete.outputs()["updated"]
        assert parts.outputs()["attitude"] == pytest.approx(complete.outputs()["attitude"], abs=1e-15)
    before = parts.outputs()["attitude"]
    assert parts.step(time, 0.004)
    assert parts.outputs() == {"attitude": before, "updated": [0.0]}
