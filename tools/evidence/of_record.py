"""Effects and parameters of one record among several of an instrument, and a record about the effects that mend it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.bench import SYMMETRIC_PAIRS
from ...models.effects import EffectPlace
from ...models.effects.definition import Effect, EffectParameter
from ..calibration.targets import NAMES
from .bench_model import LARGEST_OF_BENCH
from .evidence import Evidence, Linear, Model, Reader
from .fit import Fit, blocks_of, width_of
from .rows import About, Rows

OF_INSTRUMENT = (
    *("X4", "X5", "X9", "X10", "X14", "X15", "X6+X8", "X7+X12", "X11+X13"),
    *("accelerometer gamma_*", "gyro gamma_*"),
)
"""Parameters that are the instrument's by default: scale factors and misalignments. Biases are the day's, mounting and
angles of the table each record's own. A star stands for anything."""
AT_A_TABLE = {
    "accelerometer gamma_11": "X4",
    "accelerometer gamma_22": "X9",
    "accelerometer gamma_33": "X14",
    "accelerometer gamma_21": "X6+X8",
    "accelerometer gamma_31": "X7+X12",
    "accelerometer gamma_32": "X11+X13",
    **{f"accelerometer bias_{p}": f"X{15 + p}" for p in (1, 2, 3)},
}
"""Parameters of carried accelerometers -> the names of the same parameters on a table."""


@dataclass(frozen=True)
class InRecord(EffectPlace):
    """An effect that acts in one of several records alone."""

    record: str = ""

    @property
    def title(self) -> str:
        """The effect in words, with the record."""
        return f"{super().title} in {self.record}"


@dataclass(frozen=True)
class Differs(InRecord):
    """A shared parameter, `where`, that has another value in one record."""

    unit: str = field(default="", compare=False)

    @property
    def definition(self) -> Effect:
        """Effect of one number: the excess of the parameter in this record over its value in the others."""
        meaning = "by how much the parameter is larger there"
        parameter = EffectParameter("difference", self.unit, meaning, LARGEST_OF_BENCH)
        return Effect(self.effect, (), (parameter,), lambda place, _: place.title)

    @property
    def title(self) -> str:
        """The effect in words."""
        return f"{self.where} differs in {self.record}"


def differs(name: str, record: str, unit: str = "") -> Differs:
    """Return the effect of a shared parameter, by its name, with another value in one record."""
    return Differs("parameter", name, record=record, unit=unit)


def record_of(place: EffectPlace) -> str | None:
    """Return the one record in which an effect acts; None where it may act in all."""
    return place.record if isinstance(place, InRecord) else None


def plain(place: EffectPlace) -> EffectPlace:
    """The effect without the record that it is of."""
    return EffectPlace(place.effect, place.where, place.order, place.axes, place.law)


def in_record(place: EffectPlace, record: str) -> InRecord:
    """The effect in one record alone."""
    return InRecord(place.effect, place.where, place.order, place.axes, place.law, record)


class Mended(Linear):
    """A record with the effects that mend it as parameters of its own, linear about the fit with them.

    It decides whether other effects are consistent beside these: an effect that is not linear acts as in this fit.
    `free` are columns (M, K) of the fit's other effects.
    """

    def __init__(self, rows: Rows, before: Model, free: Mapping[EffectPlace, Floats]) -> None:
        super().__init__(rows)
        self.before, self.free = before, free
        self.limit, self.curvature = before.limit, before.curvature

    def about(self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray) -> About:
        """The rows about parameters and coefficients, linear about the fit."""
        rows, count = self.rows, len(self.before.rows.names)
        at = self.before.about(places, rows.point[:count], np.zeros(width_of(places)))
        for place, block in zip(places, blocks_of(places), strict=True):
            at.jacobian[:, count:][:, block] = self.free.get(place, at.jacobian[:, count:][:, block])
        matrix = np.hstack([rows.nominal, at.jacobian[:, count:]])
        rate = np.hstack([np.zeros_like(rows.nominal), at.rate[:, count:]])
        step = np.concatenate([point - rows.point, coefficients])
        return About(rows.residual - matrix @ step, matrix, rows.bound, rate)


def mended(before: Evidence, fit: Fit, effects: Sequence[EffectPlace]) -> Evidence:
    """Return the record with some effects of a fit to it; others, which may act in all records, are removed."""
    widths = [block.stop - block.start for block in fit.blocks]
    in_rows = np.append(np.full(len(fit.point), True), np.repeat([place in effects for place in fit.places], widths))
    residual = fit.residual + fit.jacobian[:, ~in_rows] @ fit.at[~in_rows]
    names_of_effects = tuple((f"{fit.title} {k}", "") for k in range(int(in_rows.sum()) - len(fit.point)))
    rows = replace(
        before.rows,
        names=(*before.rows.names, *names_of_effects),
        point=fit.at[in_rows],
        places=tuple(place for place in before.rows.places if place not in effects),
        residual=residual,
        nominal=fit.jacobian[:, in_rows],
        bound=fit.allowed,
        least_singular=0.0,
    )
    columns = fit.jacobian[:, len(fit.point) :]
    free = {place: columns[:, block] for place, block, way in fit.ways if place not in effects and way is None}
    return Evidence.of(Reader(Mended(rows, before.model, free)))


def named_alike(records: Mapping[str, Evidence]) -> dict[str, Evidence]:
    """Return the records; where one is a table's, accelerometers of strapdown records take the names of the table's.

    A scale factor takes the name only where the table's does not depend on the sign: only then are the two the same.
    """
    units: dict[str, str] = {}
    for record in records.values():
        units |= dict(record.rows.names)
    signed = {plus for plus, minus in SYMMETRIC_PAIRS if minus in units}
    alike = {}
    for label, record in records.items():
        names = []
        for name, unit in record.rows.names:
            at_table = AT_A_TABLE.get(name, name)
            names.append((at_table, units[at_table]) if at_table in units and at_table not in signed else (name, unit))
        alike[label] = record
        if tuple(names) != record.rows.names and record.reader.lengths is not None:
            model = record.reader.lengths.model_of(rows=replace(record.rows, names=tuple(names)))
            alike[label] = Evidence(model, replace(record.reader, model=model))
    return alike


def is_of_instrument(name: str, shared: Sequence[str] = (), own: Sequence[str] = ()) -> bool:
    """Return whether a parameter is shared, by the given patterns (a star matches anything), else by default."""
    return not is_asked(name, own) and is_asked(name, (*shared, *OF_INSTRUMENT))


def is_asked(name: str, patterns: Sequence[str]) -> bool:
    """Return whether a parameter matches one of some patterns, in which a star matches anything."""
    spellings = names_of(name)
    return any(any(fnmatchcase(spelling, pattern) for spelling in spellings) for pattern in patterns)


def names_of(name: str) -> tuple[str, ...]:
    """Return the spellings of a parameter: as the model has it, in words, and without its mounting."""
    bare = name.partition("@")[0]
    return tuple(dict.fromkeys((name, bare, *NAMES.get(bare, (bare,))[:1])))
