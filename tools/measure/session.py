"""A session at the table: what is planned, what is measured, what it says. A fold over visits and the operator's words.

The same visits and words give the same session, so that one that was killed is taken up again from what was written.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...fmus.parameters import GRAVITIES
from ..calibration import calibrate
from ..calibration.calibration import checked_noise_bound
from ..diagnosis import Diagnosis
from ..errors import InputError
from ..planning import DWELL_S, checked_dwell
from ..records import PositionRecord
from ..records.channels import Channels
from ..rounding import exactly
from .programme import Programme, Setting, inserted
from .visits import Visit, record_of

State = Literal["open", "repeat", "done"]
MOST_PROPOSED = 4
"""Positions that are proposed at once, and wait to be measured: those that follow are chosen when these are read."""
WITHIN = 1.02
"""A guaranteed error this many times what the plan promises keeps the promise: angles are set with errors."""


@dataclass(frozen=True)
class Asked:
    """What holds for a whole session: the options of `trihedron measure`.

    σ is a fraction of g, gravity in [m/s²], `within` how many times what the plan promises keeps the promise; a rest
    should be averaged over the dwell [s]; the session ends when nothing has come for `patience_s`, None: never.
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
        if self.read.radians or self.read.degrees:
            raise InputError(
                "--channels: angles are read in degrees while they are measured; say order and signs alone"
            )

    @cached_property
    def read(self) -> Channels:
        """How the channels are read."""
        return Channels.given(self.channels)


@dataclass(frozen=True)
class Standing:
    """What the good visits give: guaranteed errors [σ] by target, None where open; `against` are readings (position
    of the record, accelerometer) that prove the model wrong; `trouble` says why nothing could be computed."""

    errors: Mapping[str, float | None]
    radius: float = 0.0
    against: tuple[tuple[int, int], ...] = ()
    trouble: str = ""


@dataclass(frozen=True)
class Proposal:
    """Positions to add, or a visit to repeat, and why: what the operator may say yes to."""

    why: str
    settings: tuple[tuple[float, float], ...] = ()
    visit: int | None = None

    @property
    def word(self) -> dict[str, Any]:
        """The operator's yes, as it is written down."""
        if self.visit is not None:
            return {"word": "repeat", "visit": self.visit}
        return {"word": "add", "settings": [list(setting) for setting in self.settings], "why": self.why}


@dataclass(frozen=True)
class Session:
    """Where a measurement stands.

    Attributes
    ----------
    programme : Programme
    asked : Asked
    path : Path
        of the record
    settings : tuple of Setting
        in the order in which they are to be measured, added ones among them
    visits : tuple of Visit
        all rests
    setting_of : tuple of int or None
        to which setting's number each visit belongs
    dropped : frozenset of int
        numbers of good visits that the operator wants repeated
    history : tuple of Standing
        after each good visit
    """

    programme: Programme
    asked: Asked
    path: Path
    settings: tuple[Setting, ...]
    visits: tuple[Visit, ...] = ()
    setting_of: tuple[int | None, ...] = ()
    dropped: frozenset[int] = frozenset()
    history: tuple[Standing, ...] = ()

    @staticmethod
    def begun(programme: Programme, asked: Asked, path: Path) -> "Session":
        """A session in which nothing is measured yet."""
        return Session(programme, asked, path, programme.settings)

    @property
    def good(self) -> list[Visit]:
        """The visits that count, in the order of time."""
        return [visit for visit in self.visits if not visit.bad and visit.number not in self.dropped]

    def angles_deg(self, alpha: float, beta: float) -> tuple[float, float]:
        """Angles of the table from encoder readings [rad], by the channels [deg]."""
        read = self.asked.read
        return read.alpha * float(np.degrees(alpha)), read.beta * float(np.degrees(beta))

    def state_of(self, setting: Setting) -> State:
        """Whether a setting is measured, to be repeated, or open."""
        own = [v for v, number in zip(self.visits, self.setting_of, strict=True) if number == setting.number]
        if any(not visit.bad and visit.number not in self.dropped for visit in own):
            return "done"
        return "repeat" if own else "open"

    @property
    def left(self) -> list[Setting]:
        """The settings that are not done, in their order."""
        return [setting for setting in self.settings if self.state_of(setting) != "done"]

    @property
    def standing(self) -> Standing:
        """What the good visits so far give."""
        return self.history[-1] if self.history else Standing(dict.fromkeys(self.programme.promised))

    def share(self, symbol: str, standing: Standing | None = None) -> float | None:
        """A target's guaranteed error over what is promised; None where it is open."""
        error = (standing or self.standing).errors.get(symbol)
        return None if error is None else error / self.programme.promised[symbol]

    @property
    def worst(self) -> float | None:
        """The largest of these; None where one is open."""
        shares = [self.share(symbol) for symbol in self.programme.promised]
        known = [share for share in shares if share is not None]
        return max(known) if len(known) == len(shares) else None

    @property
    def reached(self) -> bool:
        """Whether every guaranteed error is within the promise."""
        return self.worst is not None and self.worst <= self.asked.within

    def record(self) -> PositionRecord | None:
        """The good visits as a position record, as their file has it; None where there are none."""
        return record_of(self.good, self.path) if self.good else None

    def header(self) -> dict[str, Any]:
        """What a session must have in common with what it is taken up again from."""
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


