"""The instruments: blocks of accelerometers and gyros, their inverses, and the computers of attitude and velocity.

AccelerometerBlock, whose scale factors depend on the sign of the input, and AccelerometerCompensation. GyroBlock, three
gyros that read increments, and GyroCompensation, which gives increments of the body. AttitudeComputer, attitude from
angle increments; VelocityComputer, velocity beside it.
"""

import math

from ..models import accelerometer, gyro, noise
from ..models.attitude_algorithms import ALGORITHMS, MAX_INCREMENT, PRODUCTS, computer, velocity
from ..models.attitude_algorithms.computer import PROGRESS_SIZE, STEP_SIZE, TABLE_SIZE
from ..models.attitude_algorithms.iteration import SPACE_SIZE
from ..models.random_numbers import GENERATOR_SIZE
from ..models.restricted import CONTEXT_SIZE, GYRO_CONTEXT_SIZE
from . import units
from .component import COUNT, FLAG, GRAVITY, Component, Variable, fixed, input_, output, seed, state, tunable, work

WEIGHTS = computer.all_weights()


def _gamma(row: int, column: int) -> Variable:
    return tunable(
        f"gamma_{row}{column}",
        f"Γ{row}{column}: response of accelerometer {row} to the input of accelerometer {column}",
        within=(-0.5, 0.5),
    )


def _noise(name: str, description: str, unit: str, least: float | None = 0.0) -> Variable:
    return fixed(name, description, 3, unit, within=(least, None))


_NOISE_MEMORY = (
    state("noise_memory", "walks, remainders and flicker of the noise", noise.MEMORY_SIZE),
    state("noise_generator", "state of its random numbers", GENERATOR_SIZE),
    state("noise_spare", "the second of a pair of normal numbers", noise.SPARE_SIZE),
    work("noise", "noise of the mean reading over the step", 3),
)
_UNBOUNDED = "noise beside ρ, without a bound where not 0: white N, flicker B, random walk K, ramp R, quantisation Q"

HALF_A_TURN, OUT_OF_RANGE = (
    "increment is not finite or longer than half a turn",
    "increment is beyond the valid range of the algorithm",
)
"""Messages of the attitude computer on an increment that it refuses."""

ACCELEROMETER_BLOCK = Component(
    name="AccelerometerBlock",
    description="Block of three accelerometers: scale factors that depend on the sign of the input, misalignment, bias",
    variables=(
        input_("specific_force", "true specific force in block axes", **units.FORCE),
        input_("temperature", "temperature of the block", unit="degC", start=20.0),
        input_("dwell", "number of the rest: the held error is drawn anew when it changes", **COUNT),
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
            follows=("specific_force", "temperature", "angle"),
            **units.FORCE,
        ),
        output(
            "increment_reading",
            "readings as increments of velocity: their integral over the last step by the trapezoid rule",
            **units.VELOCITY,
        ),
        input_(
            "rate", "true angular rate at the end of the step, which effects of the block's size read", **units.RATE
        ),
        input_("angle", "true angles of the table's axes, which effects of theirs on readings read", **units.AXES),
        state("error", "error of the sample [g]", 3),
        state("held", "error held over the rest, as a fraction of its bound", 3),
        state("generator", "state of the random numbers", GENERATOR_SIZE),
        state("held_dwell", "number of the rest whose error is held", 1),
        state("start", "time of the start", 1),
        state("previous_input", "specific force at its last change", 3),
        state("context", "the circumstances that effects read", CONTEXT_SIZE),
        state("turning", "mean angular acceleration over the last step [rad/s²], and its length [s]", 4),
        state("before", "hours and temperature [degC] of the step before", 2),
        state("last_reading", "readings at the end of the step before [m/s²]", 3),
        state("waiting", "length of a step whose increments wait for its readings; negative: none wait", 1),
        state("kept", "what effects keep for each accelerometer", 3),
        work("n", "inputs in g", 3),
        work("added", "what effects add", 3),
        work("own", "what each accelerometer's own input adds to its reading [g]", 3),
        _noise("velocity_random_walk", "N: density of white noise, m/s2/sqrt(Hz)", "m/s/sqrt(s)"),
        _noise("bias_instability", "B: flicker noise; its Allan deviation is 0.664 B", "m/s2"),
        _noise("acceleration_random_walk", "K: random walk of the bias", "m/s2/sqrt(s)"),
        _noise("acceleration_ramp", "R: ramp of the bias", "m/s3", None),
        _noise("velocity_quantisation", "Q: quantisation of velocity increments, its remainder carried on", "m/s"),
        *_NOISE_MEMORY,
    ),
    model=(accelerometer.initialise_accelerometers, accelerometer.step_accelerometers, accelerometer.respond),
    messages=(
        "gravity must be positive",
        "specific_force is not finite",
        "rate is not finite",
        "angle is not finite",
    ),
    equations=(
        "n = specific force / g",
        "reading = g (n + Γ n + b + ρ), Γ diagonal: Γ⁺ for n > 0, Γ⁻ for n ≤ 0",
        "|ρ| ≤ noise bound: a part held over a rest and a white part",
        _UNBOUNDED,
    ),
    source="Golovan, Matasov, Tarygin 2022, (1.1)",
)


