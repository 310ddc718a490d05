"""What an effect is: a piece of physics that the nominal model leaves out."""

import inspect
import math
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .rows import MotionRows, Rows, Variant

ACCELEROMETERS = ("accelerometer-1", "accelerometer-2", "accelerometer-3")
AXES = ("outer-axis", "inner-axis")
GYRO_BLOCK = "gyro-block"
LONGEST_NAME = 40
"""So many characters of a law stand in the name of a variable."""


@dataclass(frozen=True)
class EffectPlace:
    """An effect at its place.

    Attributes
    ----------
    effect : str
        name in the catalogue
    where : str
        "accelerometer-1" to "-3", "outer-axis", "inner-axis", "base", "position-N", "gyro-block", "attitude-computer"
    order : int or None
        of a harmonic
    axes : tuple of int
        the accelerometers (1 to 3) whose inputs or readings take part
    law : str
        of an effect that no catalogue can list: its table or its formula, from which the effect is made
    """

    effect: str
    where: str
    order: int | None = None
    axes: tuple[int, ...] = ()
    law: str = ""

    @property
    def definition(self) -> "Effect":
        """The effect as it is at this place."""
        return CATALOGUE[self.effect].at(self)

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
        if self.law:
            words.append(self.law)
        return " ".join(words)

    @property
    def entry(self) -> dict[str, object]:
        """As scenarios and results write it: ``effect``, ``where``, where it has them ``order``, ``axes``, ``law``."""
        written: dict[str, object] = {"effect": self.effect, "where": self.where}
        if self.order is not None:
            written["order"] = self.order
        if self.axes:
            written["axes"] = list(self.axes)
        if self.law:
            written["law"] = self.law
        return written


def name_of_law(law: str) -> str:
    """A name of the letters, digits and underscores of a law, and of no other law."""
    words = "_".join(re.findall(r"[a-z][a-z0-9]*", law.lower()))
    return f"{words[:LONGEST_NAME]}_{zlib.crc32(law.encode()):08x}"


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes
    ----------
    name, unit, description : str
        as they stand in the FMU and in the diagnosis
    largest : float
        the largest absolute value that is called possible
    smallest : float or None
        the least value that is called possible; by default `largest` with a minus
    """

    name: str
    unit: str
    description: str
    largest: float
    smallest: float | None = None

    def possible(self, value: float) -> bool:
        """Whether a value is within the possible ones, to rounding."""
        room = 1e-9 * self.largest
        low = -self.largest if self.smallest is None else self.smallest
        return low - room <= value <= self.largest + room


Parameters = EffectParameter | tuple[EffectParameter, ...]
Sentence = Callable[[EffectPlace, Mapping[str, float]], str]
"""Place, values of the parameters by name -> what an engineer is told."""


def no_signature(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """In place of the signature of an effect that is not linear."""
    raise TypeError(f"{place.title} is not linear: it has variants, no signature")


def no_coefficients(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
    """In place of the parameters' values from linear coefficients, of an effect that is not linear."""
    raise TypeError("an effect that is not linear has values for each of its variants")


