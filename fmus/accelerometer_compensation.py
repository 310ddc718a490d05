"""AccelerometerCompensation: readings to specific force, the inverse of the calibrated block."""

from ..models import compensation
from .accelerometer_block import ACCELEROMETER_BLOCK
from .component import Component, Variable

CALIBRATED = (
    "gravity",
    "scale_error_plus",
    "scale_error_minus",
    *("gamma_21", "gamma_31", "gamma_12", "gamma_32", "gamma_13", "gamma_23"),
    "bias",
)
"""Parameters of the block that its inverse has too, under the same names: one parameter set fits both."""

ACCELEROMETER_COMPENSATION = Component(
    name="AccelerometerCompensation",
    description="Compensation of an accelerometer block: readings to specific force by the inverse of its model",
    variables=(
        Variable("reading", "readings of the accelerometers", "input", 3, "m/s2", "g", nominal=10.0),
        *(v for v in ACCELEROMETER_BLOCK.variables if v.name in CALIBRATED),
        Variable(
            "specific_force",
            "specific force in block axes",
            "output",
            3,
            "m/s2",
            "g",
            nominal=10.0,
            follows=("reading",),
        ),
        Variable("right", "readings less bias [g]", "work", 3),
        Variable("signs", "signs of the inputs that are tried", "work", 3),
        Variable("best", "inputs [g] whose signs fit best", "work", 3),
        Variable("diagonal", "scale factors for these signs", "work", 3),
        Variable("n", "inputs [g] for these signs", "work", 3),
    ),
    initialise=compensation.initialise,
    step=compensation.step,
    respond=compensation.respond,
    messages=(
        "gravity must be positive",
        "the errors are too large for one inverse: 1 + Γ± of each accelerometer must exceed its |Γ| of the two others",
        "reading is not finite",
    ),
    equations=(
        "A(s) n = reading / g − b, A = I + Γ with Γ⁺ or Γ⁻ of each accelerometer by its sign s",
        "s = signs of n: the one pattern of eight that fits itself; specific force = g n",
    ),
    source="Golovan, Matasov, Tarygin 2022, (1.1), solved for the input",
    step_size=0.01,
    stop_time=60.0,
)
