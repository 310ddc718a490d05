"""Position programmes: which commanded position holds when.

Each position has a slot: the move to it from the position before, as fast as the limits of the slower axis allow, and
the dwell, rounded up to whole steps. A command holds over a whole slot.
"""

import math

from .motion import plan_move
from .restricted import Vector

POSITIONS = 128
"""Most positions of a programme."""

LONGEST_SLOT = 1e9
"""Longest slot that is taken [steps]."""

TICK_TOLERANCE = 1e-9
"""What a slot may be longer than whole steps without a further step being taken for it [steps]."""

TIME_TOLERANCE = 1e-3
"""How far a host's time may be off a whole number of steps [steps]: hosts add up rounded times."""


def lay_out(
    positions: float,
    alpha: Vector,
    beta: Vector,
    dwell_time: Vector,
    max_rate: Vector,
    max_acceleration: Vector,
    initial_angle: Vector,
    length: float,
    begins: Vector,
    plan: Vector,
) -> int:
    """Write the step at which each slot begins, and at which the last one ends, into `begins` (129,).

    Parameters
    ----------
    positions : float
        how many there are
    length : float
        of a step [s]

    Returns
    -------
    int
        0, or 1 where a slot is longer than `LONGEST_SLOT`
    """
    count = int(positions)
    begins[0] = 0.0
    before_alpha = initial_angle[0]
    before_beta = initial_angle[1]
    for i in range(count):
        plan_move(plan, 0, 0.0, 0.0, 0.0, math.fabs(alpha[i] - before_alpha), max_rate[0], max_acceleration[0])
        plan_move(plan, 1, 0.0, 0.0, 0.0, math.fabs(beta[i] - before_beta), max_rate[1], max_acceleration[1])
        move = plan[4] + plan[5] + plan[6]
        other = plan[13] + plan[14] + plan[15]
        if other > move:
            move = other
        slot = (move + dwell_time[i]) / length
        if not slot <= LONGEST_SLOT:
            return 1
        begins[i + 1] = begins[i] - (0.0 + math.floor(0.0 - (slot - TICK_TOLERANCE)))
        before_alpha = alpha[i]
        before_beta = beta[i]
    return 0


def initialise(
    time: float,
    positions: float,
    alpha: Vector,
    beta: Vector,
    command: Vector,
    position: Vector,
    finished: Vector,
    start: Vector,
    last_step: Vector,
    length: Vector,
) -> int:
    """Begin at `time` with the first position; returns 0."""
    start[0] = time
    last_step[0] = 0.0
    length[0] = 0.0
    command[0] = alpha[0]
    command[1] = beta[0]
    position[0] = 1.0
    finished[0] = 0.0
    return 0


def step(
    time: float,
    step: float,
    positions: float,
    alpha: Vector,
    beta: Vector,
    dwell_time: Vector,
    max_rate: Vector,
    max_acceleration: Vector,
    initial_angle: Vector,
    period: float,
    lead_steps: float,
    command: Vector,
    position: Vector,
    finished: Vector,
    start: Vector,
    last_step: Vector,
    length: Vector,
    begins: Vector,
    plan: Vector,
) -> int:
    """Command what holds over (time, time + step], or from time + step on; returns 0 or the number of a message."""
    # Some masters end with a step of 1e-14 s.
    if step <= 1e-9 * last_step[0]:
        return 0
    last_step[0] = step
    if length[0] == 0.0:
        length[0] = period
        if period == 0.0:
            length[0] = step
        too_long = lay_out(
            positions,
            alpha,
            beta,
            dwell_time,
            max_rate,
            max_acceleration,
            initial_angle,
            length[0],
            begins,
            plan,
        )
        if too_long == 1:
            length[0] = 0.0
            return 1
    count = int(positions)
    passed = (time - start[0]) / length[0] + TIME_TOLERANCE
    ended = (time + step - start[0]) / length[0] + TIME_TOLERANCE
    if lead_steps > 0.0:
        passed = ended
    at = int(position[0])
    while at < count and begins[at] <= passed:
        at = at + 1
    position[0] = float(at)
    command[0] = alpha[at - 1]
    command[1] = beta[at - 1]
    if begins[count] <= ended:
        finished[0] = 1.0
    return 0
