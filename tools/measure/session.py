"""A session at the table: the plan, the rests so far and their results. A fold over visits and the operator's words.

The same visits and words give the same session, so a killed session is resumed from its files.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ...fmus.parameters import GRAVITIES
from ..calibration import calibrate
from ..calibration.calibration import checked_noise_bound
from ..diagnosis import Diagnosis
from ..errors import InputError
from ..fields import Number, Size
from ..planning import DWELL_S, checked_dwell
from ..records import PositionRecord
from ..records.channels import Channels
from ..result import Result
from ..rounding import exactly
from .programme import SAME_DEG, TableProgramme, TableSetting
from .visits import RestVisit, record_of_visits

State = Literal["open", "repeat", "done"]
Ending = Literal["source", "operator", "patience"]
WITHIN = 1.02
"""Tolerance of the promise: the allowed ratio of a guaranteed error to its planned value, since angles have errors."""


@dataclass(frozen=True)
class SessionOptions:
    """Options of a whole session: those of `trihedron measure`.

    σ is a fraction of g, gravity in [m/s²]. `within` is the allowed ratio of a guaranteed error to its planned value. A
    rest should be averaged over the dwell [s]. The session ends after `patience_s` without readings [s], None: never.
    """

    noise_bound: float
    gravity: float = 9.80665
    channels: tuple[str, ...] = ()
    within: float = WITHIN
    dwell_s: float = DWELL_S
    patience_s: float | None = None

    def __post_init__(self) -> None:
        checked_noise_bound(self.noise_bound)
        checked_dwell(self.dwell_s)
        for name, value, least, most in (
            ("gravity", self.gravity, *GRAVITIES),
            ("promise", self.within, 1.0, 1e3),
            ("patience", self.patience_s or 0.0, 0.0, 1e9),
        ):
            if not least <= value <= most:
                raise InputError(f"--{name} {exactly(value)}: must be from {exactly(least)} to {exactly(most)}")
        if self.channels_read.radians or self.channels_read.degrees:
            raise InputError(
                "--channels: angles are read in degrees while they are measured; say order and signs alone"
            )

    @cached_property
    def channels_read(self) -> Channels:
        """Return the channel options."""
        return Channels.given(self.channels)


@dataclass(frozen=True)
class SessionStanding:
    """The results of the good visits.

    Attributes
    ----------
    errors : mapping of str to float or None
        guaranteed error [σ] of each target; None if it is undetermined
    radius : float
        largest residual in units of σ
    against : tuple of (int, int)
        readings (position of the record, accelerometer) that prove the model wrong
    trouble : str
        reason for missing results
    """

    errors: Mapping[str, float | None]
    radius: float = 0.0
    against: tuple[tuple[int, int], ...] = ()
    trouble: str = ""


@dataclass(frozen=True)
class Session:
    """The state of a measurement.

    Attributes
    ----------
    programme : Programme
        the plan
    asked : Asked
        options of the session
    path : Path
        path of the record
    visits : tuple of Visit
        all rests
    setting_of : tuple of int or None
        number of the setting of each visit
    dropped : frozenset of int
        numbers of good visits that the operator wants repeated
    history : tuple of Standing
        results after each good visit
    """

    programme: TableProgramme
    asked: SessionOptions
    path: Path
    visits: tuple[RestVisit, ...] = ()
    setting_of: tuple[int | None, ...] = ()
    dropped: frozenset[int] = frozenset()
    history: tuple[SessionStanding, ...] = ()

    def counts(self, visit: RestVisit) -> bool:
        """Return True if a visit is good and not to be repeated."""
        return not visit.bad and visit.number not in self.dropped

    @property
    def good(self) -> list[RestVisit]:
        """Return the visits that count, in the order of time."""
        return [visit for visit in self.visits if self.counts(visit)]

    def angles_deg(self, alpha: float, beta: float) -> tuple[float, float]:
        """Return angles of the table from encoder readings [rad], by the channels [deg]."""
        channels = self.asked.channels_read
        return channels.alpha * float(np.degrees(alpha)), channels.beta * float(np.degrees(beta))

    def visit_angles_deg(self, visit: RestVisit) -> tuple[float, float]:
        """Return angles of the table at a visit [deg]."""
        return self.angles_deg(float(visit.average.alpha[0]), float(visit.average.beta[0]))

    def visits_to(self, setting: TableSetting) -> list[RestVisit]:
        """Return the visits to a setting."""
        numbered = zip(self.visits, self.setting_of, strict=True)
        return [visit for visit, number in numbered if number == setting.number]

    def state_of(self, setting: TableSetting) -> State:
        """Return the state of a setting: "done", "repeat" or "open"."""
        visits = self.visits_to(setting)
        if any(map(self.counts, visits)):
            return "done"
        if visits:
            return "repeat"
        return "open"

    @property
    def left(self) -> list[TableSetting]:
        """Return the settings that are not done, in order."""
        return [setting for setting in self.programme.settings if self.state_of(setting) != "done"]

    @property
    def standing(self) -> SessionStanding:
        """Results of the good visits so far."""
        if self.history:
            return self.history[-1]
        return SessionStanding(dict.fromkeys(self.programme.promised))

    def share(self, symbol: str, standing: SessionStanding | None = None) -> float | None:
        """Return a target's guaranteed error over its promised value; None if it is undetermined."""
        error = (standing or self.standing).errors.get(symbol)
        if error is None:
            return None
        return error / self.programme.promised[symbol]

    @property
    def worst(self) -> float | None:
        """Largest of these ratios; None if a target is undetermined."""
        largest = 0.0
        for symbol in self.programme.promised:
            share = self.share(symbol)
            if share is None:
                return None
            largest = max(largest, share)
        return largest

    @property
    def reached(self) -> bool:
        """True if every guaranteed error is within the promise."""
        return self.worst is not None and self.worst <= self.asked.within

    def record(self) -> PositionRecord | None:
        """Return the good visits as a position record, as in their file; None if there are none."""
        if not self.good:
            return None
        return record_of_visits(self.good, self.path)

    def header(self) -> dict[str, Any]:
        """Return the header that must agree when a session is resumed."""
        return {
            "schema": "trihedron.session/1",
            "settings": [[setting.alpha_deg, setting.beta_deg] for setting in self.programme.settings],
            "mounting": dict(self.programme.mounting),
            "baseline": self.programme.baseline,
            "noise_bound": self.asked.noise_bound,
            "gravity": self.asked.gravity,
            "channels": list(self.asked.channels),
            "dwell_s": self.asked.dwell_s,
        }

    def after(self, visit: RestVisit) -> "Session":
        """Return the session after a visit: it belongs to the nearest setting, an open one before a measured one."""
        angles = self.visit_angles_deg(visit)
        candidates = []
        for setting in self.programme.settings:
            distance = setting.distance(*angles)
            if distance <= SAME_DEG:
                candidates.append((self.state_of(setting) == "done", round(distance, 2), setting.number))
        number = None
        if candidates:
            _, _, number = min(candidates)
        session = replace(self, visits=(*self.visits, visit), setting_of=(*self.setting_of, number))
        if visit.bad:
            return session
        return session._judged()

    def told(self, word: Mapping[str, Any]) -> "Session":
        """Return the session after a word of the operator.

        Raises InputError for an impossible word.
        """
        if word["word"] != "repeat":
            raise InputError(f"{word['word']}: is not an answer; repeat is one")
        number = word["visit"]
        if all(visit.number != number for visit in self.good):
            raise InputError(f"repeat {number}: no good rest has this number")
        return replace(self, dropped=self.dropped | {number})._judged()

    def _judged(self) -> "Session":
        record = self.record()
        standing = SessionStanding(dict.fromkeys(self.programme.promised))
        if record is not None:
            standing = standing_of(self, record)
        return replace(self, history=(*self.history, standing))


