"""Tolerances of instruments: pass or fail of each with its reason."""

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from ..errors import InputError, nearest
from ..files import bytes_of
from ..result import Section, read_sections
from ..rounding import digits
from .result import InstrumentValue, Member, Status


class AllowedRange(Section):
    """Least and greatest allowed value of a parameter, and the largest allowed half width of its interval."""

    low: float | None = None
    high: float | None = None
    half_width: float | None = Field(default=None, gt=0.0)

    @model_validator(mode="after")
    def _limits_something(self) -> "AllowedRange":
        if self.low is None and self.high is None and self.half_width is None:
            raise ValueError("give low, high or half_width")
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise ValueError("low must be less than high")
        return self


class Tolerance(Section):
    """Table of tolerances: parameters by symbol, and the verdicts that pass."""

    schema_: Literal["trihedron.tolerance/1"] = Field(default="trihedron.tolerance/1", alias="schema")
    verdicts: list[str] = Field(default=["consistent"])
    parameters: dict[str, AllowedRange] = Field(default={})

    def judged(self, member: Member) -> Member:
        """Return a record with its status and the first reason; a record without a result is undecided."""
        if member.failed is not None:
            return member.model_copy(update={"status": "undecided", "reason": f"no result: {member.failed}"})
        status: Status = "pass"
        reason = None
        if member.verdict not in self.verdicts:
            status, reason = "fail", f"verdict: {member.verdict}"
        for symbol, limits in self.parameters.items():
            if status == "fail":
                break
            outcome, why = _status(symbol, limits, member.values.get(symbol))
            if outcome == "fail" or (outcome == "undecided" and status == "pass"):
                status, reason = outcome, why
        return member.model_copy(update={"status": status, "reason": reason})

    def check_symbols(self, members: list[Member]) -> None:
        """Raise InputError for a parameter that no record of the lot has."""
        known: dict[str, None] = {}
        for member in members:
            known.update(dict.fromkeys(member.values))
        for symbol in self.parameters:
            if known and symbol not in known:
                raise InputError(f"--tolerance: no record has a parameter '{symbol}'; {nearest(symbol, list(known))}")


def _status(symbol: str, limits: AllowedRange, value: InstrumentValue | None) -> tuple[Status, str]:
    """Return the status of a value, and the reason where it does not pass.

    It passes where the whole interval is allowed, and fails where no value of the interval is.
    """
    if value is None:
        return "undecided", f"{symbol} is not determined"
    low = value.estimate if value.low is None else value.low
    high = value.estimate if value.high is None else value.high
    if limits.half_width is not None:
        if value.low is None or value.high is None:
            return "undecided", f"{symbol} has no interval"
        half = (high - low) / 2.0
        if half > limits.half_width:
            return (
                "fail",
                f"half width of {symbol} is {digits(half, 3)}, at most {digits(limits.half_width, 3)} allowed",
            )
    shown = f"{symbol} = {digits(value.estimate, 4)} {value.unit}"
    for limit, certain, possible, word in (
        (limits.low, high, low, "least"),
        (limits.high, -low, -high, "greatest"),
    ):
        if limit is None:
            continue
        bound = limit if word == "least" else -limit
        if certain < bound:
            return "fail", f"{shown}; {word} allowed {digits(limit, 4)}"
        if possible < bound:
            return "undecided", f"{shown}; its interval contains the {word} allowed {digits(limit, 4)}"
    return "pass", ""


def read_tolerance(path: Path) -> Tolerance:
    """Read a table of tolerances (TOML).

    Raises InputError for a file that is none.
    """
    return read_sections(bytes_of(path), path, Tolerance)
