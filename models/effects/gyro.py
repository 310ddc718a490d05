"""Effects on the rates of the gyros, and on the increments of the attitude computer.

gyro_bias, gyro_bias_drift
    reading at no rate, and its growth with time
gyro_scale_misalignment, gyro_scale_asymmetry
    errors of scale and of direction; a scale factor that depends on the sense of the turn
gyro_rate_squared, gyro_rate_cubed
    a nonlinear response: squares and cubes of the rates
gyro_g_sensitivity, gyro_g_squared
    a bias that depends on the specific force, and on products of two of its components: anisoelasticity
latency
    the gyros read the rate of an earlier time
jitter
    the time stamps of a record jitter but the sampling does not, so rates count over wrong intervals
undersampling
    the attitude computer leaves out the coning within a step
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from ..arrays import Floats
from ..restricted import HOURS, INPUT, INTERVAL, PREVIOUS_RATE, PREVIOUS_STEPS, RESPONSE, STEP_LENGTH, Vector
from .columns import MotionRows
from .definition import EffectParameter, EffectPlace, Sentence, gyro_effect, matrix_formula

ROW_BY_ROW = tuple(product((1, 2, 3), repeat=2))
"""Gyro and axis of the elements of a matrix, in the order of its parameters."""


def of_each_gyro(name: str, unit: str, description: str, largest: float) -> tuple[EffectParameter, ...]:
    """Return three parameters, one for each gyro: "bias_1", "bias_2", "bias_3"."""
    return tuple(EffectParameter(f"{name}_{p}", unit, f"{description} of gyro {p}", largest) for p in (1, 2, 3))


def of_a_matrix(name: str, unit: str, description: str, largest: float) -> tuple[EffectParameter, ...]:
    """Return nine parameters, row by row: "gamma_11", "gamma_12", ..., of gyro 1 by axis 1, by axis 2, ..."""
    return tuple(
        EffectParameter(f"{name}_{p}{q}", unit, f"{description} of gyro {p} by axis {q}", largest)
        for p, q in ROW_BY_ROW
    )


def sentence_of(words: str, unit: str) -> Sentence:
    """Return a sentence that lists three values, "the gyros' bias: +1.0e-03, ...", or names the largest of nine."""

    def say(place: EffectPlace, values: Mapping[str, float]) -> str:
        sizes = list(values.values())
        if len(sizes) <= 3:
            return f"{words}: {listed(sizes)} {unit}".rstrip()
        largest = max(range(len(sizes)), key=lambda number: abs(sizes[number]))
        _, _, gyro = place.definition.parameters[largest].description.partition("gyro ")
        return f"{words}: largest {sizes[largest]:+.2e} {unit}".rstrip() + f" (gyro {gyro})"

    return say


def listed(values: Sequence[float]) -> str:
    """Return values with their signs, in rows of three if there are more."""
    texts = [f"{value:+.2e}" for value in values]
    rows = []
    for at in range(0, len(texts), 3):
        rows.append(", ".join(texts[at : at + 3]))
    return "; ".join(rows)


def gyro_bias(context: Vector, rate: Vector, bias_1: float, bias_2: float, bias_3: float, added: Vector) -> None:
    """Add a constant [rad/s] to each gyro's reading."""
    added[0] = added[0] + bias_1
    added[1] = added[1] + bias_2
    added[2] = added[2] + bias_3


BIAS = gyro_effect(
    gyro_bias,
    of_each_gyro("bias", "rad/s", "bias", 0.2),
    sentence_of("the gyros have a constant bias", "rad/s"),
    formula="Δω = ({bias_1}, {bias_2}, {bias_3}) 'rad/s'",
)


def gyro_bias_drift(context: Vector, rate: Vector, rate_1: float, rate_2: float, rate_3: float, added: Vector) -> None:
    """Add rate·hours to each gyro's reading; the rates are in rad/s an hour."""
    added[0] = added[0] + rate_1 * context[HOURS]
    added[1] = added[1] + rate_2 * context[HOURS]
    added[2] = added[2] + rate_3 * context[HOURS]