def taken(session: Session, visit: Visit) -> Session:
    """The session after a visit."""
    at = session.angles_deg(float(visit.average.alpha[0]), float(visit.average.beta[0]))
    near = [setting for setting in session.settings if setting.near(*at)]
    open_ = [setting for setting in near if session.state_of(setting) != "done"]
    chosen = min(open_ or near, key=lambda setting: (round(setting.distance(*at), 2), setting.number), default=None)
    number = None if chosen is None else chosen.number
    after = replace(session, visits=(*session.visits, visit), setting_of=(*session.setting_of, number))
    return after if visit.bad else _judged(after)


def told(session: Session, word: Mapping[str, Any]) -> Session:
    """The session after a word of the operator's; an InputError for one that cannot be followed."""
    if word["word"] == "repeat":
        visit = word["visit"]
        if visit not in [one.number for one in session.good]:
            raise InputError(f"repeat {visit}: no good rest has this number")
        return _judged(replace(session, dropped=session.dropped | {visit}))
    if word["word"] != "add":
        raise InputError(f"{word['word']}: is no word; add or repeat")
    first = max((setting.number for setting in session.settings), default=0) + 1
    more = [
        Setting(first + k, float(a), float(b), str(word.get("why", ""))) for k, (a, b) in enumerate(word["settings"])
    ]
    done = [session.state_of(setting) != "open" for setting in session.settings]
    before = next((k for k in range(len(done), 0, -1) if done[k - 1]), 0)
    return replace(session, settings=inserted(session.settings, more, before))


def _judged(session: Session) -> Session:
    record = session.record()
    if record is None:
        return replace(session, history=(*session.history, Standing(dict.fromkeys(session.programme.promised))))
    return replace(session, history=(*session.history, standing_of(session, record)))


def standing_of(session: Session, record: PositionRecord) -> Standing:
    """What `trihedron calibrate` says of the positions so far."""
    programme, asked = session.programme, session.asked
    try:
        found = calibrate(
            record.read_with(asked.read) if asked.channels else record,
            noise_bound=asked.noise_bound,
            gravity=asked.gravity,
            baseline=programme.baseline,
            convention=programme.convention,
            bounds=programme.bounds,
            mounting=dict(programme.mounting),
        )
    except InputError as error:
        before = session.standing
        return Standing(before.errors, trouble=str(error).removeprefix(f"{record.path}: "))
    errors = {e.symbol: e.guaranteed_error for e in found.parameters}
    return Standing(
        {
            name: None if (error := errors.get(name)) is None else error / asked.noise_bound
            for name in programme.promised
        },
        found.radius,
        tuple((one.position, one.accelerometer) for one in found.witness),
    )


def proposals_of(session: Session, diagnosis: Diagnosis | None) -> list[Proposal]:
    """What a diagnosis of the good visits asks for, of what is neither planned nor measured already."""
    found: list[Proposal] = []
    if diagnosis is None:
        return found
    for cause in (cause for some in (diagnosis.causes, *(diagnosis.alternatives or ())) for cause in some):
        if cause.place.effect == "outlier":
            position = int(cause.place.where.removeprefix("position-"))
            if position <= len(session.good):
                number = session.good[position - 1].number
                said = f"one reading of rest {number} is unlike all others: repeat it"
                found += [] if any(one.visit == number for one in found) else [Proposal(said, visit=number)]
    asked = diagnosis.next_positions or ()
    angles = [(float(setting["alpha_deg"]), float(setting["beta_deg"])) for setting in asked]
    new = [k for k, at in enumerate(angles) if not any(setting.near(*at) for setting in session.left)][:MOST_PROPOSED]
    if new and sum(bool(setting.why) for setting in session.left) < MOST_PROPOSED:
        names = list(dict.fromkeys(name for k in new for name in asked[k].get("separates", ())))
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        why = f"tells apart {', '.join(names[:3])}{more}" if names else "tells more of what is wrong"
        found.append(Proposal(why, tuple(angles[k] for k in new)))
    return found