def polar_coefficients(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
    """Amplitude and phase of each pair (amplitude·cos(phase), amplitude·sin(phase)) of coefficients (2 K,)."""
    pairs = [(float(x), float(y)) for x, y in np.reshape(coefficients, (-1, 2))]
    return tuple(value for x, y in pairs for value in (float(np.hypot(x, y)), float(np.arctan2(y, x))))


def all_coefficients(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
    """Parameters of an effect that are its linear coefficients."""
    return tuple(float(value) for value in coefficients)


@cache
def whole_numbers(kernel: Callable[..., None] | None) -> tuple[str, ...]:
    """Names of the arguments of a kernel that are whole numbers; none where there is no kernel."""
    arguments = inspect.signature(kernel).parameters.values() if kernel else ()
    return tuple(a.name for a in arguments if a.annotation in (int, "int"))


KEEPING = "kept_effects"
"""The hook in which a component keeps what effects need of the past."""


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
    sentence : callable
        place, values of the parameters -> what an engineer is told
    component : str or None
        the component that its kernel extends; None where an effect has no kernel
    stage : str or None
        the hook of that component's model that the kernel joins
    kernel : callable or None
        restricted Python: ``kernel(context, values, *whole numbers of the place, *parameters, added)``
    signature : callable
        place, rows -> (N, 3, K): how the readings [g], or of a gyro the rates [rad/s], change with each of K linear
        coefficients
    from_coefficients : callable
        K linear coefficients -> values of the parameters; by default they are the coefficients
    within : str or None
        name of the baseline whose model holds this effect already, so that it can add nothing there
    needs : tuple of str
        attributes of the rows without which the effect cannot be tried ("temperature")
    turns : callable or None
        of an effect on the table: place, rows -> (N, 4, K): small turns [rad] per coefficient, added to κ, about the
        outer axis, to ε and about the inner axis, at given encoder readings. With the angles that the turns are
        functions of taken as the true ones they are exact: of an effect on an encoder, `rows` has the angles with its
        turns in; of one on the geometry, without. The signature is their effect to first order
    variants : callable or None
        of an effect that is not linear: place, rows, readings (N, 3) [g], σ [g] -> the ways in which it can act. Its
        signature and coefficients raise TypeError
    degree : int
        in the inputs: readings tell the inputs only up to the factor 1 − Δg/g, and a coefficient of this degree up to
        a power of it
    untold : callable or None
        of a linear effect of one coefficient that depends on what a record may not tell: place, rows -> (N, 3): by how
        much a reading [g] may differ per unit of the coefficient where it is not told. The signature vanishes there
    formula : str
        what it adds, for people: names of its parameters, {p} (accelerometer or position), {i}, {j} (axes), {angle} and
        {order} stand in braces (`trihedron.tools.document.notation`); empty where the sentence says it all
    open_argument : callable or None
        place, rows -> (N, 3): by how much a reading [g] may differ per unit of the size of the coefficients, within
        what is told of the quantity that the effect depends on; None where that is exact
    memory : callable or None
        restricted Python: what the component keeps for the effect, called once a step by its hook `kept_effects`, as
        the kernel is by its stage's
    of_place : callable or None
        place -> the effect there, where parameters and kernel differ between the places; a ValueError where the
        place's law is none
    in_motion : bool
        an effect of a record in motion: its signature takes `MotionRows`, that of a table `Rows` with rates of its
        axes, and no record of rests shows it
    sets_in : bool
        it acts from a time on, its last parameter "start" [h], which is found; its signature is that of what it does
        from then on, and its linear coefficients are the other parameters
    fades : bool
        it fades with time as exp(-t/T), T [h] being its last parameter, which is found; its signature is that of what
        it does at the beginning, and its linear coefficients are the other parameters
    contains : tuple of str
        names of effects at the same place that it can be, with some values of its parameters: where one of them
        stands, it is no rival
    rounds : bool
        readings come in whole steps, which no derivative tells
    """

    name: str
    places: tuple[EffectPlace, ...]
    parameters: tuple[EffectParameter, ...]
    sentence: Sentence
    component: str | None = None
    stage: str | None = None
    kernel: Callable[..., None] | None = None
    signature: Callable[[EffectPlace, Any], NDArray[np.float64]] = no_signature
    from_coefficients: Callable[[NDArray[np.float64]], tuple[float, ...]] = all_coefficients
    within: str | None = None
    needs: tuple[str, ...] = ()
    turns: Callable[[EffectPlace, Rows], NDArray[np.float64]] | None = None
    variants: Callable[[EffectPlace, Any, NDArray[np.float64], float], Sequence[Variant]] | None = None
    degree: int = 0
    untold: Callable[[EffectPlace, Rows], NDArray[np.float64]] | None = None
    formula: str = ""
    open_argument: Callable[[EffectPlace, Rows], NDArray[np.float64]] | None = None
    memory: Callable[..., None] | None = None
    contains: tuple[str, ...] = ()
    rounds: bool = False
    of_place: "Callable[[EffectPlace], Effect] | None" = None
    in_motion: bool = False
    sets_in: bool = False
    fades: bool = False

    def at(self, place: EffectPlace) -> "Effect":
        """The effect as it is at one of its places."""
        return self if self.of_place is None else self.of_place(place)

    @property
    def of_law(self) -> bool:
        """Whether it is made from the law of its place: it has no places of its own, and no search tries it."""
        return not self.places and self.of_place is not None

    @property
    def linear_parameters(self) -> tuple[EffectParameter, ...]:
        """The parameters of an effect without variants that its linear coefficients give."""
        return self.parameters[: len(self.parameters) - (self.sets_in or self.fades)]

    def kernel_at(self, stage: str) -> Callable[..., None] | None:
        """Its kernel that joins a hook of the component: at its stage, or where the component keeps what it needs."""
        return self.kernel if stage == self.stage else self.memory if stage == KEEPING else None

    def place_numbers(self, place: EffectPlace) -> tuple[int, ...]:
        """The whole numbers that the kernel takes at a place, by their names.

        ``p`` and ``axis`` are where it sits, ``order`` is that of a harmonic, others are the axes in turn; all but the
        order count from 0.
        """
        axes = iter(place.axes)
        known = {"p": lambda: place.index, "axis": lambda: place.index, "order": lambda: place.order or 1}
        return tuple(known.get(name, lambda: next(axes) - 1)() for name in whole_numbers(self.kernel))


CATALOGUE: dict[str, Effect] = {}
"""Every effect, by its name; the package fills it from its files."""


def accelerometer_column(place: EffectPlace, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signature (N, 3, K) of an effect that adds `values` (N, K), or (N,), to the readings of one accelerometer."""
    columns = np.zeros((len(values), 3, values.shape[1] if values.ndim == 2 else 1))
    columns[:, place.index] = values.reshape(len(values), columns.shape[2])
    return columns


def turned(rows: Rows, turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change of the readings (N, 3, K), to first order, with small turns (N, 4, K): of κ, outer, of ε, inner."""
    slopes = np.stack((rows.by_kappa, rows.by_alpha, rows.by_epsilon, rows.by_beta), axis=2)
    return slopes @ turns


ARCSECONDS = math.degrees(1.0) * 3600.0
"""In a radian."""


def said(template: str) -> Sentence:
    """A sentence with the values of the parameters by their names; {amplitude_arcsec} is one in arcseconds.

    {p} is the accelerometer, {i} and {j} are the axes of the place, {axis} is where it sits in words, {times} how often
    in a turn.
    """

    def say(place: EffectPlace, values: Mapping[str, float]) -> str:
        known: dict[str, object] = dict(zip("ij", place.axes, strict=False))
        known |= {"axis": place.where.replace("-", " "), "times": f"{place.order} time{'s' * (place.order != 1)}"}
        known |= {f"{name}_arcsec": value * ARCSECONDS for name, value in values.items()}
        if place.where in ACCELEROMETERS:
            known["p"] = place.index + 1
        return template.format_map({**known, **values})

    return say


def accelerometer_effect(
    kernel: Callable[..., None],
    parameters: Parameters,
    values: Callable[[EffectPlace, Any], NDArray[np.float64]],
    sentence: str | Sentence,
    **more: Any,
) -> Effect:
    """An effect of one accelerometer that adds its parameters times known values to the reading.

    Parameters
    ----------
    kernel : callable
        ``kernel(context, n, p, *parameters, added)``; its name is the effect's
    parameters : EffectParameter or tuple of EffectParameter
    values : callable
        place, rows -> (N,) or (N, K): what the parameters are multiplied by
    sentence : str or callable
        as `said` takes it, or as in `Effect`
    more
        other fields of the `Effect`
    """

    def signature(place: EffectPlace, rows: Any) -> NDArray[np.float64]:
        return accelerometer_column(place, values(place, rows))

    home = ("AccelerometerBlock", "reading_effects", ACCELEROMETERS)
    return _effect(home, kernel, parameters, sentence, {"signature": signature}, more)


def own_input(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """The accelerometer's own input (N,) [g]."""
    return rows.n[:, place.index]


def last_stage_effect(
    kernel: Callable[..., None],
    parameters: Parameters,
    variants: Callable[[EffectPlace, Any, NDArray[np.float64], float], Sequence[Variant]],
    sentence: str | Sentence,
    **more: Any,
) -> Effect:
    """An effect of one accelerometer that is not linear: a dead zone, clipping, rounding; `more` as in the other."""
    home = ("AccelerometerBlock", "final_effects", ACCELEROMETERS)
    own = {"variants": variants, "from_coefficients": no_coefficients}
    return _effect(home, kernel, parameters, sentence, own, more)


def table_effect(
    kernel: Callable[..., None],
    parameters: Parameters,
    turns: Callable[[EffectPlace, Rows], NDArray[np.float64]],
    sentence: str | Sentence,
    stage: str,
    **more: Any,
) -> Effect:
    """An effect of the table: small turns, whose effect on the readings is its signature to first order.

    An amplitude and a phase are told from a cosine and a sine.
    """

    def signature(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
        return turned(rows, turns(place, rows))

    own: dict[str, Any] = {"signature": signature, "turns": turns}
    if any(parameter.name.endswith("phase") for parameter in _several(parameters)):
        own["from_coefficients"] = polar_coefficients
    return _effect(("TurntableMotion", stage, AXES), kernel, parameters, sentence, own, more)


def gyro_effect(
    kernel: Callable[..., None],
    parameters: Parameters,
    signature: Callable[[EffectPlace, MotionRows], NDArray[np.float64]],
    sentence: str | Sentence,
    **more: Any,
) -> Effect:
    """An effect that adds to the readings of the gyros; its parameters are its linear coefficients.

    The kernel is ``kernel(context, rate, *parameters, added)``; the others are as in `Effect`.
    """
    home = ("GyroBlock", "reading_effects", (GYRO_BLOCK,))
    return _effect(home, kernel, parameters, sentence, {"signature": signature, "in_motion": True}, more)


def _effect(
    home: tuple[str, str, tuple[str, ...]],
    kernel: Callable[..., None],
    parameters: Parameters,
    sentence: str | Sentence,
    *fields: Mapping[str, Any],
) -> Effect:
    """An effect named as its kernel, at home in a component's stage, at some places; of fields given twice the last."""
    name = kernel.__name__.replace("_", "-")
    component, stage, places = home
    known: dict[str, Any] = {"name": name, "places": tuple(EffectPlace(name, where) for where in places)}
    for some in ({"component": component, "stage": stage}, *fields):
        known |= some
    told = said(sentence) if isinstance(sentence, str) else sentence
    return Effect(parameters=_several(parameters), kernel=kernel, sentence=told, **known)


def _several(parameters: Parameters) -> tuple[EffectParameter, ...]:
    return (parameters,) if isinstance(parameters, EffectParameter) else parameters


def matrix_formula(name: str, columns: Sequence[str]) -> str:
    """A matrix of parameters for formulas, a row for each gyro: {name_1c} and so on, c the names of the columns."""
    rows = (" ; ".join(f"{{{name}_{p}{column}}}" for column in columns) for p in (1, 2, 3))
    return f"[{' | '.join(rows)}]"
