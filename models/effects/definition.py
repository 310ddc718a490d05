"""What an effect is: a piece of physics that the nominal model leaves out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ACCELEROMETERS = ("accelerometer-1", "accelerometer-2", "accelerometer-3")
AXES = ("outer-axis", "inner-axis")


@dataclass(frozen=True)
class EffectPlace:
    """An effect at its place.

    Attributes
    ----------
    effect : str
        name in the catalogue
    where : str
        "accelerometer-1" to "-3", "outer-axis", "inner-axis", "base", "position-N"
    order : int or None
        of a harmonic
    axes : tuple of int
        the accelerometers (1 to 3) whose inputs or readings take part
    """

    effect: str
    where: str
    order: int | None = None
    axes: tuple[int, ...] = ()

    @property
    def index(self) -> int:
        """0, 1, 2 for the accelerometers; 0, 1 for the outer and the inner axis."""
        return ACCELEROMETERS.index(self.where) if self.where in ACCELEROMETERS else AXES.index(self.where)

    @property
    def title(self) -> str:
        """In words: "encoder-harmonic outer-axis order 2"."""
        words = [self.effect, self.where]
        if self.order is not None:
            words.append(f"order {self.order}")
        if self.axes:
            words.append("axes " + " ".join(str(axis) for axis in self.axes))
        return " ".join(words)


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes
    ----------
    name, unit, description : str
        as they stand in the FMU and in the diagnosis
    largest : float
        the largest absolute value that is called possible
    """

    name: str
    unit: str
    description: str
    largest: float


@dataclass(frozen=True)
class Rows:
    """Averaged readings as the signatures see them: N rows at the relinearised point.

    Attributes
    ----------
    hours : (N,)
        time since the first row [h]
    alpha, beta : (N,)
        true angles of the outer and the inner axis [rad]
    n : (N, 3)
        inputs of the accelerometers [g]
    by_alpha, by_beta : (N, 3)
        derivatives of the readings by the true angles [g/rad]
    """

    hours: NDArray[np.float64]
    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]
    n: NDArray[np.float64]
    by_alpha: NDArray[np.float64]
    by_beta: NDArray[np.float64]


@dataclass(frozen=True)
class Effect:
    """An entry of the catalogue.

    Attributes
    ----------
    name : str
        as in the contracts
    places : tuple of EffectPlace
        where it can sit
    parameters : tuple of EffectParameter
    component : str or None
        the component that its kernel extends; None where an effect has no kernel
    stage : str or None
        the hook of that component's model that the kernel joins
    kernel : callable or None
        restricted Python: ``kernel(context, values, *whole numbers of the place, *parameters, added)``
    place_numbers : callable
        place -> the whole numbers that the kernel takes
    signature : callable
        place, rows -> (N, 3, K): how the readings [g] change with each of K linear coefficients
    from_coefficients : callable
        K linear coefficients -> values of the parameters
    sentence : callable
        place, values of the parameters -> what an engineer is told
    within : str or None
        name of the baseline whose model holds this effect already, so that it can add nothing there
    encoder_error : callable or None
        of an effect on the encoders: place, true α (N,), true β (N,) -> (N, 2, K): the readings' errors [rad] per
        coefficient, from which the true angles follow exactly; the signature is their effect to first order
    """

    name: str
    places: tuple[EffectPlace, ...]
    parameters: tuple[EffectParameter, ...]
    component: str | None
    stage: str | None
    kernel: Callable[..., None] | None
    place_numbers: Callable[[EffectPlace], tuple[int, ...]]
    signature: Callable[[EffectPlace, Rows], NDArray[np.float64]]
    from_coefficients: Callable[[NDArray[np.float64]], tuple[float, ...]]
    sentence: Callable[[EffectPlace, Mapping[str, float]], str]
    within: str | None = None
    encoder_error: Callable[[EffectPlace, NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]] | None = None


def on_accelerometers(name: str) -> tuple[EffectPlace, ...]:
    """The places of an effect that each accelerometer can have."""
    return tuple(EffectPlace(name, where) for where in ACCELEROMETERS)


def accelerometer_column(place: EffectPlace, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signature (N, 3, 1) of an effect that adds `values` (N,) to the readings of one accelerometer."""
    columns = np.zeros((len(values), 3, 1))
    columns[:, place.index, 0] = values
    return columns


def accelerometer_number(place: EffectPlace) -> tuple[int, ...]:
    """The whole number that an accelerometer's kernel takes: its index, 0 to 2."""
    return (place.index,)


def only_coefficient(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
    """Parameters of an effect whose only parameter is its linear coefficient."""
    return (float(coefficients[0]),)
