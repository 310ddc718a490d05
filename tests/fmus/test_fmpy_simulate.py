"""`fmpy simulate` runs every component as it comes."""

import fmpy
import numpy as np
import pytest

from trihedron.fmus import component_names, components


@pytest.mark.parametrize("name", component_names())
def test_fmpy_simulates_the_default_experiment(name, fmu_folder):
    """Default start values, default step; outputs finite, time in whole steps."""
    component = components()[name]
    stop = 50 * component.step_size
    run = fmpy.simulate_fmu(str(fmu_folder / f"{name}.fmu"), stop_time=stop, output_interval=component.step_size)
    assert len(run) == 51
    outputs = [e for v in component.interface if v.causality == "output" for e in v.elements]
    assert run.dtype.names is not None
    assert set(run.dtype.names) == {"time", *outputs}
    assert all(np.isfinite(run[output].astype(float)).all() for output in outputs)
