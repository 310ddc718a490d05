"""GyroCompensation: increments that gyros read to increments of the body, the inverse of the gyro block."""

from ..models import gyro_compensation
from ..models.restricted import GYRO_CONTEXT_SIZE, PREVIOUS_STEPS
from .component import Component, Variable
from .gyro_block import GYRO_BLOCK

SHARED = ("specific_force", "temperature", "interval", "gravity", "scale_misalignment", "bias")
"""Inputs and parameters of the block that its inverse has too, under the same names: one parameter set fits both."""

GYRO_COMPENSATION = Component(
    name="GyroCompensation",
    description="Compensation of a gyro block: readings of increments to increments of the body by the inverse model",
    variables=(
        Variable(
            "increment_reading",
            "readings: increments over the last step",
            "input",
            3,
            "rad",
            "arcsec",
            variability="discrete",
        ),
        *(v for v in GYRO_BLOCK.variables if v.name in SHARED),
        Variable(
            "rate", "mean angular rate of the body over the last step, in block axes", "output", 3, "rad/s", "deg/s"
        ),
        Variable(
            "increment",
            "integral of the body's angular rate over the last step, in block axes",
            "output",
            3,
            "rad",
            "arcsec",
            variability="discrete",
        ),
        Variable("start", "time of the start", size=1),
        Variable("hours", "time since the start [h]", size=1),
        Variable("last_step", "length of the last step; 0 before the first", size=1),
        Variable("nominal", "mean rate over the last step, effects not taken out", size=3),
        Variable("corrected", "mean rate over the last step, effects taken out once", size=3),
        Variable("nominal_rates", "such rates over the steps before, the newest first", size=3 * PREVIOUS_STEPS),
        Variable("corrected_rates", "such rates over the steps before, the newest first", size=3 * PREVIOUS_STEPS),
        Variable("context", "the circumstances that effects read", "work", GYRO_CONTEXT_SIZE),
        Variable("added", "what effects add", "work", 3),
        Variable("right", "right side of the equations", "work", 3),
        Variable("n", "their solution", "work", 3),
    ),
    initialise=gyro_compensation.initialise,
    step=gyro_compensation.step,
    respond=None,
    messages=(
        "gravity must be positive",
        "the errors are too large for one inverse: 1 + Γ of each gyro must exceed its |Γ| of the two other axes",
        "increment_reading is not finite",
        "specific_force is not finite",
        "interval is not finite",
    ),
    equations=(
        "r: mean of the readings over the step, increment reading / h",
        "ω₀ = (I + Γ)⁻¹ (r − b), ω₁ = ω₀ − (I + Γ)⁻¹ e(ω₀), rate = ω₀ − (I + Γ)⁻¹ e(ω₁); e: what effects add",
        "increment = h · rate",
    ),
    source='Groves, "Principles of GNSS, inertial, and multisensor integrated navigation systems", 2nd ed. 2013, 4.4',
    step_size=0.01,
    stop_time=60.0,
    undoes="GyroBlock",
)
