"""What an effect sees of a record in motion, and what effects of the gyros have in common."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .definition import Effect, EffectParameter, EffectPlace, all_coefficients

GYRO_BLOCK = "gyro-block"
ROW_BY_ROW = tuple((p, q) for p in (1, 2, 3) for q in (1, 2, 3))
"""Gyro and axis of the elements of a matrix, as its parameters stand."""


@dataclass(frozen=True)
class MotionRows:
    """Steps of a record in motion as the signatures see them: N rows, one a step.

    Signatures (N, 3, K) of gyro effects are in rad/s of the reading: reading = true rate + signature · coefficients,
    with means over the step on both sides; those of accelerometers in motion are in g.

    Attributes
    ----------
    rate : (N, 3)
        mean rates over the steps [rad/s]
    rate_before : (N, 3)
        mean rates over the steps before; at the first step and after a gap, the rates themselves
    specific_force : (N, 3)
        in block axes [g]
    hours : (N,)
        time since the record's first row [h], at the ends of the steps
    step : (N,)
        lengths of the steps [s]
    temperature : (N,) or None
        [degC]; None where the record has none
    period : float
        nominal time between samples [s]; 0 where there is none
    gravity : float
        model value [m/s²]
    """

    rate: NDArray[np.float64]
    rate_before: NDArray[np.float64]
    specific_force: NDArray[np.float64]
    hours: NDArray[np.float64]
    step: NDArray[np.float64]
    temperature: NDArray[np.float64] | None = None
    period: float = 0.0
    gravity: float = 9.80665


def on_gyros(name: str) -> tuple[EffectPlace, ...]:
    """The one place of an effect of the gyros: the block."""
    return (EffectPlace(name, GYRO_BLOCK),)


def no_numbers(place: EffectPlace) -> tuple[int, ...]:
    """Kernels of all three gyros together take no whole numbers."""
    return ()


def of_each_gyro(name: str, unit: str, description: str, largest: float) -> tuple[EffectParameter, ...]:
    """Three parameters, one for each gyro: "bias_1", "bias_2", "bias_3"."""
    return tuple(EffectParameter(f"{name}_{p}", unit, f"{description} of gyro {p}", largest) for p in (1, 2, 3))


def of_a_matrix(name: str, unit: str, description: str, largest: float) -> tuple[EffectParameter, ...]:
    """Nine parameters, row by row: "gamma_11", "gamma_12", ..., of gyro 1 by axis 1, by axis 2, ..."""
    return tuple(
        EffectParameter(f"{name}_{p}{q}", unit, f"{description} of gyro {p} by axis {q}", largest)
        for p, q in ROW_BY_ROW
    )


def matrix_formula(name: str, columns: Sequence[str]) -> str:
    """A matrix of parameters for formulas, a row for each gyro: {name_1c} and so on, c the names of the columns."""
    rows = (" ; ".join(f"{{{name}_{p}{column}}}" for column in columns) for p in (1, 2, 3))
    return f"[{' | '.join(rows)}]"


def gyro_columns(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signature (N, 3, 3) of an effect that adds c_p · values (N, 3) to the reading of each gyro p."""
    return values[:, :, None] * np.eye(3)


def matrix_columns(inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signature (N, 3, 3 M) of an effect that adds a matrix (3, M), given row by row, times inputs (N, M)."""
    count = inputs.shape[1]
    columns = np.zeros((len(inputs), 3, 3 * count))
    for p in range(3):
        columns[:, p, count * p : count * (p + 1)] = inputs
    return columns


def sentence_of(words: str, unit: str) -> Callable[[EffectPlace, Mapping[str, float]], str]:
    """A sentence that lists three values, or nine row by row: "the gyros' bias: +1.0e-03, ... rad/s"."""

    def say(place: EffectPlace, values: Mapping[str, float]) -> str:
        return f"{words}: {listed(list(values.values()))}" + (f" {unit}" if unit else "")

    return say


def listed(values: Sequence[float]) -> str:
    """Values with their signs, in rows of three where there are more."""
    rows = [", ".join(f"{value:+.2e}" for value in values[at : at + 3]) for at in range(0, len(values), 3)]
    return "; ".join(rows)


def gyro_effect(
    name: str,
    kernel: Callable[..., None],
    parameters: tuple[EffectParameter, ...],
    signature: Callable[[EffectPlace, MotionRows], NDArray[np.float64]],
    sentence: Callable[[EffectPlace, Mapping[str, float]], str],
    **more: Any,
) -> Effect:
    """An effect that adds to the readings of the gyros; its parameters are its linear coefficients.

    Parameters
    ----------
    name : str
        of the effect
    kernel : callable
        ``kernel(context, rate, *parameters, added)``
    parameters : tuple of EffectParameter
    signature, sentence : callable
        as in `Effect`
    more
        other fields of the `Effect`
    """
    usual = {"places": on_gyros(name), "component": "GyroBlock", "stage": "reading_effects"}
    return Effect(
        name=name,
        parameters=parameters,
        kernel=kernel,
        place_numbers=no_numbers,
        signature=signature,
        from_coefficients=all_coefficients,
        sentence=sentence,
        in_motion=True,
        **(usual | more),
    )
