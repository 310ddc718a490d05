"""Angular motion whose Euler-Krylov angles are sums of harmonics, with its increments and its true attitude.

ψ turns about the body's second axis (up at the start), then ϑ about its third, then γ about its first:
λ = q₂(ψ) ∘ q₃(ϑ) ∘ q₁(γ). The rates are ω1 = γ' + ψ' sin ϑ, ω2 = ψ' cos ϑ cos γ + ϑ' sin γ,
ω3 = ϑ' cos γ - ψ' cos ϑ sin γ.

Source: Chelnokov, Perelyaev, Chelnokova 2016, section 3; the order of the turns is fitted to its published errors.
"""

import math

from .restricted import Vector
from .rotation import set_quaternion, to_body, turn

HARMONICS = 4
"""Harmonics of each angle."""

PHASE_OF_PIECE = 2.0
"""Longest piece of a step that one Gauss rule integrates, as phase of the motion's bandwidth [rad]."""

LONGEST_PHASE = 1e6
"""Longest step that is taken, as phase of the motion's bandwidth [rad]."""


def store_harmonics(
    axis: int, pi: float, amplitude: Vector, frequency: Vector, phase: Vector, harmonics: Vector
) -> float:
    """Write amplitudes, circular frequencies and phases of angle `axis` into `harmonics` (36,).

    Returns
    -------
    float
        bound of the circular frequencies [rad/s] that this angle brings into the rates
    """
    bandwidth = 0.0
    for k in range(HARMONICS):
        at = 3 * (HARMONICS * axis + k)
        harmonics[at] = amplitude[k]
        harmonics[at + 1] = 2.0 * pi * frequency[k]
        harmonics[at + 2] = phase[k]
        if amplitude[k] != 0.0:
            bandwidth = bandwidth + math.fabs(harmonics[at + 1]) * (1.0 + math.fabs(amplitude[k]))
    return bandwidth


def move_harmonically(time: float, harmonics: Vector, angle: Vector, angle_rate: Vector, rate: Vector) -> None:
    """Write the angles ψ, ϑ, γ (3,), their rates (3,) and the body's angular rate (3,) at `time`."""
    for axis in range(3):
        angle[axis] = 0.0
        angle_rate[axis] = 0.0
        for k in range(HARMONICS):
            at = 3 * (HARMONICS * axis + k)
            if harmonics[at] != 0.0:
                argument = harmonics[at + 1] * time + harmonics[at + 2]
                angle[axis] = angle[axis] + harmonics[at] * math.sin(argument)
                angle_rate[axis] = angle_rate[axis] + harmonics[at] * harmonics[at + 1] * math.cos(argument)
    across = angle_rate[0] * math.cos(angle[1])
    rate[0] = angle_rate[2] + angle_rate[0] * math.sin(angle[1])
    rate[1] = across * math.cos(angle[2]) + angle_rate[1] * math.sin(angle[2])
    rate[2] = angle_rate[1] * math.cos(angle[2]) - across * math.sin(angle[2])


def attitude_of_angles(angle: Vector, attitude: Vector, work: Vector) -> None:
    """Quaternion (4,) of the Euler-Krylov angles (3,)."""
    set_quaternion(1.0, 0.0, 0.0, 0.0, attitude)
    turn(attitude, 1, angle[0], work)
    turn(attitude, 2, angle[1], work)
    turn(attitude, 0, angle[2], work)


def integrate_by_trapezoid(
    time: float,
    step: float,
    count: int,
    harmonics: Vector,
    angle: Vector,
    angle_rate: Vector,
    rate: Vector,
    increment: Vector,
) -> None:
    """Write the increment (3,) over (time, time + step] by the trapezoid rule with `count` intervals."""
    piece = step / count
    for i in range(3):
        increment[i] = 0.0
    for node in range(count + 1):
        weight = piece
        if node == 0 or node == count:
            weight = 0.5 * piece
        move_harmonically(time + node * piece, harmonics, angle, angle_rate, rate)
        for i in range(3):
            increment[i] = increment[i] + weight * rate[i]


