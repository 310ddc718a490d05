"""What a session at the table came to, as a result."""

from typing import Annotated, Literal

from pydantic import Field

from ..calibration.result import Number, Size
from ..result import Result
from .background import Diagnosing
from .session import Session


class MeasuredPosition(Result):
    """A rest: its number, the position of the plan (None: of none), encoder readings [deg], lines of the record, and
    why it does not count."""

    rest: int
    position: int | None
    alpha_deg: Number
    beta_deg: Number
    rows: tuple[int, int]
    counts: bool
    why: str


class MeasuredTarget(Result):
    """A target's guaranteed error and what the plan promises; None where the positions leave it open."""

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
        readings in the record; lines that could be none
    planned, added, done : int
        positions of the plan, positions added to it, and how many of both are measured
    noise_bound : float
        σ
    promise_reached : bool
    targets : tuple of MeasuredTarget
    rests : tuple of MeasuredPosition
    falsified : bool
        whether the positions contradict the model
    verdict : str or None
        of the last diagnosis; None where there was none
    causes : tuple of str
        what it names
    diagnosed : int
        positions that it is of
    ended : {"source", "operator", "patience"}
        what ended the session
    """

    schema_: Literal["trihedron.measure/1"] = Field(default="trihedron.measure/1", alias="schema")
    record: str
    positions_file: str | None
    rows: int
    left_out: int
    planned: int
    added: int
    done: int
    noise_bound: Annotated[float, Field(gt=0.0)]
    promise_reached: bool
    targets: tuple[MeasuredTarget, ...]
    rests: tuple[MeasuredPosition, ...]
    falsified: bool
    verdict: str | None
    causes: tuple[str, ...]
    diagnosed: int
    ended: Literal["source", "operator", "patience"]
    trouble: str = ""


def measured(
    session: Session,
    diagnosing: Diagnosing,
    rows: int,
    left_out: int,
    ended: Literal["source", "operator", "patience"],
    positions: str | None,
) -> Measured:
    """The result of a session that has ended."""
    standing, sigma, found = session.standing, session.asked.noise_bound, diagnosing.found
    rests = []
    for visit, setting in zip(session.visits, session.setting_of, strict=True):
        alpha, beta = session.angles_deg(float(visit.average.alpha[0]), float(visit.average.beta[0]))
        why = visit.bad or ("repeated on the operator's word" if visit.number in session.dropped else "")
        rests.append(
            MeasuredPosition(
                rest=visit.number,
                position=setting,
                alpha_deg=alpha,
                beta_deg=beta,
                rows=(visit.first_row, visit.last_row),
                counts=not why,
                why=why,
            )
        )
    targets = tuple(
        MeasuredTarget(
            symbol=name,
            guaranteed_error=None if (error := standing.errors.get(name)) is None else sigma * error,
            promised=sigma * promised,
        )
        for name, promised in session.programme.promised.items()
    )
    planned = len(session.programme.settings)
    return Measured(
        record=str(session.path),
        positions_file=positions,
        rows=rows,
        left_out=left_out,
        planned=planned,
        added=len(session.settings) - planned,
        done=len(session.settings) - len(session.left),
        noise_bound=sigma,
        promise_reached=session.reached,
        targets=targets,
        rests=tuple(rests),
        falsified=bool(standing.against),
        verdict=None if found is None else found.verdict,
        causes=() if found is None or found.verdict != "explained" else tuple(c.place.title for c in found.causes),
        diagnosed=diagnosing.of,
        ended=ended,
        trouble=standing.trouble or diagnosing.trouble,
    )
