"""Moves of the table axes: as fast as a limit of the rate and a limit of the acceleration allow.

The plan of axis i stands at ``plan[9 * i]`` and on: time, angle and rate at its beginning, angle at its end, duration
of the change to the peak rate, of the cruise and of the braking [s], sense (+1, -1), peak rate [rad/s]. The motion of
axis i is ``motion[2 * i]`` (angle [rad]) and ``motion[2 * i + 1]`` (rate [rad/s]).
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
    # Where the axis would stop if it braked at once decides the sense.
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
        left = ended - elapsed
        motion[2 * axis] = plan[at + 3] - sense * 0.5 * max_acceleration * left * left
        motion[2 * axis + 1] = sense * max_acceleration * left
    else:
        motion[2 * axis] = plan[at + 3]
        motion[2 * axis + 1] = 0.0


def fastest_rate(plan: Vector, axis: int, time: float) -> float:
    """Bound of the rate [rad/s] of an axis from `time` on, until the next plan."""
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
    """Time [s] that a move over `distance` [rad] takes from rest to rest."""
    plan = [0.0] * (2 * AXIS_PLAN_SIZE)
    plan_move(plan, 0, 0.0, 0.0, 0.0, distance, max_rate, max_acceleration)
    return plan[4] + plan[5] + plan[6]
