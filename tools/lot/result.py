"""Types of a lot: its records, and the properties that its instruments share."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import polars as pl
from pydantic import Field

from ..diagnosis.cause import NamedEffect
from ..fields import Number
from ..quantity import Quantity
from ..result import Result, Told

Against = Literal["serial", "date", "temperature"]
Status = Literal["pass", "fail", "undecided"]


class InstrumentValue(Told):
    """A number of an instrument, with the ends of its interval where the record guarantees them."""

    unit: str
    estimate: Number
    low: Number | None = None
    high: Number | None = None


class Member(Told):
    """A record of the lot, and its result in short.

    Attributes
    ----------
    record, serial : str
        file; serial number of its instrument, or the file's stem where none is known
    date : str or None
        ISO 8601
    temperature : float or None
        [degC]
    verdict : str or None
        of the result; None where there is none
    failed : str or None
        why there is no result
    result : str or None
        file of the result, in the folder of the batch
    values : dict of InstrumentValue
        by symbol
    causes : tuple of NamedEffect
        those of an explained diagnosis
    status, reason : str or None
        pass or fail by a table of tolerances
    """

    record: str
    serial: str
    date: str | None = None
    temperature: Number | None = Field(default=None, alias="temperature_degC")
    verdict: str | None = None
    failed: str | None = None
    result: str | None = None
    values: Mapping[str, InstrumentValue] = {}
    causes: tuple[NamedEffect, ...] = ()
    status: Status | None = None
    reason: str | None = None


class Distribution(Result):
    """A parameter over the instruments of a lot.

    `spread` is 1.4826 times the median distance from the median, a standard deviation under a normal law. `half_width`
    is the median half width of the guaranteed intervals, None where no record guarantees one.
    """

    symbol: Annotated[str, Quantity("parameter")]
    unit: Annotated[str, Quantity("unit")]
    instruments: Annotated[int, Quantity("instruments")]
    median: Annotated[Number, Quantity("median", "", "nearest", 4)]
    spread: Annotated[Number, Quantity("spread", "", "nearest", 2)]
    half_width: Annotated[Number | None, Quantity("half width", "", "up")]
    least: Annotated[Number, Quantity("least", "", "nearest", 4)]
    greatest: Annotated[Number, Quantity("greatest", "", "nearest", 4)]


class Odd(Result):
    """An instrument unlike its lot; `symbol` is the parameter, empty for a cause or a verdict of its own."""

    serial: str
    record: str
    symbol: str
    sentence: str


class SharedCause(Result):
    """A cause that more instruments share than chance explains.

    Attributes
    ----------
    cause : NamedEffect
    count, of : int
        instruments with the cause, and all instruments from `since` to `until`
    since, until : str or None
        serial numbers of the first and the last instrument of these; None: of the whole lot
    chance : float
        upper bound of the probability of this count by chance
    serials : tuple of str
        the instruments with the cause
    sentence : str
    """

    cause: NamedEffect
    count: int
    of: int
    since: str | None
    until: str | None
    chance: Number
    serials: tuple[str, ...]
    sentence: str


class LotTrend(Result):
    """A parameter that changes over the lot: a step at a serial number, or a trend with date or temperature.

    Attributes
    ----------
    symbol, unit : str
    against : str
        "serial", "date" or "temperature"
    size, low, high : float
        the step, or the slope per year or kelvin, with its 95 % interval
    since : str or None
        serial number of the first instrument after the step
    chance : float
        upper bound of the probability of such a dependence by chance
    sentence : str
    """

    symbol: str
    unit: str
    against: Against
    size: Number
    low: Number
    high: Number
    since: str | None
    chance: Number
    sentence: str


class Lot(Told):
    """Many records, and what their instruments have in common.

    Attributes
    ----------
    do : str
        work on each record
    instruments, failed : int
        number of instruments, and of records without a result
    verdicts : dict of int
        number of records by verdict
    members : tuple of Member
        the records, in the order of the batch
    distributions : tuple of Distribution
    odd : tuple of Odd
    shared : tuple of SharedCause
    dependences : tuple of LotTrend
    first_out : str or None
        serial number of the first instrument out of tolerance
    warnings : tuple of str
    """

    schema_: Literal["trihedron.lot/1"] = Field(default="trihedron.lot/1", alias="schema")
    do: Literal["calibrate", "diagnose", "noise", "apply"]
    instruments: int
    failed: int
    verdicts: Mapping[str, int]
    members: tuple[Member, ...]
    distributions: tuple[Distribution, ...] = ()
    odd: tuple[Odd, ...] = ()
    shared: tuple[SharedCause, ...] = ()
    dependences: tuple[LotTrend, ...] = ()
    first_out: str | None = None
    warnings: tuple[str, ...] = ()

    folder: Path | None = Field(default=None, exclude=True)

    def to_polars(self) -> pl.DataFrame:
        """Return a row for each record: verdict, reason, and each parameter with its ends."""
        symbols: dict[str, None] = {}
        for member in self.members:
            symbols.update(dict.fromkeys(member.values))
        rows = []
        for member in self.members:
            row = member.model_dump(exclude={"values", "causes"}, by_alias=True)
            row["causes"] = "; ".join(cause.title for cause in member.causes)
            for symbol in symbols:
                value = member.values.get(symbol)
                row[symbol] = None if value is None else value.estimate
                row[f"{symbol}_low"] = None if value is None else value.low
                row[f"{symbol}_high"] = None if value is None else value.high
            rows.append(row)
        texts = ("record", "serial", "date", "verdict", "failed", "result", "status", "reason", "causes")
        schema: dict[str, type[pl.DataType]] = dict.fromkeys(texts, pl.String)
        schema["temperature_degC"] = pl.Float64
        for symbol in symbols:
            schema |= dict.fromkeys((symbol, f"{symbol}_low", f"{symbol}_high"), pl.Float64)
        return pl.DataFrame(rows, schema=schema)
