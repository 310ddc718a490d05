"""Commands of a two-axis table, and the motion of its axes: moves, programmes of positions, feedback.

Moves are as fast as the limits of rate and acceleration allow. The plan of axis i begins at ``plan[9 * i]``: time,
angle and rate at its beginning, angle at its end; duration of the change to the peak rate, of the cruise and of the
braking [s]; sense (+1, -1), peak rate [rad/s]. The motion of axis i is ``motion[2 * i]`` (angle [rad]) and ``motion[2 *
i + 1]`` (rate [rad/s]).

A position programme commands one position after the other. Each position has a slot: the move to it from the previous
position and the dwell. The move is as fast as the limits of the slower axis allow; the dwell is rounded up to whole
steps. A command holds over a whole slot.

The controller feeds a computed attitude back to the commands: the block holds its attitude in space. The rotation
vector from the initial to the computed attitude, seen along each axis of the table, turns that axis back at a rate of
the gain times the error. The part that neither axis can turn remains.
"""

import math

from .restricted import Vector

AXIS_PLAN_SIZE = 9


def plan_move(
    plan: Vector,
    axis: int,
    time: float,
    angle: float,
    rate: float,
    end: float,
    max_rate: float,
    max_acceleration: float,
) -> None:
    """Plan the fastest move of an axis from `angle` and `rate` at `time` to rest at `end`.

    Parameters
    ----------
    plan : (18,)
        overwritten for this axis
    axis : int
        0 outer, 1 inner
    max_rate, max_acceleration : float
        limits [rad/s], [rad/s²], positive
    """
    at = AXIS_PLAN_SIZE * axis
    distance = end - angle
    # The stopping point of an immediate braking decides the sense.
    sense = 1.0
    if distance - 0.5 * rate * math.fabs(rate) / max_acceleration < 0.0:
        sense = -1.0
    forward = sense * rate
    peak = math.sqrt(math.fabs(max_acceleration * sense * distance + 0.5 * forward * forward))
    cruise = 0.0
    if peak > max_rate:
        peak = max_rate
        covered = (peak * peak - 0.5 * forward * forward) / max_acceleration
        if forward > peak:
            covered = 0.5 * forward * forward / max_acceleration
        cruise = (sense * distance - covered) / peak
        if cruise < 0.0:
            cruise = 0.0
    plan[at] = time
    plan[at + 1] = angle
    plan[at + 2] = rate
    plan[at + 3] = end
    plan[at + 4] = math.fabs(peak - forward) / max_acceleration
    plan[at + 5] = cruise
    plan[at + 6] = peak / max_acceleration
    plan[at + 7] = sense
    plan[at + 8] = peak


def follow_move(plan: Vector, axis: int, max_acceleration: float, time: float, motion: Vector) -> None:
    """Write the angle and the rate of an axis at `time` into `motion` (4,)."""
    at = AXIS_PLAN_SIZE * axis
    elapsed = time - plan[at]
    sense = plan[at + 7]
    peak = plan[at + 8]
    forward = sense * plan[at + 2]
    acceleration = max_acceleration
    if forward > peak:
        acceleration = -max_acceleration
    changed = plan[at + 4]
    cruised = changed + plan[at + 5]
    ended = cruised + plan[at + 6]
    if elapsed < changed:
        motion[2 * axis] = plan[at + 1] + sense * (forward + 0.5 * acceleration * elapsed) * elapsed
        motion[2 * axis + 1] = sense * (forward + acceleration * elapsed)
    elif elapsed < cruised:
        covered = 0.5 * (forward + peak) * changed + peak * (elapsed - changed)
        motion[2 * axis] = plan[at + 1] + sense * covered
        motion[2 * axis + 1] = sense * peak
    elif elapsed < ended:
        remaining = ended - elapsed
        motion[2 * axis] = plan[at + 3] - sense * 0.5 * max_acceleration * remaining * remaining
        motion[2 * axis + 1] = sense * max_acceleration * remaining
    else:
        motion[2 * axis] = plan[at + 3]
        motion[2 * axis + 1] = 0.0


def fastest_rate(plan: Vector, axis: int, time: float) -> float:
    """Return a bound of the rate [rad/s] of an axis from `time` on, until the next plan."""
    at = AXIS_PLAN_SIZE * axis
    if time >= plan[at] + plan[at + 4] + plan[at + 5] + plan[at + 6]:
        return 0.0
    return math.fabs(plan[at + 2]) + plan[at + 8]


def phase_ends(plan: Vector, begin: float, end: float, times: Vector) -> int:
    """Write `begin`, the times between at which a phase of a move ends, and `end`, in order; return how many.

    Parameters
    ----------
    times : (8,)
        overwritten; between two of them the angles are smooth
    """
    count = 1
    times[0] = begin
    for axis in range(2):
        at = AXIS_PLAN_SIZE * axis
        moment = plan[at]
        for phase in range(3):
            moment = moment + plan[at + 4 + phase]
            if moment > begin and moment < end:
                place = count
                while place > 1 and times[place - 1] > moment:
                    times[place] = times[place - 1]
                    place = place - 1
                times[place] = moment
                count = count + 1
    times[count] = end
    return count + 1


def move_duration(distance: float, max_rate: float, max_acceleration: float) -> float:
    """Return the time [s] of a move over `distance` [rad] from rest to rest."""
    plan = [0.0] * (2 * AXIS_PLAN_SIZE)
    plan_move(plan, 0, 0.0, 0.0, 0.0, distance, max_rate, max_acceleration)
    return plan[4] + plan[5] + plan[6]


POSITIONS = 128
"""Largest number of positions of a programme."""

LONGEST_SLOT = 1e9
"""Longest accepted slot [steps]."""

