"""AccelerometerBlock, whose scale factors depend on the sign of the input; AccelerometerCompensation, its inverse."""

from ..models.blocks import accelerometer, accelerometer_compensation
from ..models.random_numbers import GENERATOR_SIZE
from ..models.restricted import CONTEXT_SIZE
from .component import GRAVITY, Component, Variable, seed


def _gamma(row: int, column: int) -> Variable:
    return Variable(
        f"gamma_{row}{column}",
        f"Γ{row}{column}: response of accelerometer {row} to the input of accelerometer {column}",
        "parameter",
        variability="tunable",
        minimum=-0.5,
        maximum=0.5,
    )


ACCELEROMETER_BLOCK = Component(
    name="AccelerometerBlock",
    description="Block of three accelerometers: scale factors that depend on the sign of the input, misalignment, bias",
    variables=(
        Variable("specific_force", "true specific force in block axes", "input", 3, "m/s2", "g", nominal=10.0),
        Variable("temperature", "temperature of the block", "input", unit="degC", start=20.0),
        Variable(
            "dwell",
            "number of the rest: the held error is drawn anew when it changes",
            "input",
            variability="discrete",
            type="integer",
        ),
        GRAVITY,
        Variable(
            "scale_error_plus",
            "Γ⁺: scale-factor errors for positive inputs",
            "parameter",
            3,
            variability="tunable",
            minimum=-0.5,
            maximum=0.5,
        ),
        Variable(
            "scale_error_minus",
            "Γ⁻: scale-factor errors for negative inputs",
            "parameter",
            3,
            variability="tunable",
            minimum=-0.5,
            maximum=0.5,
        ),
        _gamma(2, 1),
        _gamma(3, 1),
        _gamma(1, 2),
        _gamma(3, 2),
        _gamma(1, 3),
        _gamma(2, 3),
        Variable(
            "bias",
            "Δf⁰/g: biases of the readings",
            "parameter",
            3,
            "g",
            variability="tunable",
            minimum=-0.5,
            maximum=0.5,
        ),
        Variable(
            "noise_bound",
            "bound of a reading's error, held and white part together",
            "parameter",
            unit="g",
            variability="fixed",
            minimum=0.0,
            maximum=0.5,
        ),
        Variable(
            "held_fraction",
            "part of the bound that belongs to the error held over a rest",
            "parameter",
            start=0.5,
            variability="fixed",
            minimum=0.0,
            maximum=1.0,
        ),
        seed("seed of the errors"),
        Variable(
            "reading",
            "readings of the accelerometers",
            "output",
            3,
            "m/s2",
            "g",
            nominal=10.0,
            follows=("specific_force", "temperature"),
        ),
        Variable(
            "rate",
            "true angular rate at the end of the step, which effects of the block's size read",
            "input",
            3,
            "rad/s",
            "deg/s",
        ),
        Variable("error", "error of the sample [g]", size=3),
        Variable("held", "error held over the rest, as a fraction of its bound", size=3),
        Variable("generator", "state of the random numbers", size=GENERATOR_SIZE),
        Variable("held_dwell", "number of the rest whose error is held", size=1),
        Variable("start", "time of the start", size=1),
        Variable("hours", "time since the start [h]", size=1),
        Variable("senses", "senses of the last changes of the inputs", size=3),
        Variable("previous_input", "specific force at its last change", size=3),
        Variable("turning", "rate at the end of the last step, angular acceleration over it", size=6),
        Variable("n", "inputs in g", "work", 3),
        Variable("context", "the circumstances that effects read", "work", CONTEXT_SIZE),
        Variable("added", "what effects add", "work", 3),
        Variable("own", "what each accelerometer's own input adds to its reading [g]", "work", 3),
    ),
    initialise=accelerometer.initialise,
    step=accelerometer.step,
    respond=accelerometer.respond,
    messages=(
        "gravity must be positive",
        "specific_force is not finite",
        "rate is not finite",
    ),
    equations=(
        "n = specific force / g",
        "reading = g (n + Γ n + b + ρ), Γ diagonal: Γ⁺ for n > 0, Γ⁻ for n ≤ 0",
        "|ρ| ≤ noise bound: a part held over a rest and a white part",
    ),
    source="Golovan, Matasov, Tarygin 2022, (1.1)",
    step_size=0.01,
    stop_time=60.0,
)


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
    initialise=accelerometer_compensation.initialise,
    step=accelerometer_compensation.step,
    respond=accelerometer_compensation.respond,
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
