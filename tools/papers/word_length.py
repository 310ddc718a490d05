"""What limited word length costs: 32-bit arithmetic and 32-bit increments against 64-bit ones, for the update (22).

The arithmetics: plain, carrying 1 - λ0*, compensated, and with pairs of 32-bit numbers. A pair is an unevaluated sum of
two 32-bit numbers; sums and products of pairs are the error-free ones of Knuth and Dekker, made of 32-bit operations
alone.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Literal

import numba
import numpy as np
from pydantic import Field

from ..motion.attitude import algorithm_named, angle_between
from ..motion.compare import run_algorithm, sample_motion
from ..progress import progress_bar
from ..result import Result
from .attitude import EXACT, paper_motion

ARITHMETICS = ("single", "carried", "compensated", "pairs")
"""How the attitude is carried.

single: λ ∘ λ*, everything in 32 bits. carried: λ + λ ∘ (-(1 - λ0*), λv*), everything in 32 bits. compensated: the same,
with the low part of λ kept. pairs: the same, with λv* a pair and the products error-free.
"""

ZERO, QUARTER, SIXTH, ONE, TWO = (np.float32(value) for value in (0.0, 0.25, 1.0 / 6.0, 1.0, 2.0))
CUBIC = np.float32(1.0 / 48.0)
SPLITTER = np.float32(4097.0)
"""2^12 + 1: splits the 24 bits of a mantissa into halves."""
ROUNDINGS = ("independently", "feedback", "pairs")
"""How increments become 32-bit numbers: each rounded by itself; the rounding error of one added to the next; as the sum
of two 32-bit numbers."""

DOUBLE = "double"
"""64-bit arithmetic on the same rounded increments: what is left is the increments' own error."""

REPEATING, INCOMMENSURATE = "repeating", "incommensurate"
FREQUENCY_FACTORS = (1.01234567, 1.02430827, 1.02718280)
"""Make the frequencies of ψ, ϑ, γ incommensurate with each other and with the samples."""


class WordLengthError(Result):
    """Largest angle between an attitude in short words and the 64-bit one.

    Attributes
    ----------
    motion : str
        `REPEATING`: variant 1 of Table 1, which repeats exactly after 2 s; `INCOMMENSURATE`: it never repeats
    arithmetic : str
        one of `ARITHMETICS`, or `DOUBLE`
    rounding : str
        one of `ROUNDINGS`
    error : float
        [rad]
    """

    motion: str
    arithmetic: str
    rounding: str
    error: float


class WordLength(Result):
    """The errors of every arithmetic and every rounding of the increments."""

    schema_: Literal["trihedron.word-length/1"] = Field(default="trihedron.word-length/1", alias="schema")
    errors: tuple[WordLengthError, ...] = Field(alias="errors_rad")


def rounded_increments(increments: np.ndarray, rounding: str) -> tuple[np.ndarray, np.ndarray]:
    """Increments (N, 3) [rad] as 32-bit numbers, high and low, by one of `ROUNDINGS`; low is zero but for pairs."""
    high = increments.astype(np.float32)
    low = np.zeros_like(high)
    if rounding == "pairs":
        low = (increments - high).astype(np.float32)
    elif rounding == "feedback":
        _feedback()(np.ascontiguousarray(increments, dtype=np.float64), high)
    return high, low


def word_length_errors(
    duration: float = 600.0,
    period: float = 1e-3,
    motions: Sequence[str] = (REPEATING, INCOMMENSURATE),
    arithmetics: Sequence[str] = (*ARITHMETICS, DOUBLE),
    *,
    progress: bool = False,
) -> WordLength:
    """Errors of update (22) on variant 1 of Table 1, for every arithmetic and every rounding of the increments.

    Parameters
    ----------
    duration, period : float
        length of the run and gyro sample period [s]
    motions, arithmetics : sequence of str
        which ones
    progress : bool
        show a bar where standard error is a terminal
    """
    found = []
    algorithm = algorithm_named("two-sample-rodrigues")
    steps = len(motions) * len(ROUNDINGS) * len(arithmetics)
    with progress_bar("running in short words", steps, show=progress) as advance:
        for motion in motions:
            exact = _increments(motion, duration, period)
            reference = run_algorithm(algorithm, exact)
            for rounding in ROUNDINGS:
                high, low = rounded_increments(exact, rounding)
                for arithmetic in arithmetics:
                    if arithmetic == DOUBLE:
                        attitudes = run_algorithm(algorithm, high.astype(np.float64) + low)
                    else:
                        attitudes = run_single(high, low, arithmetic)
                    error = float(angle_between(attitudes, reference).max())
                    found.append(WordLengthError(motion=motion, arithmetic=arithmetic, rounding=rounding, error=error))
                    advance(1)
    return WordLength(errors_rad=tuple(found))


def _increments(motion: str, duration: float, period: float) -> np.ndarray:
    harmonics = paper_motion("1", EXACT)
    if motion == INCOMMENSURATE:
        axes = harmonics.reshape(3, -1, 3)
        axes[:, :, 1] *= np.array(FREQUENCY_FACTORS)[:, None]
    return sample_motion(harmonics, period, round(duration / period)).increments


