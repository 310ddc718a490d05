"""Decisions of a person about a record, kept beside its file and read with it: positions left out, rests, turns.

They stand in RECORD.decisions.toml. The record itself is never changed; without the file they are undone.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import bytes_of
from ..rounding import digits, exactly
from .columns import face_of, turn_of

SCHEMA = "trihedron.decisions/1"
MOST = 1 << 20
"""Largest file of decisions [bytes]."""
HEAD = """# Decisions about {record}, made on its page (trihedron open). Every command reads them with the record.
# Delete this file to undo them.
"""
KEYS = {"schema", "record_sha256", "left_out", "rests", "turns"}
ROWS = re.compile(r"[0-9]{1,9}(-[0-9]{1,9})?(,[0-9]{1,9}(-[0-9]{1,9})?)*")
"""Numbers of rows, and their ranges."""
MOST_ROWS = 1_000_000
"""Largest range of rows."""
LISTED = 8
"""Most positions that are named in a line."""


@dataclass(frozen=True)
class DecidedRest:
    """A rest as a person marked it.

    Attributes
    ----------
    from_s, to_s : float
        first and last time [s]
    face : str
        axis of the case that points up, as "+1"; empty where it is not known
    """

    from_s: float
    to_s: float
    face: str = ""


@dataclass(frozen=True)
class Decisions:
    """Decisions about one record.

    Attributes
    ----------
    left_out : tuple of int
        positions of a table of averaged readings that are not used, by their number
    rests : tuple of DecidedRest or None
        all rests of a series, in order of time; None: they are searched for
    turns : str
        known turns in order, as 1:360,2:360; empty: none
    file : str
        name of the file that holds them
    """

    left_out: tuple[int, ...] = ()
    rests: tuple[DecidedRest, ...] | None = None
    turns: str = ""
    file: str = ""

    def __bool__(self) -> bool:
        return bool(self.left_out or self.rests is not None or self.turns)

    def faces(self) -> tuple[str, ...]:
        """Return the face of each rest; empty where none is named."""
        faces = tuple(rest.face for rest in self.rests or ())
        return faces if any(faces) else ()

    def __str__(self) -> str:
        parts = []
        if self.left_out:
            numbers = [str(number) for number in self.left_out[:LISTED]]
            if len(self.left_out) > LISTED:
                numbers.append("...")
            noun = "position" if len(self.left_out) == 1 else "positions"
            parts.append(f"{noun} {', '.join(numbers)} left out")
        if self.rests is not None:
            parts.append(f"{len(self.rests)} rests as marked")
        if self.turns:
            parts.append(f"turns {self.turns}")
        return f"decisions ({self.file or 'not saved'}): {', '.join(parts)}"


def decisions_file(record: Path) -> Path:
    """Return the path of the decisions about a record's file."""
    return record.with_name(f"{record.stem}.decisions.toml")


def decisions_of(content: Mapping[str, Any], where: str) -> Decisions:
    """Return decisions from plain values.

    Raises
    ------
    InputError
        for an unknown key or a value that is none
    """
    unknown = set(content) - KEYS
    if unknown:
        raise InputError(f"{where}: {min(unknown)} is not a decision; use left_out, rests or turns")
    left_out = content.get("left_out", [])
    if not isinstance(left_out, list) or not all(type(number) is int and number > 0 for number in left_out):
        raise InputError(f"{where}: left_out: the numbers of positions are needed, as [21, 40]")
    turns = content.get("turns", "")
    if not isinstance(turns, str):
        raise InputError(f"{where}: turns: a text is needed, as '1:360,2:360'")
    for word in filter(None, turns.split(",")):
        _meant(turn_of, word, f"{where}: turns")
    return Decisions(tuple(sorted(set(left_out))), _rests_of(content.get("rests"), where), turns)


def _rests_of(values: Any, where: str) -> tuple[DecidedRest, ...] | None:
    """Return rests from plain values, in order of time; None of None."""
    if values is None:
        return None
    if not isinstance(values, list):
        raise InputError(f"{where}: rests: a list of [from_s, to_s, face] is needed")
    rests: list[DecidedRest] = []
    for number, value in enumerate(values, start=1):
        rests.append(_rest_of(value, f"{where}: rest {number}"))
    rests.sort(key=lambda rest: rest.from_s)
    for number, (before, after) in enumerate(pairwise(rests), start=2):
        if after.from_s < before.to_s:
            raise InputError(f"{where}: rest {number} begins at {exactly(after.from_s)} s, before the one above ends")
    return tuple(rests)


def _rest_of(value: Any, where: str) -> DecidedRest:
    """Return a rest from a list of its first time, its last time and perhaps its face."""
    wanted = f"{where}: [from_s, to_s, face] is needed, from_s below to_s"
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise InputError(wanted)
    begin, end = value[:2]
    face = value[2] if len(value) == 3 else ""
    if any(type(time) not in (int, float) or not np.isfinite(time) for time in (begin, end)) or not begin < end:
        raise InputError(wanted)
    if not isinstance(face, str):
        raise InputError(wanted)
    _meant(face_of, face, where)
    return DecidedRest(float(begin), float(end), face)


def _meant(reader: Any, word: str, where: str) -> None:
    """Refuse a word that its reader does not understand."""
    if not word:
        return
    try:
        reader(word.strip())
    except ValueError as error:
        raise InputError(f"{where}: {word}: {error}") from error


