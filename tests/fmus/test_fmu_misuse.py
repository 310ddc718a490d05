"""Components in the hands of a host that calls them wrongly: a message, and the host goes on."""

import math
import shutil

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

from trihedron.fmus import build
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.scenario import Scenario

COMPONENTS = ("TurntableMotion", "AccelerometerBlock", "AttitudeComputer")
DISCARD = 2


@pytest.fixture(scope="module", params=COMPONENTS)
def unpacked(request, tmp_path_factory):
    """A component's FMU: its description and the folder that it is unpacked in."""
    path = build(request.param, tmp_path_factory.mktemp("fmu"))
    folder = extract(path)
    yield read_model_description(path), folder
    shutil.rmtree(folder)


@pytest.mark.parametrize("start", [0.0, math.inf, math.nan])
@pytest.mark.parametrize("step", [-0.01, math.inf, math.nan])
def test_a_step_that_is_none_is_discarded_and_the_next_one_works(unpacked, start, step):
    description, folder = unpacked
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="i",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    with pytest.raises(FMICallException) as refused:
        slave.doStep(currentCommunicationPoint=start, communicationStepSize=step)
    assert refused.value.status == DISCARD
    slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.01)
    outputs = [v.valueReference for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
    assert all(math.isfinite(value) for value in slave.getReal(outputs))
    slave.terminate()
    slave.freeInstance()


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"algorithm": 99}, "algorithm = 99 is none of its values: 1 (two-sample-rodrigues)"),
        ({"algorithm": 0}, "algorithm = 0 is none of its values"),
        ({"initial_attitude": [0.0, 0.0, 0.0, 0.0]}, "initial_attitude is not a unit quaternion"),
    ],
)
def test_a_wrong_parameter_of_a_component_is_named_by_the_scenario(parameters, said, tmp_path):
    scenario = Scenario.model_validate(
        {
            "base_folder": tmp_path,
            "run": {"stop_s": 1.0, "step_s": 0.1},
            "fmus": {"computer": {"component": "AttitudeComputer", "parameters": parameters}},
        }
    )
    with pytest.raises(InputError) as refused:
        simulate(scenario)
    assert said in str(refused.value)
    assert "py exception" not in str(refused.value)