def integrate_exactly(
    time: float,
    step: float,
    count: int,
    harmonics: Vector,
    angle: Vector,
    angle_rate: Vector,
    rate: Vector,
    increment: Vector,
) -> None:
    """Write the increment (3,) over (time, time + step] by Gauss's rule of six nodes on each of `count` pieces."""
    piece = step / count
    for i in range(3):
        increment[i] = 0.0
    for part in range(count):
        middle = time + (part + 0.5) * piece
        for node in range(6):
            offset = 0.23861918608319690863
            weight = 0.46791393457269104739
            if node == 2 or node == 3:
                offset = 0.66120938646626451366
                weight = 0.36076157304813860757
            if node == 4 or node == 5:
                offset = 0.93246951420315202781
                weight = 0.17132449237917034504
            if node == 1 or node == 3 or node == 5:
                offset = -offset
            move_harmonically(middle + 0.5 * piece * offset, harmonics, angle, angle_rate, rate)
            for i in range(3):
                increment[i] = increment[i] + 0.5 * piece * weight * rate[i]


def initialise_motion(
    time: float,
    psi_amplitude: Vector,
    psi_frequency: Vector,
    psi_phase: Vector,
    theta_amplitude: Vector,
    theta_frequency: Vector,
    theta_phase: Vector,
    gamma_amplitude: Vector,
    gamma_frequency: Vector,
    gamma_phase: Vector,
    pi: float,
    trapezoid_nodes: float,
    step_samples: float,
    gravity: float,
    angle: Vector,
    rate: Vector,
    increment: Vector,
    specific_force: Vector,
    attitude: Vector,
    last_step: Vector,
    intervals: Vector,
    bandwidth: Vector,
    harmonics: Vector,
    angle_rate: Vector,
    work: Vector,
) -> int:
    """Begin at `time`; returns 0 or the number of a message."""
    intervals[0] = 0.0
    if trapezoid_nodes != 0.0:
        # M nodes over the whole step of the algorithm, as the paper has them: not over each increment.
        intervals[0] = (trapezoid_nodes - 1.0) / step_samples
        if not (intervals[0] >= 1.0 and intervals[0] == math.floor(intervals[0])):
            return 1
    bandwidth[0] = store_harmonics(0, pi, psi_amplitude, psi_frequency, psi_phase, harmonics)
    bandwidth[0] = bandwidth[0] + store_harmonics(1, pi, theta_amplitude, theta_frequency, theta_phase, harmonics)
    bandwidth[0] = bandwidth[0] + store_harmonics(2, pi, gamma_amplitude, gamma_frequency, gamma_phase, harmonics)
    last_step[0] = 0.0
    for i in range(3):
        increment[i] = 0.0
    move_harmonically(time, harmonics, angle, angle_rate, rate)
    attitude_of_angles(angle, attitude, work)
    to_body(attitude, 0.0, gravity, 0.0, specific_force)
    return 0


def step_motion(
    time: float,
    step: float,
    gravity: float,
    angle: Vector,
    rate: Vector,
    increment: Vector,
    specific_force: Vector,
    attitude: Vector,
    last_step: Vector,
    intervals: Vector,
    bandwidth: Vector,
    harmonics: Vector,
    angle_rate: Vector,
    work: Vector,
) -> int:
    """Move over (time, time + step]; returns 0 or the number of a message."""
    # Some masters end with a step of 1e-14 s: increments over it would mean nothing.
    if step <= 1e-9 * last_step[0]:
        return 0
    phase = bandwidth[0] * step
    if not phase <= LONGEST_PHASE:
        return 2
    last_step[0] = step
    if intervals[0] > 0.0:
        integrate_by_trapezoid(time, step, int(intervals[0]), harmonics, angle, angle_rate, rate, increment)
    else:
        pieces = 1 + int(math.floor(phase / PHASE_OF_PIECE))
        integrate_exactly(time, step, pieces, harmonics, angle, angle_rate, rate, increment)
    move_harmonically(time + step, harmonics, angle, angle_rate, rate)
    attitude_of_angles(angle, attitude, work)
    to_body(attitude, 0.0, gravity, 0.0, specific_force)
    return 0