BIAS_DRIFT = gyro_effect(
    gyro_bias_drift,
    of_each_gyro("rate", "rad/s/h", "growth of the bias", 0.5),
    sentence_of("the biases of the gyros drift", "rad/s an hour"),
    formula="Δω = ({rate_1}, {rate_2}, {rate_3}) t 'rad/s', t 'in hours'",
)


def gyro_scale_misalignment(
    context: Vector,
    rate: Vector,
    gamma_11: float,
    gamma_12: float,
    gamma_13: float,
    gamma_21: float,
    gamma_22: float,
    gamma_23: float,
    gamma_31: float,
    gamma_32: float,
    gamma_33: float,
    added: Vector,
) -> None:
    """Add Γ ω."""
    added[0] = added[0] + gamma_11 * rate[0] + gamma_12 * rate[1] + gamma_13 * rate[2]
    added[1] = added[1] + gamma_21 * rate[0] + gamma_22 * rate[1] + gamma_23 * rate[2]
    added[2] = added[2] + gamma_31 * rate[0] + gamma_32 * rate[1] + gamma_33 * rate[2]


SCALE_MISALIGNMENT = gyro_effect(
    gyro_scale_misalignment,
    of_a_matrix("gamma", "1", "Γ: response", 0.2),
    sentence_of("the gyros have errors of scale (diagonal) and misalignment", ""),
    formula=f"Δω = {matrix_formula('gamma', '123')} ω",
)


def gyro_scale_asymmetry(
    context: Vector, rate: Vector, coefficient_1: float, coefficient_2: float, coefficient_3: float, added: Vector
) -> None:
    """Add c |ω_p| to the reading of each gyro p."""
    added[0] = added[0] + coefficient_1 * math.fabs(rate[0])
    added[1] = added[1] + coefficient_2 * math.fabs(rate[1])
    added[2] = added[2] + coefficient_3 * math.fabs(rate[2])


SCALE_ASYMMETRY = gyro_effect(
    gyro_scale_asymmetry,
    of_each_gyro("coefficient", "1", "c of c |ω|: half the difference of the scale factors", 0.05),
    sentence_of("the scale factors of the gyros differ between the senses of the turn, c of c |ω|", ""),
    formula="Δω = ({coefficient_1} |ω_1|, {coefficient_2} |ω_2|, {coefficient_3} |ω_3|)",
)


def gyro_rate_squared(
    context: Vector, rate: Vector, coefficient_1: float, coefficient_2: float, coefficient_3: float, added: Vector
) -> None:
    """Add c ω_p² to the reading of each gyro p."""
    added[0] = added[0] + coefficient_1 * rate[0] * rate[0]
    added[1] = added[1] + coefficient_2 * rate[1] * rate[1]
    added[2] = added[2] + coefficient_3 * rate[2] * rate[2]


RATE_SQUARED = gyro_effect(
    gyro_rate_squared,
    of_each_gyro("coefficient", "s/rad", "c of c ω²", 0.05),
    sentence_of("the readings of the gyros bend with the square of the rate, c of c ω²", "s/rad"),
    formula="Δω = ({coefficient_1} ω_1^2, {coefficient_2} ω_2^2, {coefficient_3} ω_3^2) 'rad/s'",
)


def gyro_rate_cubed(
    context: Vector, rate: Vector, coefficient_1: float, coefficient_2: float, coefficient_3: float, added: Vector
) -> None:
    """Add c ω_p³ to the reading of each gyro p."""
    added[0] = added[0] + coefficient_1 * rate[0] * rate[0] * rate[0]
    added[1] = added[1] + coefficient_2 * rate[1] * rate[1] * rate[1]
    added[2] = added[2] + coefficient_3 * rate[2] * rate[2] * rate[2]


RATE_CUBED = gyro_effect(
    gyro_rate_cubed,
    of_each_gyro("coefficient", "s2/rad2", "c of c ω³", 0.05),
    sentence_of("the readings of the gyros bend with the cube of the rate, c of c ω³", "s²/rad²"),
    formula="Δω = ({coefficient_1} ω_1^3, {coefficient_2} ω_2^3, {coefficient_3} ω_3^3) 'rad/s'",
)


