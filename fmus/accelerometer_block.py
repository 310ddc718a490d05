"""AccelerometerBlock: three accelerometers with sign-dependent scale factors."""

from trihedron.fmus.component import Component, Variable
from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.models import accelerometer
from trihedron.models.random_numbers import GENERATOR_SIZE
from trihedron.models.restricted import CONTEXT_SIZE


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
        Variable(
            "gravity",
            "g: model value of gravity",
            "parameter",
            unit="m/s2",
            start=STANDARD_GRAVITY,
            variability="fixed",
            minimum=1.0,
            maximum=100.0,
            nominal=10.0,
        ),
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
        Variable(
            "seed",
            "seed of the errors",
            "parameter",
            start=1.0,
            variability="fixed",
            type="integer",
            minimum=0.0,
            maximum=2147483647.0,
        ),
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
        Variable("error", "error of the sample [g]", size=3),
        Variable("held", "error held over the rest, as a fraction of its bound", size=3),
        Variable("generator", "state of the random numbers", size=GENERATOR_SIZE),
        Variable("held_dwell", "number of the rest whose error is held", size=1),
        Variable("start", "time of the start", size=1),
        Variable("hours", "time since the start [h]", size=1),
        Variable("senses", "senses of the last changes of the inputs", size=3),
        Variable("previous_input", "specific force at the last step", size=3),
        Variable("n", "inputs in g", "work", 3),
        Variable("context", "the circumstances that effects read", "work", CONTEXT_SIZE),
        Variable("added", "what effects add", "work", 3),
    ),
    initialise=accelerometer.initialise,
    step=accelerometer.step,
    respond=accelerometer.respond,
    messages=(
        "gravity must be positive",
        "specific_force is not finite",
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
