"""What limited word length costs: 32-bit arithmetic and 32-bit increments against 64-bit ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..progress import progress_bar
from .angles import angle_between
from .compiled_runs import run_algorithm, sample_motion
from .conditions import EXACT
from .paper_motions import paper_motion
from .published import algorithm_named
from .single_precision import ARITHMETICS, round_with_feedback, run_single

ROUNDINGS = ("independently", "feedback", "pairs")
"""How increments become 32-bit numbers: each rounded by itself; the rounding error of one added to the next; as the sum
of two 32-bit numbers."""

DOUBLE = "double"
"""64-bit arithmetic on the same rounded increments: what is left is the increments' own error."""

REPEATING, INCOMMENSURATE = "repeating", "incommensurate"
FREQUENCY_FACTORS = (1.01234567, 1.02430827, 1.02718280)
"""Make the frequencies of ψ, ϑ, γ incommensurate with each other and with the samples."""


@dataclass(frozen=True)
class WordLengthError:
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


def rounded_increments(increments: np.ndarray, rounding: str) -> tuple[np.ndarray, np.ndarray]:
    """Increments as 32-bit numbers.

    Parameters
    ----------
    increments : ndarray, shape (N, 3)
        [rad]
    rounding : str
        one of `ROUNDINGS`

    Returns
    -------
    high, low : ndarray of float32, shape (N, 3)
        low is zero but for pairs
    """
    high = increments.astype(np.float32)
    low = np.zeros_like(high)
    if rounding == "pairs":
        low = (increments - high).astype(np.float32)
    elif rounding == "feedback":
        round_with_feedback(np.ascontiguousarray(increments, dtype=np.float64), high)
    return high, low


def word_length_errors(
    duration: float = 600.0,
    period: float = 1e-3,
    motions: Sequence[str] = (REPEATING, INCOMMENSURATE),
    arithmetics: Sequence[str] = (*ARITHMETICS, DOUBLE),
    *,
    progress: bool = False,
) -> tuple[WordLengthError, ...]:
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
                    found.append(WordLengthError(motion, arithmetic, rounding, error))
                    advance(1)
    return tuple(found)


def word_length_summary(errors: Sequence[WordLengthError]) -> list[str]:
    """Lines for people: a table for each motion [deg], and what it shows."""
    found = {(e.motion, e.rounding, e.arithmetic): np.degrees(e.error) for e in errors}
    lines = ["update (22), variant 1 of Table 1: largest attitude error against 64-bit words [deg]"]
    columns = (*ARITHMETICS, DOUBLE)
    for motion, said in (
        (REPEATING, "the motion repeats exactly in samples: rounding errors repeat with it and add up"),
        (INCOMMENSURATE, "incommensurate frequencies: rounding errors do not repeat"),
    ):
        lines += ["", said, f"{'increments rounded':<20}" + "".join(f"{name:>13}" for name in columns)]
        for rounding in ROUNDINGS:
            cells = (found[motion, rounding, name] for name in columns)
            lines.append(f"{rounding:<20}" + "".join(f"{cell:>13.1e}" for cell in cells))
    floor = found[REPEATING, "independently", DOUBLE]
    feedback, pairs = (found[REPEATING, rounding, "pairs"] for rounding in ("feedback", "pairs"))
    lines += [
        "",
        f"independently rounded increments alone cost {floor:.1e} deg, in 64-bit arithmetic too",
        f"an attitude in pairs of 32-bit numbers comes to {feedback:.1e} deg with error feedback of the increments, "
        f"to {pairs:.1e} with increments in pairs",
        f"carrying 1 - λ0* instead of λ0* alone buys {_gain(found, 'carried'):.1f} times, "
        f"keeping the low part of the attitude {_gain(found, 'compensated'):.0f} times",
    ]
    return lines


def _gain(found: dict[tuple[str, str, str], float], arithmetic: str) -> float:
    """How many times an arithmetic betters plain single, over the roundings: geometric mean."""
    ratios = [found[REPEATING, r, "single"] / found[REPEATING, r, arithmetic] for r in ROUNDINGS]
    return float(np.exp(np.mean(np.log(ratios))))


def _increments(motion: str, duration: float, period: float) -> np.ndarray:
    harmonics = paper_motion("1", EXACT)
    if motion == INCOMMENSURATE:
        axes = harmonics.reshape(3, -1, 3)
        axes[:, :, 1] *= np.array(FREQUENCY_FACTORS)[:, None]
    return sample_motion(harmonics, period, round(duration / period)).increments
