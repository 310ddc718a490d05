"""Increments of the two-axis table: the block's angular rate against inertial space, integrated to rounding."""

import math

from ..motion import fastest_rate, follow_move, phase_ends
from ..restricted import ALPHA, BETA, HOURS, Vector
from ..rotation import to_body
from .geometry import attitude_in_base, geometry_effects, set_table_context

MAX_ANGLE_PER_QUADRATURE = 0.25
"""Longest turn [rad] that one five-point Gauss rule integrates to rounding."""
DIFFERENCE_ANGLE = 5e-3
"""Spacing [rad] of the differences of small turns by an angle: the sixth order errs by 1e-13 of a third harmonic."""
DIFFERENCE_HOURS = 1e-2
"""Spacing [h] of their differences by time."""


def add_angle_increment(
    motion: Vector,
    kappa: float,
    epsilon: float,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    weight: float,
    increment: Vector,
    attitude: Vector,
    vector: Vector,
    work: Vector,
) -> None:
    """Add `weight` [s] times the block's angular rate against inertial space, in block axes, to `increment` (3,)."""
    alpha_rate = motion[1]
    beta_rate = motion[3]
    across = alpha_rate * math.cos(epsilon)
    to_body(
        mounting_attitude,
        across * math.cos(motion[2]),
        -across * math.sin(motion[2]),
        alpha_rate * math.sin(epsilon) + beta_rate,
        vector,
    )
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]
    attitude_in_base(motion[0], motion[2], kappa, epsilon, mounting_attitude, attitude, work)
    to_body(attitude, earth_rate_in_base[0], earth_rate_in_base[1], earth_rate_in_base[2], vector)
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]


def find_turn_rates(
    motion: Vector, context: Vector, effect: Vector, shifted: Vector, turns: Vector, turn_rates: Vector
) -> None:
    """Rates (4,) [rad/s] of the small turns that effects add, by central differences of sixth order.

    `context` is that of the moment; `shifted` (2,) and `turns` (4,) are working space.
    """
    hours = context[HOURS]
    for i in range(4):
        turn_rates[i] = 0.0
    for variable in range(3):
        rate = 1.0 / 3600.0
        spacing = DIFFERENCE_HOURS
        if variable < 2:
            rate = motion[2 * variable + 1]
            spacing = DIFFERENCE_ANGLE
        if rate != 0.0:
            for node in range(6):
                # Nodes -3, -2, -1, 1, 2, 3 with the weights -1/60, 3/20, -3/4, 3/4, -3/20, 1/60.
                distance = node - 3
                if node > 2:
                    distance = node - 2
                weight = 0.75
                if node == 1 or node == 4:
                    weight = -0.15
                if node == 0 or node == 5:
                    weight = 1.0 / 60.0
                if node < 3:
                    weight = -weight
                shifted[0] = motion[0]
                shifted[1] = motion[2]
                context[HOURS] = hours
                if variable < 2:
                    shifted[variable] = shifted[variable] + distance * spacing
                else:
                    context[HOURS] = hours + distance * spacing
                context[ALPHA] = shifted[0]
                context[BETA] = shifted[1]
                geometry_effects(context, shifted, effect, turns)
                for i in range(4):
                    turn_rates[i] = turn_rates[i] + weight * rate / spacing * turns[i]