def gyro_g_sensitivity(
    context: Vector,
    rate: Vector,
    coefficient_11: float,
    coefficient_12: float,
    coefficient_13: float,
    coefficient_21: float,
    coefficient_22: float,
    coefficient_23: float,
    coefficient_31: float,
    coefficient_32: float,
    coefficient_33: float,
    added: Vector,
) -> None:
    """Add G n, with the inputs n of the accelerometers in g."""
    x = context[INPUT]
    y = context[INPUT + 1]
    z = context[INPUT + 2]
    added[0] = added[0] + coefficient_11 * x + coefficient_12 * y + coefficient_13 * z
    added[1] = added[1] + coefficient_21 * x + coefficient_22 * y + coefficient_23 * z
    added[2] = added[2] + coefficient_31 * x + coefficient_32 * y + coefficient_33 * z


G_SENSITIVITY = gyro_effect(
    gyro_g_sensitivity,
    of_a_matrix("coefficient", "rad/s/g", "bias for each g of specific force", 0.05),
    sentence_of("the biases of the gyros depend on the specific force", "rad/s for each g"),
    formula=f"Δω = {matrix_formula('coefficient', '123')} n 'rad/s'",
)


PRODUCTS = ((1, 2), (1, 3), (2, 3))
"""The two axes of each product, in the order of the parameters."""


def gyro_g_squared(
    context: Vector,
    rate: Vector,
    coefficient_1_12: float,
    coefficient_1_13: float,
    coefficient_1_23: float,
    coefficient_2_12: float,
    coefficient_2_13: float,
    coefficient_2_23: float,
    coefficient_3_12: float,
    coefficient_3_13: float,
    coefficient_3_23: float,
    added: Vector,
) -> None:
    """Add c n_i n_j for each gyro and each pair of axes, with the inputs n of the accelerometers in g."""
    xy = context[INPUT] * context[INPUT + 1]
    xz = context[INPUT] * context[INPUT + 2]
    yz = context[INPUT + 1] * context[INPUT + 2]
    added[0] = added[0] + coefficient_1_12 * xy + coefficient_1_13 * xz + coefficient_1_23 * yz
    added[1] = added[1] + coefficient_2_12 * xy + coefficient_2_13 * xz + coefficient_2_23 * yz
    added[2] = added[2] + coefficient_3_12 * xy + coefficient_3_13 * xz + coefficient_3_23 * yz


G_SQUARED = gyro_effect(
    gyro_g_squared,
    tuple(
        EffectParameter(
            f"coefficient_{p}_{i}{j}",
            "rad/s/g2",
            f"c of c n_i n_j: bias of gyro {p} by the product of axes {i}, {j}",
            0.05,
        )
        for p in (1, 2, 3)
        for i, j in PRODUCTS
    ),
    sentence_of("the biases of the gyros depend on products of two specific forces", "rad/s for each g²"),
    formula=f"Δω = {matrix_formula('coefficient', ('_12', '_13', '_23'))} (n_1 n_2, n_1 n_3, n_2 n_3) 'rad/s'",
)


def earlier(context: Vector, rate: Vector, axis: int, steps: float) -> float:
    """Return the mean rate about an axis over a step that ended `steps` steps ago, less that over this one."""
    back = 0
    if steps > 0.0:
        back = int(math.floor(steps))
    if back > PREVIOUS_STEPS - 1:
        back = PREVIOUS_STEPS - 1
    late = context[PREVIOUS_RATE + 3 * back + axis]
    if steps > 1.0 * PREVIOUS_STEPS:
        return (late - rate[axis]) * (steps / PREVIOUS_STEPS)
    near = rate[axis]
    if back > 0:
        near = context[PREVIOUS_RATE + 3 * back - 3 + axis]
    return (near - rate[axis]) + (late - near) * (steps - back)