def standing_of(session: Session, record: PositionRecord) -> SessionStanding:
    """Return the results of `trihedron calibrate` for the positions so far."""
    programme, options = session.programme, session.asked
    try:
        channels_record = record
        if options.channels:
            channels_record = record.read_with(options.channels_read)
        calibration = calibrate(
            channels_record,
            noise_bound=options.noise_bound,
            gravity=options.gravity,
            baseline=programme.baseline,
            convention=programme.convention,
            bounds=programme.bounds,
            mounting=dict(programme.mounting),
        )
    except InputError as error:
        return SessionStanding(session.standing.errors, trouble=str(error).removeprefix(f"{record.path}: "))
    errors: dict[str, float | None] = dict.fromkeys(programme.promised)
    for estimate in calibration.parameters:
        if estimate.symbol in errors and estimate.guaranteed_error is not None:
            errors[estimate.symbol] = estimate.guaranteed_error / options.noise_bound
    witness = tuple((reading.position, reading.accelerometer) for reading in calibration.witness)
    return SessionStanding(errors, calibration.radius or 0.0, witness)


class MeasuredPosition(Result):
    """A rest: its number, its position of the plan (None: none), encoder readings [deg], lines of the record, and the
    reason if it does not count."""

    rest: int
    position: int | None
    alpha_deg: Number
    beta_deg: Number
    rows: tuple[int, int]
    counts: bool
    why: str


