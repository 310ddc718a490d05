"""The definition of an effect: a piece of physics that the nominal model leaves out."""

import inspect
import math
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ..arrays import Floats
from . import columns
from .columns import MotionRows, Rows
from .variants import Variant

ACCELEROMETERS = ("accelerometer-1", "accelerometer-2", "accelerometer-3")
AXES = ("outer-axis", "inner-axis")
GYRO_BLOCK = "gyro-block"
LONGEST_NAME = 40
"""Largest number of characters of a law in the name of a variable."""


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
        order of a harmonic
    axes : tuple of int
        accelerometers (1 to 3) whose inputs or readings take part
    law : str
        law of an effect outside every catalogue: its table or its formula, from which the effect is made
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
        """Entry in scenarios and results: ``effect``, ``where``, and optional ``order``, ``axes``, ``law``."""
        written: dict[str, object] = {"effect": self.effect, "where": self.where}
        if self.order is not None:
            written["order"] = self.order
        if self.axes:
            written["axes"] = list(self.axes)
        if self.law:
            written["law"] = self.law
        return written


def name_of_law(law: str) -> str:
    """Return a name of the letters, digits and underscores of a law, unique to this law."""
    words = "_".join(re.findall(r"[a-z][a-z0-9]*", law.lower()))
    return f"{words[:LONGEST_NAME]}_{zlib.crc32(law.encode()):08x}"


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes
    ----------
    name, unit, description : str
        as in the FMU and in the diagnosis
    largest : float
        largest possible absolute value
    smallest : float or None
        least possible value; by default `largest` with a minus
    """

    name: str
    unit: str
    description: str
    largest: float
    smallest: float | None = None

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest possible value."""
        if self.smallest is None:
            return -self.largest, self.largest
        return self.smallest, self.largest

    def possible(self, value: float) -> bool:
        """Return True if a value is possible, to rounding."""
        room, (low, high) = 1e-9 * self.largest, self.range
        return low - room <= value <= high + room


Parameters = EffectParameter | tuple[EffectParameter, ...]
Sentence = Callable[[EffectPlace, Mapping[str, float]], str]
"""Place, values of the parameters by name -> sentence for an engineer."""


RATES = {"RATE", "ANGULAR_ACCELERATION"}
"""Places of the context that are zero at rest."""


@cache
def constants_of(kernel: Callable[..., None] | None) -> frozenset[str]:
    """Return the names of the constants that a kernel reads, with those of the kernels that it calls."""
    if not inspect.isfunction(kernel):
        return frozenset()
    names = set(kernel.__code__.co_names)
    for name in kernel.__code__.co_names:
        names |= constants_of(kernel.__globals__.get(name))
    return frozenset(names)


@cache
def whole_numbers(kernel: Callable[..., None] | None) -> tuple[str, ...]:
    """Return the names of a kernel's whole-number arguments; none without a kernel."""
    arguments = inspect.signature(kernel).parameters.values() if kernel else ()
    return tuple(a.name for a in arguments if a.annotation in (int, "int"))


KEEPING = "kept_effects"
"""Hook in which a component updates the memory of effects."""


