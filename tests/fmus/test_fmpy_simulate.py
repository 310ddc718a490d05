"""`fmpy simulate` runs every component unchanged."""

import fmpy
import numpy as np
import pytest

from component_kinds import elements_of
from trihedron.fmus import component_names, components


@pytest.mark.parametrize("name", component_names())
def test_fmpy_simulates_the_default_experiment(name, fmu_folder):
    """Default start values, default step; outputs finite, time in whole steps."""
    component = components()[name]
    stop = 50 * component.step_size
    run = fmpy.simulate_fmu(str(fmu_folder / f"{name}.fmu"), stop_time=stop, output_interval=component.step_size)
    assert len(run) == 51
    outputs = list(elements_of(component, "output"))
    assert run.dtype.names is not None
    assert set(run.dtype.names) == {"time", *outputs}
    assert all(np.isfinite(run[output].astype(float)).all() for output in outputs)


def test_fmpy_drives_the_table_to_its_command(fmu_folder):
    run = fmpy.simulate_fmu(
        str(fmu_folder / "TurntableMotion.fmu"),
        stop_time=5.0,
        step_size=0.05,
        output_interval=0.05,
        start_values={"command[1]": 1.0, "command[2]": -0.5, "encoder_fluctuation_bound": 0.0},
    )
    assert run["angle_reading[1]"][-1] == pytest.approx(1.0, abs=1e-15)
    assert run["angle_reading[2]"][-1] == pytest.approx(-0.5, abs=1e-15)
    assert run["dwell"][0] == 1
    assert run["dwell"][-1] == 2