def run_single(high: np.ndarray, low: np.ndarray, arithmetic: str) -> np.ndarray:
    """Attitudes (N // 2, 4) at every second sample from increments high + low (N, 3) [rad], by one of `ARITHMETICS`.

    Quaternions, scalar first, as the 32-bit numbers have them: nothing renormalises them.
    """
    attitudes = np.empty((len(high) // 2, 4))
    _runner()(high.astype(np.float32), low.astype(np.float32), ARITHMETICS.index(arithmetic), attitudes)
    return attitudes


@cache
def _feedback() -> Callable[..., Any]:
    """What writes 32-bit increments (N, 3): the rounding error of each is added to the next."""

    @numba.njit(nogil=True)
    def round_all(increments, rounded):
        for i in range(increments.shape[1]):
            carried = 0.0
            for k in range(len(increments)):
                carried = carried + increments[k, i]
                rounded[k, i] = np.float32(carried)
                carried = carried - np.float64(rounded[k, i])

    return round_all


@cache
def _runner() -> Callable[..., Any]:
    compile_ = numba.njit(nogil=True, error_model="numpy")

    @compile_
    def two_sum(a, b):
        total = a + b
        part = total - a
        return total, (a - (total - part)) + (b - part)

    @compile_
    def split(a):
        big = SPLITTER * a
        high = big - (big - a)
        return high, a - high

    @compile_
    def two_product(a, b):
        product = a * b
        a1, a2 = split(a)
        b1, b2 = split(b)
        return product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2

    @compile_
    def rodrigues(high, low, k, x, x_low):
        """x of (22) as a pair: the sum of the increments is exact, the small terms are single."""
        a, b = high[k], high[k + 1]
        first = CUBIC * (a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        second = CUBIC * (b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            total, rest = two_sum(a[i], b[i])
            rest = rest + (low[k, i] + low[k + 1, i])
            small = first * a[i] + second * b[i] + SIXTH * (a[j] * b[m] - a[m] * b[j])
            x[i], x_low[i] = two_sum(QUARTER * total, QUARTER * rest + small)

    @compile_
    def product(q, v, d):
        """d = q ∘ v in single."""
        d0 = q[0] * v[0] - q[1] * v[1] - q[2] * v[2] - q[3] * v[3]
        d1 = q[0] * v[1] + q[1] * v[0] + q[2] * v[3] - q[3] * v[2]
        d2 = q[0] * v[2] - q[1] * v[3] + q[2] * v[0] + q[3] * v[1]
        d3 = q[0] * v[3] + q[1] * v[2] - q[2] * v[1] + q[3] * v[0]
        d[0], d[1], d[2], d[3] = d0, d1, d2, d3

    @compile_
    def add_product(sign, q, q_low, v, v_low, d, d_low):
        """Add ± q v to the pair d, without an error in the leading product."""
        leading, error = two_product(q, v)
        total, rest = two_sum(d, sign * leading)
        return total, d_low + (rest + sign * (error + (q * v_low + q_low * v)))

    @compile_
    def pair_product(q, q_low, v, v_low, d, d_low):
        """d = q ∘ v in pairs; component 0 of v is a single number."""
        left = ((0, 1, 2, 3), (0, 1, 2, 3), (0, 1, 2, 3), (0, 1, 2, 3))
        right = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0))
        signs = ((ONE, -ONE, -ONE, -ONE), (ONE, ONE, ONE, -ONE), (ONE, -ONE, ONE, ONE), (ONE, ONE, -ONE, ONE))
        for i in range(4):
            total, rest = ZERO, ZERO
            for j in range(4):
                a, b = left[i][j], right[i][j]
                total, rest = add_product(signs[i][j], q[a], q_low[a], v[b], v_low[b], total, rest)
            d[i], d_low[i] = total, rest

    @compile_
    def run(high, low, arithmetic, attitudes):
        q, q_low = np.zeros(4, np.float32), np.zeros(4, np.float32)
        v, v_low = np.zeros(4, np.float32), np.zeros(4, np.float32)
        d, d_low = np.zeros(4, np.float32), np.zeros(4, np.float32)
        x, x_low = np.zeros(3, np.float32), np.zeros(3, np.float32)
        q[0] = ONE
        for k in range(len(attitudes)):
            rodrigues(high, low, 2 * k, x, x_low)
            square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
            part = square / (ONE + square)
            # -(1 - λ0*), and λv* = 2x - 2x (x·x)/(1 + x·x).
            v[0] = -TWO * part
            for i in range(3):
                v[i + 1], v_low[i + 1] = two_sum(TWO * x[i], TWO * x_low[i] - TWO * x[i] * part)
            if arithmetic == 0:
                v[0] = (ONE - square) / (ONE + square)
                product(q, v, q)
            elif arithmetic == 3:
                pair_product(q, q_low, v, v_low, d, d_low)
            else:
                product(q, v, d)
            if arithmetic == 1:
                for i in range(4):
                    q[i] = q[i] + d[i]
            if arithmetic > 1:
                for i in range(4):
                    total, rest = two_sum(q[i], d[i])
                    q[i], q_low[i] = two_sum(total, rest + (q_low[i] + d_low[i]))
            for i in range(4):
                attitudes[k, i] = np.float64(q[i]) + np.float64(q_low[i])

    return run
