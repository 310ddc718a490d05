"""AccelerometerBlock, whose scale factors depend on the sign of the input; AccelerometerCompensation, its inverse."""

from ..models import accelerometer
from ..models.random_numbers import GENERATOR_SIZE
from ..models.restricted import CONTEXT_SIZE
from .component import GRAVITY, Component, Variable, fixed, input_, output, seed, state, tunable, work


def _gamma(row: int, column: int) -> Variable:
    return tunable(
        f"gamma_{row}{column}",
        f"Γ{row}{column}: response of accelerometer {row} to the input of accelerometer {column}",
        within=(-0.5, 0.5),
    )


ACCELEROMETER_BLOCK = Component(
    name="AccelerometerBlock",
    description="Block of three accelerometers: scale factors that depend on the sign of the input, misalignment, bias",
    variables=(
        input_("specific_force", "true specific force in block axes", 3, "m/s2", "g", nominal=10.0),
        input_("temperature", "temperature of the block", unit="degC", start=20.0),
        input_(
            "dwell",
            "number of the rest: the held error is drawn anew when it changes",
            variability="discrete",
            type="integer",
        ),
        GRAVITY,
        tunable("scale_error_plus", "Γ⁺: scale-factor errors for positive inputs", 3, within=(-0.5, 0.5)),
        tunable("scale_error_minus", "Γ⁻: scale-factor errors for negative inputs", 3, within=(-0.5, 0.5)),
        _gamma(2, 1),
        _gamma(3, 1),
        _gamma(1, 2),
        _gamma(3, 2),
        _gamma(1, 3),
        _gamma(2, 3),
        tunable("bias", "Δf⁰/g: biases of the readings", 3, "g", within=(-0.5, 0.5)),
        fixed("noise_bound", "bound of a reading's error, held and white part together", unit="g", within=(0.0, 0.5)),
        fixed(
            "held_fraction",
            "part of the bound that belongs to the error held over a rest",
            start=0.5,
            within=(0.0, 1.0),
        ),
        seed("seed of the errors"),
        output(
            "reading",
            "readings of the accelerometers",
            3,
            "m/s2",
            "g",
            nominal=10.0,
            follows=("specific_force", "temperature"),
        ),
        input_(
            "rate",
            "true angular rate at the end of the step, which effects of the block's size read",
            3,
            "rad/s",
            "deg/s",
        ),
        state("error", "error of the sample [g]", 3),
        state("held", "error held over the rest, as a fraction of its bound", 3),
        state("generator", "state of the random numbers", GENERATOR_SIZE),
        state("held_dwell", "number of the rest whose error is held", 1),
        state("start", "time of the start", 1),
        state("hours", "time since the start [h]", 1),
        state("senses", "senses of the last changes of the inputs", 3),
        state("previous_input", "specific force at its last change", 3),
        state("turning", "rate at the end of the last step, angular acceleration over it", 6),
        work("n", "inputs in g", 3),
        work("context", "the circumstances that effects read", CONTEXT_SIZE),
        work("added", "what effects add", 3),
        work("own", "what each accelerometer's own input adds to its reading [g]", 3),
    ),
    model=(accelerometer.initialise, accelerometer.step, accelerometer.respond),
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
        input_("reading", "readings of the accelerometers", 3, "m/s2", "g", nominal=10.0),
        *(v for v in ACCELEROMETER_BLOCK.variables if v.name in CALIBRATED),
        output("specific_force", "specific force in block axes", 3, "m/s2", "g", nominal=10.0, follows=("reading",)),
        work("right", "readings less bias [g]", 3),
        work("signs", "signs of the inputs that are tried", 3),
        work("best", "inputs [g] whose signs fit best", 3),
        work("diagonal", "scale factors for these signs", 3),
        work("n", "inputs [g] for these signs", 3),
    ),
    model=(accelerometer.initialise_inverse, accelerometer.step_inverse, accelerometer.respond_inverse),
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
)
