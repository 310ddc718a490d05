"""The bilinear forms are the regressors and admissible sets of the model."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planning_reference import random_mounting
from trihedron.models.regressors import admissible, nominal_input
from trihedron.tools.calibration.model import Positions, parametrise, reading_jacobian
from trihedron.tools.errors import InputError
from trihedron.tools.planning.forms import clearance, sheets, value


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), symmetric=st.booleans(), rule=st.sampled_from(["paper", "tables"]))
def test_forms_are_the_model(seed: int, symmetric: bool, rule: str) -> None:
    rng = np.random.default_rng(seed)
    q = random_mounting(seed) if seed % 3 else np.eye(3)
    p = parametrise({"q": q}, symmetric=symmetric)
    alpha, beta = rng.uniform(-4, 10, (2, 200))
    jacobian = reading_jacobian(p, np.zeros(len(p.symbols)), Positions(alpha, beta, np.zeros(200, dtype=int)))
    m = nominal_input(alpha, beta, q)
    allowed = admissible(alpha, beta, q, bounds=(2e-3, 3e-2), rule=rule)
    seen = np.zeros((200, 3), dtype=bool)
    for sheet in sheets(p, bounds=(2e-3, 3e-2), rule=rule):
        i = sheet.accelerometer
        here = np.full(200, True) if symmetric else m[:, i] * sheet.sign > 0
        np.testing.assert_allclose(value(sheet.regressor, alpha, beta)[here], jacobian[here, i], atol=1e-14)
        seen[:, i] |= clearance(sheet, alpha, beta) > 0
    assert (seen == (True if symmetric else allowed)).all()


@pytest.mark.parametrize(
    ("bounds", "said"),
    [((-1.0, 0.01), "not negative"), ((np.nan, 0.01), "finite"), ((0.003, 1.2), "leave no position")],
)
def test_wrong_bounds_are_refused(bounds: tuple[float, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        sheets(parametrise({"identity": np.eye(3)}), bounds=bounds)


def test_a_plan_is_for_one_mounting() -> None:
    with pytest.raises(InputError, match="2 mountings"):
        sheets(parametrise({"a": np.eye(3), "b": np.eye(3)}))