TICK_TOLERANCE = 1e-9
"""Excess of a slot over whole steps below which no further step is taken for it [steps]."""

TIME_TOLERANCE = 1e-3
"""Largest distance of a host's time from a whole number of steps [steps]: hosts add up rounded times."""


def initialise_programme(
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


def step_programme(
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
    """Command the position that holds over (time, time + step], or from time + step on; return 0 or a message's
    number."""
    # Some masters end with a step of 1e-14 s.
    if step <= 1e-9 * last_step[0]:
        return 0
    last_step[0] = step
    count = int(positions)
    if length[0] == 0.0:
        length[0] = period
        if period == 0.0:
            length[0] = step
        # Slots begin at whole steps; the last one ends at the last of them.
        begins[0] = 0.0
        before_alpha = initial_angle[0]
        before_beta = initial_angle[1]
        for i in range(count):
            plan_move(plan, 0, 0.0, 0.0, 0.0, math.fabs(alpha[i] - before_alpha), max_rate[0], max_acceleration[0])
            plan_move(plan, 1, 0.0, 0.0, 0.0, math.fabs(beta[i] - before_beta), max_rate[1], max_acceleration[1])
            move = plan[4] + plan[5] + plan[6]
            slower = plan[13] + plan[14] + plan[15]
            if slower > move:
                move = slower
            slot = (move + dwell_time[i]) / length[0]
            if not slot <= LONGEST_SLOT:
                length[0] = 0.0
                return 1
            begins[i + 1] = begins[i] - (0.0 + math.floor(0.0 - (slot - TICK_TOLERANCE)))
            before_alpha = alpha[i]
            before_beta = beta[i]
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


def initialise_rows(
    time: float, size: Vector, table: Vector, value: Vector, start: Vector, last_step: Vector, row: Vector
) -> int:
    """Begin at `time` with the first row; `size` (2,) are the numbers of rows and of columns. Returns 0."""
    start[0] = time
    last_step[0] = 0.0
    row[0] = 0.0
    columns = int(size[1])
    for k in range(columns):
        value[k] = table[k]
    return 0


def step_rows(
    time: float,
    step: float,
    period: float,
    lead_steps: float,
    size: Vector,
    begins: Vector,
    table: Vector,
    value: Vector,
    start: Vector,
    last_step: Vector,
    row: Vector,
) -> int:
    """Give the row that holds over (time, time + step], or from time + step on; returns 0.

    Row i holds from `begins[i]` periods after the start; its values are in `table`, row by row.
    """
    # Some masters end with a step of 1e-14 s.
    if step <= 1e-9 * last_step[0]:
        return 0
    last_step[0] = step
    passed = (time - start[0]) / period + TIME_TOLERANCE
    if lead_steps > 0.0:
        passed = (time + step - start[0]) / period + TIME_TOLERANCE
    at = int(row[0])
    last = int(size[0]) - 1
    while at < last and begins[at + 1] <= passed:
        at = at + 1
    row[0] = float(at)
    columns = int(size[1])
    for k in range(columns):
        value[k] = table[columns * at + k]
    return 0


NORM_TOLERANCE = 1e-3


def square(quaternion: Vector) -> float:
    """Return the square of the norm of a quaternion (4,)."""
    total = 0.0
    for k in range(4):
        total = total + quaternion[k] * quaternion[k]
    return total


def initialise_controller(initial_command: Vector, initial_attitude: Vector, held: Vector, command: Vector) -> int:
    """Begin with the table at its position; return 1 if the initial attitude is not a unit quaternion."""
    if not math.fabs(square(initial_attitude) - 1.0) <= 2.0 * NORM_TOLERANCE:
        return 1
    for axis in range(2):
        held[axis] = initial_command[axis]
        command[axis] = held[axis]
    return 0


def step_controller(
    attitude: Vector,
    inner_angle: float,
    initial_attitude: Vector,
    gain: float,
    held: Vector,
    command: Vector,
    step: float,
) -> int:
    """Turn both commands back by the block's error of attitude.

    Parameters
    ----------
    attitude, initial_attitude : (4,)
        body to reference, scalar first; the body's axis 3 is the inner axis
    inner_angle : float
        angle of the inner axis [rad]: direction of the outer axis in the body
    gain : float
        gain [1/s]
    held, command : (2,)
        commands [rad], changed
    step : float
        length of the step [s]

    Returns
    -------
    int
        2 if the attitude is zero or not finite, else 0
    """
    norm = math.sqrt(square(attitude))
    if not norm > 0.0:
        return 2
    if norm - norm != 0.0:
        return 2
    # Vector part of conj(initial) ∘ attitude: half the rotation vector, to third order.
    x = initial_attitude[0] * attitude[1] - initial_attitude[1] * attitude[0]
    x = x - initial_attitude[2] * attitude[3] + initial_attitude[3] * attitude[2]
    y = initial_attitude[0] * attitude[2] - initial_attitude[2] * attitude[0]
    y = y - initial_attitude[3] * attitude[1] + initial_attitude[1] * attitude[3]
    z = initial_attitude[0] * attitude[3] - initial_attitude[3] * attitude[0]
    z = z - initial_attitude[1] * attitude[2] + initial_attitude[2] * attitude[1]
    scalar = 0.0
    for k in range(4):
        scalar = scalar + initial_attitude[k] * attitude[k]
    twice = 2.0 / norm
    if scalar < 0.0:
        twice = -twice
    share = gain * step
    # The outer axis in body axes is (cos β, −sin β, 0).
    held[0] = held[0] - share * twice * (x * math.cos(inner_angle) - y * math.sin(inner_angle))
    held[1] = held[1] - share * twice * z
    for axis in range(2):
        command[axis] = held[axis]
    return 0