def read_decisions(record: Path, sha256: str) -> Decisions | None:
    """Return the decisions about a record's file of this content; None without any.

    Raises
    ------
    InputError
        for a file that cannot be read, or that is of another content
    """
    path = decisions_file(record)
    if not path.is_file():
        return None
    content = bytes_of(path, "a file of decisions is needed", most=MOST)
    try:
        values = tomllib.loads(content.decode())
    except ValueError as error:
        raise InputError(f"{path}: is not TOML ({str(error).splitlines()[0]}); mend or delete it") from error
    if values.get("schema") != SCHEMA:
        raise InputError(f"{path}: schema = '{SCHEMA}' is needed; delete the file, or make it by `trihedron open`")
    if values.get("record_sha256") != sha256:
        raise InputError(
            f"{path}: belongs to another content of {record.name}; delete it, or use `trihedron open {record}`"
        )
    return replace(decisions_of(values, str(path)), file=path.name)


def decisions_text(decisions: Decisions, record: Path, sha256: str) -> str:
    """Return the content of a file of decisions (TOML)."""
    lines = [HEAD.format(record=record.name) + f'schema = "{SCHEMA}"', f'record_sha256 = "{sha256}"']
    if decisions.left_out:
        lines.append(f"left_out = {list(decisions.left_out)}")
    if decisions.turns:
        lines.append(f'turns = "{decisions.turns}"')
    if decisions.rests is not None:
        lines.append("rests = [")
        for rest in decisions.rests:
            lines.append(f'  [{rest.from_s!r}, {rest.to_s!r}, "{rest.face}"],')
        lines.append("]")
    return "\n".join(lines) + "\n"


def with_decisions(record: Any, decisions: Decisions | None) -> Any:
    """Return a record with decisions: without the positions that are left out, its rests and turns as decided.

    Raises
    ------
    InputError
        for positions that it does not have, or decisions of another kind of record
    """
    if not decisions:
        return record
    is_table = "position" in record.groups
    if decisions.left_out and not is_table:
        raise InputError(f"{record.path}: a series has no positions to leave out; change its rests")
    if is_table and (decisions.rests is not None or decisions.turns):
        raise InputError(f"{record.path}: a table of averaged readings has no rests; leave positions out")
    if decisions.left_out:
        record = _without(record, decisions.left_out)
    return replace(record, decisions=decisions, warnings=(*record.warnings, f"{record.path}: {decisions}"))


def _without(record: Any, left_out: tuple[int, ...]) -> Any:
    """Return a table of averaged readings without some of its positions."""
    unknown = sorted(set(left_out) - set(record.position.tolist()))
    if unknown:
        raise InputError(f"{record.path}: position {unknown[0]} is left out, and the record has no such position")
    kept = ~np.isin(record.position, left_out)
    if not kept.any():
        raise InputError(f"{record.path}: all positions are left out; keep some")
    return record.selected(kept)


def rows_of(text: str) -> set[int]:
    """Return numbers of rows from their text, "42" or "6,19-30".

    Raises
    ------
    InputError
        for text that gives none, or ranges too wide for any table
    """
    if not ROWS.fullmatch(text):
        raise InputError(f"--without {text}: the numbers of rows are needed, as 42 or 6,19-30")
    numbers: set[int] = set()
    for part in text.split(","):
        first, _, last = part.partition("-")
        begin, end = int(first), int(last or first)
        if not 0 < begin <= end < begin + MOST_ROWS:
            raise InputError(f"--without {text}: {part} is no row or range of rows, which count from 1")
        numbers.update(range(begin, end + 1))
    return numbers


def without_rows(record: Any, text: str) -> Any:
    """Return a table of averaged readings, or of the rests of a series, without some rows, as of `rows_of`.

    Rows have the numbers that they have in the file.

    Raises
    ------
    InputError
        for rows that it does not have, or a record of another kind
    """
    if "position" not in record.groups:
        raise InputError(f"--without {text}: is of a table of averaged readings; {record.path} is a series")
    numbers = rows_of(text)
    if unknown := numbers - set(record.numbers.tolist()):
        last = int(record.numbers.max())
        raise InputError(f"--without {text}: {record.path} has rows up to {last}, and no row {min(unknown)}")
    kept = ~np.isin(record.numbers, list(numbers))
    if not kept.any():
        raise InputError(f"--without {text}: leaves no row of {record.path}; keep some")
    line = f"{record.path}: left out as asked: {'row' if len(numbers) == 1 else 'rows'} {text}"
    return replace(record.selected(kept), warnings=(*record.warnings, line))


def rows_of_rests(time_s: NDArray, rests: Sequence[DecidedRest], where: str) -> list[slice]:
    """Return the rows of each rest.

    Raises
    ------
    InputError
        for a rest with fewer than two readings
    """
    rows = []
    begins = np.searchsorted(time_s, [rest.from_s for rest in rests]).tolist()
    ends = np.searchsorted(time_s, [rest.to_s for rest in rests], side="right").tolist()
    for number, (rest, first, stop) in enumerate(zip(rests, begins, ends, strict=True), start=1):
        if stop - first < 2:
            span = f"{exactly(rest.from_s)} to {exactly(rest.to_s)} s"
            extent = f"the record is from {digits(float(time_s[0]), 6)} to {digits(float(time_s[-1]), 6)} s"
            raise InputError(f"{where}: rest {number} ({span}) holds no readings; {extent}")
        rows.append(slice(first, stop))
    return rows