@dataclass(frozen=True)
class Effect:
    """An entry of the catalogue.

    Attributes
    ----------
    name : str
        as in the contracts
    places : tuple of EffectPlace
        possible places
    parameters : tuple of EffectParameter
        its parameters
    sentence : callable
        place, values of the parameters -> sentence for an engineer
    component : str or None
        component that its kernel extends; None without a kernel
    stage : str or None
        hook of that component's model that the kernel joins
    kernel : callable or None
        restricted Python: ``kernel(context, values, *whole numbers of the place, *parameters, added)``
    within : str or None
        name of the baseline whose model contains this effect already, so that it adds nothing there
    columns : callable or None
        for a linear effect that the kernel called with columns does not describe: place, rows -> (N, ports, K), the
        change by a unit of each coefficient at its stage
    variants : callable or None
        for an effect that is not linear: place, rows, readings (N, 3) [g], σ [g] -> the ways in which it can act
    degree : int
        degree in the inputs: readings determine the inputs only up to the factor 1 − Δg/g, and a coefficient of this
        degree up to a power of it
    untold : callable or None
        for a linear effect of one coefficient that depends on a quantity that a record may not show. place, rows -> (N,
        3): the possible difference of a reading [g] per unit of the coefficient where it is unknown. The signature
        vanishes there
    formula : str
        its formula for people: names of its parameters, {p} (accelerometer or position), {i}, {j} (axes), {angle} and
        {order} in braces (`trihedron.tools.document.notation`); empty if the sentence is enough
    open_argument : callable or None
        place, rows -> (N, 3): possible difference of a reading [g] per unit of the size of the coefficients, within the
        known range of the effect's quantity; None if that is exact
    memory : callable or None
        restricted Python: the component's memory for the effect, called once a step by its hook `kept_effects`, like
        the kernel by its stage's
    of_place : callable or None
        place -> the effect there, if parameters and kernel differ between the places; raises ValueError for a wrong law
    searched : ONSET, TIME_CONSTANT or None
        kind of its last parameter [h], if a diagnosis searches that number: the time from which the effect acts, or the
        time constant T of e^(-t/T). With a memory T is that of the lag of the temperature. The others are linear
        coefficients
    contains : tuple of str
        names of effects at the same place that equal it for some values of its parameters: if one of them stands, it is
        not a rival
    rounds : bool
        True if readings come in whole steps, which no derivative shows
    """

    name: str
    places: tuple[EffectPlace, ...]
    parameters: tuple[EffectParameter, ...]
    sentence: Sentence
    component: str | None = None
    stage: str | None = None
    kernel: Callable[..., None] | None = None
    within: str | None = None
    columns: Callable[[EffectPlace, Any], Floats] | None = None
    variants: Callable[[EffectPlace, Any, Floats, float], Sequence[Variant]] | None = None
    degree: int = 0
    untold: Callable[[EffectPlace, Rows], Floats] | None = None
    formula: str = ""
    open_argument: Callable[[EffectPlace, Rows], Floats] | None = None
    memory: Callable[..., None] | None = None
    contains: tuple[str, ...] = ()
    rounds: bool = False
    of_place: "Callable[[EffectPlace], Effect] | None" = None
    searched: str | None = None

    def at(self, place: EffectPlace) -> "Effect":
        """Return the effect as it is at one of its places."""
        return self if self.of_place is None else self.of_place(place)

    @property
    def of_law(self) -> bool:
        """True if it is made from the law of its place: it has no places of its own, and no search tries it."""
        return not self.places and self.of_place is not None

    @property
    def linear(self) -> bool:
        """True if it is linear in all of its parameters: it has no variants, and no number is searched."""
        return self.variants is None and self.searched is None

    @property
    def linear_parameters(self) -> tuple[EffectParameter, ...]:
        """Parameters that the linear coefficients give, for an effect without variants."""
        if self.searched is None:
            return self.parameters
        return self.parameters[:-1]

    @property
    def in_motion(self) -> bool:
        """True if no record of rests shows it: it acts on gyros or their increments, or depends on rates."""
        return self.component in ("GyroBlock", "AttitudeComputer") or bool(constants_of(self.kernel) & RATES)

    @property
    def needs(self) -> tuple[str, ...]:
        """Attributes of the rows that the effect needs: ("temperature",) or none."""
        constants = constants_of(self.kernel) | constants_of(self.memory)
        return ("temperature",) if "TEMPERATURE" in constants else ()

    @property
    def turns_table(self) -> bool:
        """True if it is linear and acts on the table, by small turns behind the encoders or by errors of these."""
        return self.component == "TurntableMotion" and self.linear

    def signature(self, place: EffectPlace, rows: Rows | MotionRows) -> Floats:
        """Return the change of readings (N, 3, K) [g, rad/s] by each coefficient.

        For an effect on the table `columns.ports` has its additions, and an observation their consequence for readings
        or turns. Raises TypeError if the effect is not linear.
        """
        if self.variants is not None:
            raise TypeError(f"{place.title} is not linear: it has variants, no signature")
        return columns.signature(self, place, rows)

    def from_coefficients(self, coefficients: Floats) -> tuple[float, ...]:
        """Return values of the linear parameters, amplitude and phase of each harmonic.

        Raises TypeError if the effect is not linear.
        """
        if self.variants is not None:
            raise TypeError("an effect that is not linear has values for each of its variants")
        values = [float(value) for value in coefficients]
        for k, parameter in enumerate(self.linear_parameters):
            if parameter.name.endswith("phase"):
                along, across = coefficients[k - 1 : k + 1]
                values[k - 1 : k + 1] = float(np.hypot(along, across)), float(np.arctan2(across, along))
        return tuple(values)

    def kernel_at(self, stage: str) -> Callable[..., None] | None:
        """Return its kernel that joins a hook of the component: at its stage, or for its memory."""
        return self.kernel if stage == self.stage else self.memory if stage == KEEPING else None

    def place_numbers(self, place: EffectPlace) -> tuple[int, ...]:
        """Return the whole-number arguments of the kernel at a place, by their names.

        ``p`` and ``axis`` are the place, ``order`` is that of a harmonic, others are the axes in turn; all except the
        order count from 0.
        """
        axes = iter(place.axes)
        numbers = {"p": lambda: place.index, "axis": lambda: place.index, "order": lambda: place.order or 1}
        return tuple(numbers.get(name, lambda: next(axes) - 1)() for name in whole_numbers(self.kernel))


