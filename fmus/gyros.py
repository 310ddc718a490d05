"""GyroBlock, three gyros that read increments, and GyroCompensation, its inverse: increments of the body."""

from ..models import gyro
from ..models.random_numbers import GENERATOR_SIZE
from ..models.restricted import GYRO_CONTEXT_SIZE, PREVIOUS_STEPS
from .component import GRAVITY, Component, fixed, input_, output, seed, state, tunable, work

GYRO_BLOCK = Component(
    name="GyroBlock",
    description="Block of three gyros: scale factors, misalignment, bias, noise, increments in whole quanta",
    variables=(
        input_("rate", "true angular rate in block axes, where the input is rates", 3, "rad/s", "deg/s"),
        input_(
            "increment",
            "integral of the true rate over the last step, where the input is increments",
            3,
            "rad",
            "arcsec",
            variability="discrete",
        ),
        input_("specific_force", "true specific force in block axes", 3, "m/s2", "g", nominal=10.0),
        input_("temperature", "temperature of the block", unit="degC", start=20.0),
        input_(
            "interval",
            "length of the last step by the time stamps of the record; 0: the step itself",
            unit="s",
            variability="discrete",
        ),
        fixed(
            "input_kind",
            "which input counts: increments; rates that hold over the step; rates at its end, joined by the trapezoid "
            "rule",
            start=1.0,
            type="enumeration",
            items=("increments", "held-rates", "instantaneous-rates"),
        ),
        GRAVITY,
        tunable(
            "scale_misalignment",
            "Γ, row by row: scale-factor errors on its diagonal, misalignments beside it",
            9,
            within=(-0.5, 0.5),
        ),
        tunable("bias", "b: biases of the readings", 3, "rad/s", "deg/s", within=(-10.0, 10.0)),
        fixed("quantum", "increments come in whole multiples of it; 0: exact", 0, "rad", "arcsec", within=(0.0, 1.0)),
        fixed("noise_bound", "bound of the error of a reading", 0, "rad/s", "deg/s", within=(0.0, 10.0)),
        seed("seed of the errors"),
        output("rate_reading", "readings: mean rates over the last step", 3, "rad/s", "deg/s"),
        output(
            "increment_reading", "readings: increments over the last step", 3, "rad", "arcsec", variability="discrete"
        ),
        state("error", "error of the sample [rad/s]", 3),
        state("generator", "state of the random numbers", GENERATOR_SIZE),
        state("start", "time of the start", 1),
        state("hours", "time since the start [h]", 1),
        state("last_step", "length of the last step; 0 before the first", 1),
        state("last_rate", "rate at the end of the last step", 3),
        state("rate_of_step", "mean rate over the last step", 3),
        state("previous_rates", "mean rates over the steps before, the newest first", 3 * PREVIOUS_STEPS),
        state("carried", "what the quanta left of the increments [rad]", 3),
        work("context", "the circumstances that effects read", GYRO_CONTEXT_SIZE),
        work("added", "what effects add", 3),
        work("own", "what each gyro's own input adds to its reading [rad/s]", 3),
    ),
    model=(gyro.initialise, gyro.step),
    messages=(
        "gravity must be positive",
        "specific_force is not finite",
        "rate is not finite",
        "increment is not finite",
        "interval is not finite",
    ),
    equations=(
        "ω: mean of the true rate over the step, increment / h",
        "rate reading = ω + Γ ω + b + ρ, |ρ| ≤ noise bound",
        "increment reading = h · rate reading + remainder, in whole quanta; the rest is the next remainder",
    ),
    source='Groves, "Principles of GNSS, inertial, and multisensor integrated navigation systems", 2nd ed. 2013, 4.4',
)


SHARED = ("specific_force", "temperature", "interval", "gravity", "scale_misalignment", "bias")
"""Inputs and parameters of the block that its inverse has too, under the same names: one parameter set fits both."""

GYRO_COMPENSATION = Component(
    name="GyroCompensation",
    description="Compensation of a gyro block: readings of increments to increments of the body by the inverse model",
    variables=(
        input_(
            "increment_reading", "readings: increments over the last step", 3, "rad", "arcsec", variability="discrete"
        ),
        *(v for v in GYRO_BLOCK.variables if v.name in SHARED),
        output("rate", "mean angular rate of the body over the last step, in block axes", 3, "rad/s", "deg/s"),
        output(
            "increment",
            "integral of the body's angular rate over the last step, in block axes",
            3,
            "rad",
            "arcsec",
            variability="discrete",
        ),
        state("start", "time of the start", 1),
        state("hours", "time since the start [h]", 1),
        state("last_step", "length of the last step; 0 before the first", 1),
        state("nominal", "mean rate over the last step, effects not taken out", 3),
        state("corrected", "mean rate over the last step, effects taken out once", 3),
        state("nominal_rates", "such rates over the steps before, the newest first", 3 * PREVIOUS_STEPS),
        state("corrected_rates", "such rates over the steps before, the newest first", 3 * PREVIOUS_STEPS),
        work("context", "the circumstances that effects read", GYRO_CONTEXT_SIZE),
        work("added", "what effects add", 3),
        work("right", "right side of the equations", 3),
        work("n", "their solution", 3),
    ),
    model=(gyro.initialise_inverse, gyro.step_inverse),
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
    undoes="GyroBlock",
)
