"""Motions for attitude algorithms with their exact attitudes, errors on them, and the operations of an algorithm.

Operations are counted by running an algorithm's kernel on numbers that count.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np

from trihedron.models.attitude_algorithms import PRODUCTS, Algorithm
from trihedron.models.attitude_algorithms.computer import TABLE_SIZE, prepare_update
from trihedron.models.attitude_algorithms.iteration import SPACE_SIZE
from trihedron.models.rotation import multiply
from trihedron.tools.motion import angle_between, attitudes_of_angles, rotation_of, run_algorithm, sample_motion
from trihedron.tools.papers import EXACT, paper_motion

COSTLY = 10
"""Cost of a division, root, sine, cosine or arctangent, in additions or multiplications."""
CONE = math.radians(1.0)
"""Half angle of the coning motion [rad]."""


@dataclass(frozen=True)
class Course:
    """A motion sampled by exact gyros: increments (N, 3) [rad], attitudes (N, 4) against that at the beginning."""

    increments: np.ndarray
    attitudes: np.ndarray

    def error(self, algorithm: Algorithm) -> float:
        """Return the largest angle between an algorithm's attitudes and the true ones [rad]."""
        computed = run_algorithm(algorithm, self.increments, renormalise=True)
        ends = algorithm.samples * np.arange(1, len(computed) + 1)
        return float(angle_between(computed, self.attitudes[ends - 1]).max())


def course_of_harmonics(harmonics: np.ndarray, rate_hz: float, duration_s: float) -> Course:
    """Return a harmonic motion (36,) with increments and attitudes exact to rounding."""
    samples = sample_motion(harmonics, 1.0 / rate_hz, round(rate_hz * duration_s))
    axes = harmonics.reshape(3, -1, 3)
    first = (axes[:, :, 0] * np.sin(axes[:, :, 2])).sum(axis=1)
    begin = rotation_of(attitudes_of_angles(first[None]))
    true = rotation_of(attitudes_of_angles(samples.angles))
    return Course(samples.increments, np.roll((begin[0].inv() * true).as_quat(), 1, axis=1))


def cone(half_angle: float, frequency: float) -> np.ndarray:
    """Return the harmonics (36,) of a cone, half angle [rad] and frequency [Hz]: ϑ = A sin Ωt, γ = A cos Ωt - A."""
    turning = 2.0 * math.pi * frequency
    harmonics = np.zeros((3, 4, 3))
    harmonics[1, 0] = half_angle, turning, 0.0
    harmonics[2, 0] = half_angle, turning, 0.5 * math.pi
    harmonics[2, 1] = -half_angle, 0.0, 0.5 * math.pi
    return harmonics.reshape(-1)


def paper_error(algorithm: Algorithm, motion: str, rate_hz: float, duration_s: float = 60.0) -> float:
    """Return the largest error of an algorithm on a motion of the paper [rad]; increments are exact."""
    samples = sample_motion(paper_motion(motion, EXACT), 1.0 / rate_hz, round(duration_s * rate_hz))
    true = attitudes_of_angles(samples.angles_at_steps(algorithm))
    return float(angle_between(run_algorithm(algorithm, samples.increments, renormalise=True), true).max())


def relative_coning_drift(algorithm: Algorithm, phase: float) -> float:
    """Return the remaining drift of an algorithm under pure coning, as a fraction of the drift to compute.

    `phase` is Ω Δt of one gyro sample [rad]. Each update errs by the same rotation in a frame that turns with the cone,
    so the error's component along the axis of the cone is the drift.
    """
    samples = algorithm.samples
    windows = 3
    u = phase * np.arange(windows * samples + 1)
    sine, slow = math.sin(CONE), 2.0 * math.sin(0.5 * CONE) ** 2
    # λ = (cos(a/2), 0, sin(a/2) cos Ωt, sin(a/2) sin Ωt); ω = 2 λ* ∘ dλ/dt
    # = Ω (-(1 - cos a), -sin a sin Ωt, sin a cos Ωt).
    integral = np.column_stack((-slow * u, sine * np.cos(u), sine * np.sin(u)))
    attitudes = run_algorithm(algorithm, np.diff(integral, axis=0))
    half = 0.5 * CONE
    at = u[::samples]
    true = np.column_stack(
        (np.full(len(at), math.cos(half)), np.zeros(len(at)), math.sin(half) * np.cos(at), math.sin(half) * np.sin(at))
    )
    before, after = attitudes[-2] / np.linalg.norm(attitudes[-2]), attitudes[-1] / np.linalg.norm(attitudes[-1])
    computed = _times(_conjugate(before), after)
    expected = _times(_conjugate(true[-2]), true[-1])
    # The error of one update in the reference frame: λ_n ∘ error ∘ λ_n*.
    error = _times(_times(true[-1], _times(_conjugate(expected), computed)), _conjugate(true[-1]))
    return abs(2.0 * float(error[1])) / (slow * phase * samples)