def latency(context: Vector, rate: Vector, delay: float, added: Vector) -> None:
    """Read the mean rate over a step that ended `delay` ago: the rates hold over the steps before.

    Exact for delays of up to eight steps; beyond, and for gyros that lead, the rate continues in a straight line. The
    whole reading is late, with scale factors and misalignments.
    """
    steps = delay / context[STEP_LENGTH]
    for q in range(3):
        change = earlier(context, rate, q, steps)
        for p in range(3):
            added[p] = added[p] + context[RESPONSE + 3 * p + q] * change


LATENCY = gyro_effect(
    latency,
    EffectParameter("delay", "s", "by which the gyros lag; negative: they lead", 0.2),
    lambda place, values: (
        f"the gyros lag by {1e3 * values['delay']:.4g} ms"
        if values["delay"] >= 0.0
        else f"the gyros lead by {-1e3 * values['delay']:.4g} ms"
    ),
    formula="ω_read(t) = ω(t − ({delay}) 's')",
)


def jitter(context: Vector, rate: Vector, share: float, added: Vector) -> None:
    """Add the change of each reading if its interval by the time stamps replaces the step, or several steps.

    The share is 1 if the sampling is regular and all jitter is the log's, 0 if the sampling itself jitters.
    """
    steps = context[INTERVAL] / context[STEP_LENGTH]
    whole = math.floor(steps + 0.5) + 0.0
    if whole < 1.0:
        whole = 1.0
    for p in range(3):
        added[p] = added[p] + share * rate[p] * (steps - whole)


def jitter_columns(place: EffectPlace, rows: MotionRows) -> Floats:
    """Return columns (N, 3, 1): the rates times the part of each interval that is not whole nominal periods.

    Over the interval this is an angle of the rate times interval less whole periods, like the kernel's over a step.
    """
    if rows.period <= 0.0:
        return np.zeros((*rows.rate.shape, 1))
    steps = rows.step / rows.period
    away = 1.0 - np.maximum(np.floor(steps + 0.5), 1.0) / steps
    return (rows.rate * away[:, None])[..., None]


JITTER = gyro_effect(
    jitter,
    EffectParameter("share", "1", "part of the time stamps' jitter that the sampling does not have", 1.5, smallest=0.0),
    lambda place, values: (
        f"the time stamps jitter more than the sampling: {100.0 * values['share']:.3g} % of their jitter is the log's"
    ),
    columns=jitter_columns,
    formula="Δω = {share} ω (τ/T − k), τ 'the interval by the time stamps, of' k 'whole periods' T",
)


def undersampling(before: Vector, increment: Vector, coefficient: float, added: Vector) -> None:
    """Add c γ' × γ to an increment γ, with γ' the one before; c is 1/12 if the rate is linear in time.

    Source: P. Savage, "Strapdown inertial navigation integration algorithm design", part 1, 1998: the second-order term
    of the coning correction from the increment before.
    """
    added[0] = added[0] + coefficient * (before[1] * increment[2] - before[2] * increment[1])
    added[1] = added[1] + coefficient * (before[2] * increment[0] - before[0] * increment[2])
    added[2] = added[2] + coefficient * (before[0] * increment[1] - before[1] * increment[0])


UNDERSAMPLING = gyro_effect(
    undersampling,
    EffectParameter("coefficient", "1", "c of c γ' × γ: what the increments lack, by those before them", 1.0),
    "the attitude computer leaves coning out: {coefficient:+.3g} of the product of two increments",
    places=(EffectPlace("undersampling", "attitude-computer"),),
    component="AttitudeComputer",
    stage="increment_effects",
    formula="Δγ = {coefficient} γ_before × γ",
)

EFFECTS = (
    BIAS,
    BIAS_DRIFT,
    SCALE_MISALIGNMENT,
    SCALE_ASYMMETRY,
    RATE_SQUARED,
    RATE_CUBED,
    G_SENSITIVITY,
    G_SQUARED,
    LATENCY,
    JITTER,
    UNDERSAMPLING,
)