CATALOGUE: dict[str, Effect] = {}
"""Every effect, by its name; the package fills it from its files."""


def accelerometer_column(place: EffectPlace, values: Floats) -> Floats:
    """Return values (N, K), or (N,), as additions to the readings of one accelerometer (N, 3, K)."""
    return at_port(3, place.index, values.reshape(len(values), -1))


def at_port(size: int, port: int, values: Floats) -> Floats:
    """Return values (N, K) as additions to one of several ports (N, size, K)."""
    added = np.zeros((len(values), size, values.shape[1]))
    added[:, port] = values
    return added


ARCSECONDS = math.degrees(1.0) * 3600.0
"""Arcseconds in a radian."""


def said(template: str) -> Sentence:
    """Return a sentence with the values of the parameters by their names; {amplitude_arcsec} is one in arcseconds.

    {p} is the accelerometer, {i} and {j} are the axes of the place, {axis} is the place in words, {times} the number of
    periods in a turn.
    """

    def say(place: EffectPlace, values: Mapping[str, float]) -> str:
        words: dict[str, object] = dict(zip("ij", place.axes, strict=False))
        words |= {"axis": place.where.replace("-", " "), "times": f"{place.order} time{'s' * (place.order != 1)}"}
        words |= {f"{name}_arcsec": value * ARCSECONDS for name, value in values.items()}
        if place.where in ACCELEROMETERS:
            words["p"] = place.index + 1
        return template.format_map({**words, **values})

    return say


def accelerometer_effect(
    kernel: Callable[..., None], parameters: Parameters, sentence: str | Sentence, **fields: Any
) -> Effect:
    """Return an effect of one accelerometer that adds to its reading.

    Parameters
    ----------
    kernel : callable
        ``kernel(context, n, p, *parameters, added)``; its name is the effect's
    parameters : EffectParameter or tuple of EffectParameter
    sentence : str or callable
        as `said` takes it, or as in `Effect`
    fields
        other fields of the `Effect`
    """
    home = {"component": "AccelerometerBlock", "stage": "reading_effects"}
    return _effect(kernel, parameters, sentence, ACCELEROMETERS, home | fields)


def last_stage_effect(
    kernel: Callable[..., None],
    parameters: Parameters,
    variants: Callable[[EffectPlace, Any, Floats, float], Sequence[Variant]],
    sentence: str | Sentence,
    **fields: Any,
) -> Effect:
    """Return an effect of one accelerometer that is not linear: a dead zone, clipping, rounding."""
    home = {"component": "AccelerometerBlock", "stage": "final_effects", "variants": variants}
    return _effect(kernel, parameters, sentence, ACCELEROMETERS, home | fields)


def table_effect(
    kernel: Callable[..., None], parameters: Parameters, sentence: str | Sentence, stage: str, **fields: Any
) -> Effect:
    """Return an effect of the table: small turns behind its encoders, or errors of these."""
    return _effect(kernel, parameters, sentence, AXES, {"component": "TurntableMotion", "stage": stage} | fields)


def gyro_effect(kernel: Callable[..., None], parameters: Parameters, sentence: str | Sentence, **fields: Any) -> Effect:
    """Return an effect that adds to the readings of the gyros: ``kernel(context, rate, *parameters, added)``."""
    home = {"component": "GyroBlock", "stage": "reading_effects"}
    return _effect(kernel, parameters, sentence, (GYRO_BLOCK,), home | fields)


def _effect(
    kernel: Callable[..., None],
    parameters: Parameters,
    sentence: str | Sentence,
    homes: Sequence[str],
    fields: dict[str, Any],
) -> Effect:
    """Return an effect that has its kernel's name, by default at each of some homes."""
    name = kernel.__name__.replace("_", "-")
    home = {"name": name, "places": tuple(EffectPlace(name, where) for where in homes)} | fields
    listed = (parameters,) if isinstance(parameters, EffectParameter) else parameters
    in_words = said(sentence) if isinstance(sentence, str) else sentence
    return Effect(parameters=listed, kernel=kernel, sentence=in_words, **home)


def matrix_formula(name: str, columns: Sequence[str]) -> str:
    """A matrix of parameters for formulas, a row for each gyro: {name_1c} and so on, c the names of the columns."""
    rows = []
    for p in (1, 2, 3):
        elements = [f"{{{name}_{p}{column}}}" for column in columns]
        rows.append(" ; ".join(elements))
    return f"[{' | '.join(rows)}]"