def add_turned_increment(
    motion: Vector,
    elapsed: float,
    temperature: float,
    kappa: float,
    epsilon: float,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    weight: float,
    effect: Vector,
    senses: Vector,
    increment: Vector,
    attitude: Vector,
    vector: Vector,
    work: Vector,
    context: Vector,
    shifted: Vector,
    turns: Vector,
    turn_rates: Vector,
) -> None:
    """`add_angle_increment` with the small turns that effects add, and their rates."""
    shifted[0] = motion[0]
    shifted[1] = motion[2]
    set_table_context(elapsed, temperature, shifted, senses, context)
    find_turn_rates(motion, context, effect, shifted, turns, turn_rates)
    shifted[0] = motion[0]
    shifted[1] = motion[2]
    set_table_context(elapsed, temperature, shifted, senses, context)
    geometry_effects(context, shifted, effect, turns)
    alpha = motion[0] + turns[1]
    beta = motion[2] + turns[3]
    lean = epsilon + turns[2]
    along = motion[1] + turn_rates[1]
    down = -turn_rates[0] * math.sin(alpha)
    first = along * math.cos(lean) - down * math.sin(lean)
    second = turn_rates[0] * math.cos(alpha) + turn_rates[2]
    third = along * math.sin(lean) + down * math.cos(lean)
    to_body(
        mounting_attitude,
        first * math.cos(beta) + second * math.sin(beta),
        second * math.cos(beta) - first * math.sin(beta),
        third + motion[3] + turn_rates[3],
        vector,
    )
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]
    attitude_in_base(alpha, beta, kappa + turns[0], lean, mounting_attitude, attitude, work)
    to_body(attitude, earth_rate_in_base[0], earth_rate_in_base[1], earth_rate_in_base[2], vector)
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]


def integrate_increment(
    begin: float,
    end: float,
    temperature: float,
    plan: Vector,
    alpha_shift: float,
    beta_shift: float,
    kappa: float,
    epsilon: float,
    max_acceleration: Vector,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    effect: Vector,
    start: Vector,
    senses: Vector,
    increment: Vector,
    motion: Vector,
    times: Vector,
    attitude: Vector,
    vector: Vector,
    work: Vector,
    context: Vector,
    shifted: Vector,
    turns: Vector,
    turn_rates: Vector,
) -> None:
    """Integrate the block's angular rate over (begin, end] into `increment` (3,) [rad].

    Gauss rules with five points between the ends of the phases of the moves, none over more than a quarter of a
    radian: the increments are exact to rounding at any step size.
    """
    for i in range(3):
        increment[i] = 0.0
    shifted[0] = 0.0
    shifted[1] = 0.0
    set_table_context(0.0, temperature, shifted, senses, context)
    turned = geometry_effects(context, shifted, effect, turns)
    count = phase_ends(plan, begin, end, times)
    for k in range(count - 1):
        duration = times[k + 1] - times[k]
        fastest = fastest_rate(plan, 0, times[k]) + fastest_rate(plan, 1, times[k])
        pieces = 1 + int(math.floor(duration * fastest / MAX_ANGLE_PER_QUADRATURE))
        piece = duration / pieces
        for j in range(pieces):
            middle = times[k] + (j + 0.5) * piece
            for node in range(5):
                offset = 0.0
                weight = 128.0 / 225.0
                if node == 1 or node == 2:
                    offset = 0.53846931010568309
                    weight = 0.47862867049936647
                if node == 3 or node == 4:
                    offset = 0.90617984593866399
                    weight = 0.23692688505618909
                if node == 1 or node == 3:
                    offset = -offset
                moment = middle + 0.5 * piece * offset
                follow_move(plan, 0, max_acceleration[0], moment, motion)
                follow_move(plan, 1, max_acceleration[1], moment, motion)
                motion[0] = motion[0] - alpha_shift
                motion[2] = motion[2] - beta_shift
                if turned > 0.0:
                    add_turned_increment(
                        motion,
                        moment - start[0],
                        temperature,
                        kappa,
                        epsilon,
                        mounting_attitude,
                        earth_rate_in_base,
                        0.5 * piece * weight,
                        effect,
                        senses,
                        increment,
                        attitude,
                        vector,
                        work,
                        context,
                        shifted,
                        turns,
                        turn_rates,
                    )
                else:
                    add_angle_increment(
                        motion,
                        kappa,
                        epsilon,
                        mounting_attitude,
                        earth_rate_in_base,
                        0.5 * piece * weight,
                        increment,
                        attitude,
                        vector,
                        work,
                    )