CALIBRATED = (
    "gravity",
    "scale_error_plus",
    "scale_error_minus",
    "gamma_21",
    "gamma_31",
    "gamma_12",
    "gamma_32",
    "gamma_13",
    "gamma_23",
    "bias",
)
"""Parameters of the block that its inverse has too, under the same names: one parameter set fits both."""

ACCELEROMETER_COMPENSATION = Component(
    name="AccelerometerCompensation",
    description="Compensation of an accelerometer block: readings to specific force by the inverse of its model",
    variables=(
        input_("reading", "readings of the accelerometers", **units.FORCE),
        *(v for v in ACCELEROMETER_BLOCK.variables if v.name in CALIBRATED),
        output("specific_force", "specific force in block axes", **units.FORCE, follows=("reading",)),
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


GYRO_BLOCK = Component(
    name="GyroBlock",
    description="Block of three gyros: scale factors, misalignment, bias, noise, increments in whole quanta",
    variables=(
        input_("rate", "true angular rate in block axes, where the input is rates", **units.RATE),
        input_(
            "increment",
            "integral of the true rate over the last step, where the input is increments",
            **units.INCREMENT,
        ),
        input_("specific_force", "true specific force in block axes", **units.FORCE),
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
        output("rate_reading", "readings: mean rates over the last step", **units.RATE),
        output("increment_reading", "readings: increments over the last step", **units.INCREMENT),
        state("error", "error of the sample [rad/s]", 3),
        state("generator", "state of the random numbers", GENERATOR_SIZE),
        state("start", "time of the start", 1),
        state("last_step", "length of the last step; 0 before the first", 1),
        state("last_rate", "rate at the end of the last step", 3),
        state("rate_of_step", "mean rate over the last step", 3),
        state("context", "the circumstances that effects read", GYRO_CONTEXT_SIZE),
        state("carried", "what the quanta left of the increments [rad]", 3),
        work("added", "what effects add", 3),
        work("own", "what each gyro's own input adds to its reading [rad/s]", 3),
        _noise("angle_random_walk", "N: density of white noise, rad/s/sqrt(Hz)", "rad/sqrt(s)"),
        _noise("bias_instability", "B: flicker noise; its Allan deviation is 0.664 B", "rad/s"),
        _noise("rate_random_walk", "K: random walk of the bias", "rad/s/sqrt(s)"),
        _noise("rate_ramp", "R: ramp of the bias", "rad/s2", None),
        _noise("angle_quantisation", "Q: quantisation of angle increments, its remainder carried on", "rad"),
        *_NOISE_MEMORY,
    ),
    model=(gyro.initialise_gyros, gyro.step_gyros),
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
        _UNBOUNDED,
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
        input_("increment_reading", "readings: increments over the last step", **units.INCREMENT),
        *(v for v in GYRO_BLOCK.variables if v.name in SHARED),
        output("rate", "mean angular rate of the body over the last step, in block axes", **units.RATE),
        output("increment", "integral of the body's angular rate over the last step, in block axes", **units.INCREMENT),
        state("start", "time of the start", 1),
        state("last_step", "length of the last step; 0 before the first", 1),
        state("nominal", "mean rate over the last step, effects not taken out", 3),
        state("corrected", "mean rate over the last step, effects taken out once", 3),
        state("context", "the circumstances that effects read, with such rates", GYRO_CONTEXT_SIZE),
        state("corrected_context", "the same with effects taken out once", GYRO_CONTEXT_SIZE),
        work("added", "what effects add", 3),
        work("right", "right side of the equations", 3),
        work("n", "their solution", 3),
    ),
    model=(gyro.initialise_gyro_inverse, gyro.step_gyro_inverse),
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


_RATE_INPUTS = (
    input_("rate", "the body's angular rate at the end of the step, where the inputs are rates or mixed", **units.RATE),
    fixed(
        "input_kind",
        "kind of the inputs: increments; rates; mixed, both of them, for an algorithm that takes an even number of "
        "samples: halves of samples count for it",
        start=computer.INCREMENTS,
        type="enumeration",
        items=computer.INPUT_KINDS,
    ),
    state(
        "inputs",
        "rates and increments of the step that is not full yet, and the rate at its beginning",
        computer.INPUTS_SIZE,
    ),
    state("weights", "of rates and increments in increments", len(WEIGHTS), start=WEIGHTS),
    work("turning", "rate at the end of the step, times the sample period", 3),
)

ATTITUDE_COMPUTER = Component(
    name="AttitudeComputer",
    description="Strapdown attitude computer: attitude quaternion from angle increments",
    variables=(
        input_(
            "increment",
            "integral of the body's angular rate over the last step",
            within=(-MAX_INCREMENT, MAX_INCREMENT),
            **units.INCREMENT,
        ),
        *_RATE_INPUTS[:2],
        fixed(
            "algorithm",
            "the algorithm: " + "; ".join(f"{a.number} {a.title}, {a.source}" for a in ALGORITHMS),
            start=1.0,
            type="enumeration",
            items=tuple(a.name for a in ALGORITHMS),
        ),
        fixed(
            "sample_period", "time between increments; 0: the length of the first step", unit="s", within=(0.0, None)
        ),
        fixed(
            "initial_attitude", "attitude quaternion at the start, scalar first, body to reference", **units.ATTITUDE
        ),
        output("attitude", "attitude quaternion, scalar first, body to reference", 4),
        output(
            "updated", "whether the last step brought an update: only then is the attitude that of this moment", **FLAG
        ),
        fixed(
            "renormalise",
            "whether the quaternion is brought back to the unit sphere after every update",
            start=1.0,
            type="boolean",
        ),
        state("progress", "what was taken, what waits, and what the algorithm that was chosen takes", PROGRESS_SIZE),
        state("collected", "increments of the step that is not full yet", STEP_SIZE),
        state("previous", "increments of the step before", STEP_SIZE),
        state(
            "algorithms",
            "of each: increments that one update takes, longest increment, 1 where it reads those of the step before",
            3 * len(ALGORITHMS),
            start=tuple(float(x) for a in ALGORITHMS for x in (a.samples, a.max_increment, a.previous)),
        ),
        state(
            "products",
            "number of the algorithm, i, j, k of each product k γi × γj; a zero behind them",
            len(PRODUCTS),
            start=PRODUCTS,
        ),
        state("table", "what a functional iteration needs", TABLE_SIZE),
        work("space", "differences of the increments; rates, attitude and its derivative at the nodes", SPACE_SIZE),
        work("part", "quaternion of a part of the step", 4),
        work("turned", "quaternion of the step", 4),
        state("before", "the increment before", 3),
        work("added", "what effects add to an increment", 3),
        state("sample", "increment of the part of a sample that has passed", 3),
        *_RATE_INPUTS[2:],
    ),
    model=(computer.initialise_attitude, computer.step_attitude),
    messages=(
        "initial_attitude is not a unit quaternion (norm within 1e-3 of 1)",
        "the communication step is not the sample period, or does not follow the last one: one increment for each "
        "sample is needed; those over parts of a sample add up",
        f"{HALF_A_TURN} ({math.pi:.6f} rad): its direction would be ambiguous",
        f"{OUT_OF_RANGE}; longest [rad]: " + ", ".join(f"{a.name} {a.max_increment:.3g}" for a in ALGORITHMS),
        "the increments are not those of a smooth rate: the functional iteration does not end",
        "mixed inputs need an algorithm that takes an even number of samples",
    ),
    equations=(
        "λ(tₙ) = λ(tₙ₋₁) ∘ λ*, λ* = ((1 − x·x), 2x) / (1 + x·x), x = tan(φ/4) e",
        "(22): x = (1/4 + γ'·γ'/48) γ' + (1/4 + γ''·γ''/48) γ'' + (γ' × γ'')/6",
        "(25): λ* = (cos(φ/2), φ sin(φ/2)/|φ|), φ = Σ γ + coning correction; (7.18): φ = γ",
    ),
    source="Chelnokov, Perelyaev, Chelnokova 2016",
    any_step=False,
    smooth=False,
)


_of_attitude = {v.name: v for v in ATTITUDE_COMPUTER.variables if v not in _RATE_INPUTS}

VELOCITY_COMPUTER = Component(
    name="VelocityComputer",
    description="Strapdown velocity and attitude computer: from increments of angle and of velocity",
    variables=(
        _of_attitude.pop("increment"),
        input_(
            "velocity_increment",
            "integral of the specific force in body axes over the last step",
            within=(-velocity.LARGEST_INCREMENT, velocity.LARGEST_INCREMENT),
            **units.VELOCITY,
        ),
        *(_of_attitude.pop(name) for name in ("algorithm", "sample_period", "initial_attitude")),
        fixed("initial_velocity", "velocity at the start, in the reference", 3, "m/s"),
        fixed(
            "gravitation",
            "acceleration that accelerometers do not feel, in the reference; 0: the velocity is that of specific force",
            3,
            "m/s2",
            within=(-100.0, 100.0),
        ),
        fixed(
            "form",
            "how rotation is compensated: joint, of the algorithm's order; classic, of the third; first-order, of the "
            "second; iterations and adaptive-degree need none",
            start=velocity.JOINT,
            type="enumeration",
            items=velocity.FORMS,
        ),
        output("velocity", "velocity in the reference", **units.VELOCITY),
        output(
            "gained",
            "velocity of the last step of the algorithm, compensated, in the body as it stood at its beginning",
            **units.VELOCITY,
        ),
        *_of_attitude.values(),
        state("collected_v", "velocity increments of the step that is not full yet", STEP_SIZE),
        state("previous_v", "velocity increments of the step before", STEP_SIZE),
        state("sample_v", "velocity increment of the part of a sample that has passed", 3),
        work("node", "attitude at a node", 4),
    ),
    model=(velocity.initialise_velocity, velocity.step_velocity),
    messages=(
        *ATTITUDE_COMPUTER.messages[:-1],
        f"velocity_increment is not finite or beyond {velocity.LARGEST_INCREMENT:g} m/s",
    ),
    equations=(
        *ATTITUDE_COMPUTER.equations[:1],
        "v(tₙ) = v(tₙ₋₁) + λ(tₙ₋₁) ∘ u ∘ λ*(tₙ₋₁) + g h",
        "u = σ + (1 − cos φ)/φ² φ × σ + (φ − sin φ)/φ³ φ × (φ × σ)",
        "φ = Σ γi + Σ kij γi × γj, σ = Σ υi + Σ kij (γi × υj + υi × γj)",
    ),
    source="Savage 1998, part 2; Roscoe 2001: sculling is coning's dual",
    any_step=False,
    smooth=False,
)