class MeasuredTarget(Result):
    """A target's guaranteed error and its promised value; None if the positions leave it undetermined."""

    symbol: str
    guaranteed_error: Size | None
    promised: Size


class Measured(Result):
    """A session at the table.

    Attributes
    ----------
    record, positions_file : str
        the raw record; the positions that count
    rows, left_out : int
        readings in the record; lines that are not rows
    planned, done : int
        positions of the plan, and the number of measured ones
    noise_bound : float
        σ
    promise_reached : bool
        True if every guaranteed error is within the promise
    targets : tuple of MeasuredTarget
        error of each target
    rests : tuple of MeasuredPosition
        all rests
    falsified : bool
        True if the positions contradict the model
    verdict : str or None
        verdict of the final diagnosis; None without one
    causes : tuple of str
        causes that it names
    diagnosed : int
        number of diagnosed positions
    ended : {"source", "operator", "patience"}
        reason for the end
    """

    schema_: Literal["trihedron.measure/1"] = Field(default="trihedron.measure/1", alias="schema")
    record: str
    positions_file: str | None
    rows: int
    left_out: int
    planned: int
    done: int
    noise_bound: Annotated[float, Field(gt=0.0)]
    promise_reached: bool
    targets: tuple[MeasuredTarget, ...]
    rests: tuple[MeasuredPosition, ...]
    falsified: bool
    verdict: str | None
    causes: tuple[str, ...]
    diagnosed: int
    ended: Ending
    trouble: str = ""


def measured(session: Session, diagnosis: Diagnosis | None, **counted: Any) -> Measured:
    """Return the result of an ended session; `counted` are fields that the session does not know."""
    standing, sigma = session.standing, session.asked.noise_bound
    rests = []
    for visit, setting in zip(session.visits, session.setting_of, strict=True):
        alpha, beta = session.visit_angles_deg(visit)
        why = visit.bad
        if not why and visit.number in session.dropped:
            why = "repeated on the operator's word"
        rest = MeasuredPosition(
            rest=visit.number,
            position=setting,
            alpha_deg=alpha,
            beta_deg=beta,
            rows=(visit.first_row, visit.last_row),
            counts=not why,
            why=why,
        )
        rests.append(rest)
    targets = []
    for symbol, promised in session.programme.promised.items():
        error = standing.errors.get(symbol)
        guaranteed = None
        if error is not None:
            guaranteed = sigma * error
        targets.append(MeasuredTarget(symbol=symbol, guaranteed_error=guaranteed, promised=sigma * promised))
    planned = len(session.programme.settings)
    verdict, diagnosed = None, 0
    causes: list[str] = []
    if diagnosis is not None:
        verdict, diagnosed = diagnosis.verdict, len(session.good)
        if verdict == "explained":
            causes = [cause.place.title for cause in diagnosis.causes]
    return Measured(
        record=str(session.path),
        planned=planned,
        done=planned - len(session.left),
        noise_bound=sigma,
        promise_reached=session.reached,
        targets=tuple(targets),
        rests=tuple(rests),
        falsified=bool(standing.against),
        verdict=verdict,
        causes=tuple(causes),
        diagnosed=diagnosed,
        **counted,
    )