def _conjugate(q: np.ndarray) -> np.ndarray:
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def _times(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *vector])


def operations_per_sample(algorithm: Algorithm, increments: np.ndarray) -> float:
    """Return the operations for each gyro sample, mean over three places of a motion: some algorithms read the
    increments."""
    size = 2 * algorithm.samples
    begins = np.linspace(0, len(increments) - size, 4).astype(int)[1:]
    counts = [operations_of_update(algorithm, increments[begin : begin + size]) for begin in begins]
    return sum(counts) / len(counts) / algorithm.samples


def operations_of_update(algorithm: Algorithm, increments: np.ndarray) -> int:
    """Return the operations of one step of an algorithm and of the quaternion product that follows it.

    Parameters
    ----------
    increments : ndarray, shape (2 * samples, 3)
        increments of the previous step and of this one [rad]: some algorithms depend on them
    """
    tally = [0]
    number = _counting_number(tally)
    table = [0.0] * TABLE_SIZE
    prepare_update(float(algorithm.number), list(PRODUCTS), table)
    values = [number(value) for value in np.asarray(increments).reshape(-1)]
    half = 3 * algorithm.samples
    arguments: dict[str, Any] = {
        "previous": values[:half],
        "known": 1.0,
        "g": values[half:],
        "count": algorithm.samples,
        "first": 0,
        "table": table,
        "turned": [number(0.0)] * 4,
        "part": [number(0.0)] * 4,
        "products": table,
        "weighted": [number(0.0)] * 4,
    }
    kernel = algorithm.kernel
    names = kernel.__code__.co_varnames[: kernel.__code__.co_argcount]
    _counting(kernel, tally)(*(arguments[name] if name in arguments else [number(0.0)] * SPACE_SIZE for name in names))
    attitude = [number(1.0), number(0.0), number(0.0), number(0.0)]
    multiply(attitude, arguments["turned"], attitude)
    return tally[0]


def _counting_number(tally: list[int]) -> type[float]:
    """A float whose arithmetic is counted; results count too."""

    def counted(operation: Callable[[float, float], float], cost: int) -> Callable[[float, float], float]:
        def apply(a: float, b: float) -> float:
            tally[0] += cost
            return Number(operation(float(a), float(b)))

        return apply

    class Number(float):
        __add__ = __radd__ = counted(lambda a, b: a + b, 1)
        __sub__ = counted(lambda a, b: a - b, 1)
        __rsub__ = counted(lambda a, b: b - a, 1)
        __mul__ = __rmul__ = counted(lambda a, b: a * b, 1)
        __truediv__ = counted(lambda a, b: a / b, COSTLY)
        __rtruediv__ = counted(lambda a, b: b / a, COSTLY)

    return Number


def _counting(kernel: Any, tally: list[int]) -> FunctionType:
    """Return the kernel with counted functions of `math`, in all its calls."""

    def counted(function: Callable[..., float]) -> Callable[..., float]:
        def apply(*arguments: float) -> float:
            tally[0] += COSTLY
            return function(*arguments)

        return apply

    functions = {name: counted(getattr(math, name)) for name in ("sqrt", "sin", "cos", "atan2")}
    replaced = SimpleNamespace(**functions, floor=math.floor, fabs=math.fabs, pi=math.pi)
    names = {name: kernel.__globals__[name] for name in kernel.__code__.co_names if name in kernel.__globals__}
    for name, value in names.items():
        if name == "math":
            names[name] = replaced
        elif isinstance(value, FunctionType):
            names[name] = _counting(value, tally)
    return FunctionType(kernel.__code__, names, kernel.__name__)
