"""Files: reading with hints for missing ones, and writing that leaves each file complete or untouched."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .errors import InputError, NoSuchFileError, nearest_file, reason

LARGEST, LARGEST_RESULT, LARGEST_TEXT = 2 << 30, 256 << 20, 16 << 20
"""Bytes of the largest file that is read: of any kind, of a result (JSON), and of a text by a person (TOML, Python)."""
LONGEST_PART = 24
"""Characters of a name that the name of a draft beside it has, too: it may be longer than a system allows."""
ZIP = b"PK"
"""A ZIP archive begins so."""
OLD_WORKBOOK = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
"""What an Excel workbook of the old kind (.xls) begins with."""
OPEN_DOCUMENT = b"META-INF/manifest.xml"
"""A part that documents of LibreOffice have (.ods is the one with tables)."""


Placed = tuple[Path, Path, Sequence[Path]]
"""The draft of a file or folder, its place, and the files that are removed when it is in place."""
_PENDING: ContextVar[list[Placed] | None] = ContextVar("_PENDING", default=None)
"""Files and folders that a block which keeps files together has written."""
TAIL = 1 << 16
"""Bytes at the end of a text that show how its numbers are written."""
FEWEST_NUMBERS = 5
"""Fewer rows do not show it."""


@dataclass
class Touched:
    """The files that a command has read, by device and inode, and the paths that it has written itself."""

    read: dict[tuple[int, int], Path] = field(default_factory=dict)
    written: set[str] = field(default_factory=set)


_TOUCHED: ContextVar[Touched | None] = ContextVar("_TOUCHED", default=None)
"""Files that the running command has read and written."""


@contextmanager
def inputs_kept() -> Iterator[None]:
    """Protect all files read in the block from replacement; inside another such block, that one applies."""
    if _TOUCHED.get() is not None:
        yield
        return
    token = _TOUCHED.set(Touched())
    try:
        yield
    finally:
        _TOUCHED.reset(token)


def note_read(path: Path, status: os.stat_result) -> None:
    """Keep in mind that the command has read a file which it has not written itself."""
    touched = _TOUCHED.get()
    if touched is not None and os.path.realpath(path) not in touched.written:
        touched.read[status.st_dev, status.st_ino] = path.absolute()


def refuse_input(path: Path) -> None:
    """Refuse to replace or remove a file that the command has read, through any path or link."""
    touched = _TOUCHED.get()
    if touched is None or not path.exists():
        return
    status = path.stat()
    read = touched.read.get((status.st_dev, status.st_ino))
    # A file that is gone may have left its inode to another.
    if read is None or not read.exists() or not read.samefile(path):
        return
    also = "" if read == path.absolute() else f" as {read}"
    raise InputError(f"{path}: this command has read it{also} and would replace it; give another file or folder")


def note_own(path: Path) -> None:
    """Record that a file is the command's own: it may be read, and then written again."""
    touched = _TOUCHED.get()
    if touched is not None:
        touched.written.add(os.path.realpath(path))


@contextmanager
def together() -> Iterator[None]:
    """Let the files and folders that are written in the block appear at its end, all of them or none.

    Within another such block they appear at the end of that one.
    """
    if _PENDING.get() is not None:
        yield
        return
    pending: list[Placed] = []
    token = _PENDING.set(pending)
    try:
        yield
        _place(pending)
    finally:
        _PENDING.reset(token)
        for draft, _, _ in pending:
            _take_away(draft)


@contextmanager
def at_once() -> Iterator[None]:
    """Put the files written in the block in place at its end, even inside a block that keeps files together."""
    token = _PENDING.set(None)
    try:
        yield
    finally:
        _PENDING.reset(token)


def _place(pending: Sequence[Placed]) -> None:
    """Move all drafts into place, the files of a folder into that folder; or none of them.

    If one cannot be moved, the former contents of the other places come back.
    """
    placed: set[Path] = set()
    for draft, path, obsolete in pending:
        for place in (*_places(draft, path), *obsolete):
            refuse_input(place)
    with ExitStack() as tidy, ExitStack() as undo:
        for draft, path, _ in pending:
            with said_writable(path):
                if draft.is_dir() and not path.is_dir():
                    path.mkdir()
                    undo.callback(_take_away, path)
                moves = _places(draft, path)
                for place, new in moves.items():
                    if place.is_file() and len(pending) + len(moves) > 2:
                        aside = Path(tempfile.mkdtemp(dir=place.parent, prefix=f".{place.name}-"))
                        tidy.callback(_take_away, aside)
                        before = aside / f"{place.name}.before"
                        _second_name(place, before)
                        undo.callback(before.replace, place)
                    elif not place.exists():
                        undo.callback(_take_away, place)
                    new.replace(place)
                    placed.add(place)
                    note_own(place)
        undo.pop_all()
    for stale in {path for _, _, obsolete in pending for path in obsolete} - placed:
        _take_away(stale)


def _places(draft: Path, path: Path) -> dict[Path, Path]:
    """Return each final path with its draft: a file, or each file of a folder."""
    if not draft.is_dir():
        return {path: draft}
    return {path / file.name: file for file in sorted(draft.iterdir())}


def _second_name(path: Path, name: Path) -> None:
    """Give a file a second name; a copy where the file system knows one name only."""
    try:
        name.hardlink_to(path)
    except OSError:
        shutil.copy2(path, name)


def _take_away(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def _beside(draft: Path, path: Path, obsolete: Sequence[Path] = ()) -> Iterator[Path]:
    """Yield a draft to fill; it moves to its place when the block, or the block around it, ends without an error."""
    pending = _PENDING.get()
    is_pending = False
    try:
        yield draft
        if pending is None:
            _place([(draft, path, obsolete)])
        else:
            pending.append((draft, path, obsolete))
            is_pending = True
    finally:
        if not is_pending:
            _take_away(draft)


def make_folders(folder: Path) -> None:
    """Make a folder and those above it that are missing, however many they are."""
    missing = []
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    for place in reversed(missing):
        place.mkdir(exist_ok=True)


@contextmanager
def said_writable(path: object, also: type[Exception] = OSError) -> Iterator[None]:
    """Report that a file or folder cannot be written when the block raises an OSError (or `also` another)."""
    if "\0" in str(path):
        raise InputError(f"{str(path)!r}: cannot be written (it holds the character NUL)")
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({reason(error)})") from error
    except also as error:
        raise InputError(f"{path}: cannot be written ({error})") from error


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path next to `path` to write to; rename it to `path` when the block ends without an error.

    Missing folders are made; an InputError where the folder cannot be written.
    """
    path = Path(path)
    with said_writable(path):
        make_folders(path.parent)
        if path.is_dir():
            raise InputError(f"{path}: is a directory; give the name of a file")
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is a device or a pipe; give the name of a file")
        prefix, suffix = f".{path.stem[:LONGEST_PART]}-", path.suffix[:LONGEST_PART]
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=prefix, suffix=suffix)
        os.close(handle)
        with _beside(Path(name), path) as draft:
            yield draft
            umask = os.umask(0)
            os.umask(umask)
            draft.chmod(0o666 & ~umask)


@contextmanager
def whole_folder(path: Path, obsolete: Sequence[str] = ()) -> Iterator[Path]:
    """Yield a folder next to `path` to fill; its files move into `path` when the block ends without an error.

    Files of the same name in an existing `path` are replaced; others are left alone. The block may also name files or
    folders in `path` as `obsolete`: these are removed where it has not made them. An InputError where the folder cannot
    be written.
    """
    path = Path(path)
    with said_writable(path):
        make_folders(path.parent)
        if path.exists() and not path.is_dir():
            raise InputError(f"{path}: is a file; give the name of a folder")
        folder = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name[:LONGEST_PART]}-"))
        # Files written in it appear with it.
        with _beside(folder, path, [path / name for name in obsolete]) as draft, at_once():
            yield draft


def made_folder(folder: Path, out: Path) -> None:
    """Make the folder of `--out`."""
    try:
        make_folders(folder)
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be made a folder ({error.strerror})") from error


def bytes_of(
    path: Path,
    wanted: str = "give the name of a file",
    *,
    label: str | None = None,
    most: int = LARGEST,
    archive: bool = False,
) -> bytes:
    """The bytes of a regular file: everything that is named by a user, or in a file of a user's, is read here.

    Parameters
    ----------
    path : Path
        the file
    wanted : str
        the right kind of input in place of a folder or a device
    label : str
        name of the file in a refusal where that is not its path: a name in a scenario, for instance
    most : int
        bytes that it may have
    archive : bool
        true if only a ZIP archive is of use: another file is not read

    Raises
    ------
    InputError
        a directory, a device, a pipe, no file, one that may not be read, one that is larger, or no archive
    """
    name, looked = (str(path), "") if label is None else (label, f" (looked for {path})")
    try:
        if path.is_dir():
            raise InputError(f"{name}: is a directory; {wanted}")
        if not path.exists():
            raise NoSuchFileError(f"{name}: no such file{nearest_file(path)}{looked}")
        if not path.is_file():
            raise InputError(f"{name}: is not a regular file; {wanted}")
        with path.open("rb") as file:
            status = os.fstat(file.fileno())
            note_read(path, status)
            size = status.st_size
            if size > most:
                raise InputError(f"{name}: is larger than {_size(most)}; not read")
            if archive and file.read(len(ZIP)) != ZIP:
                raise InputError(f"{name}: is not a ZIP archive, which an {path.suffix} is")
            file.seek(0)
            return file.read(size)
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror})") from error


def is_workbook(content: bytes) -> bool:
    """Return true if bytes are a workbook: a ZIP archive (.xlsx, .xlsb, .ods) or the old kind (.xls)."""
    archive = content.startswith(ZIP) and (b"xl/workbook" in content or OPEN_DOCUMENT in content)
    return archive or content.startswith(OLD_WORKBOOK)


# Kinds of files, for every reader

_SCHEMA = re.compile(rb"^\s*[{]?\s*\"?schema\"?\s*[=:]\s*\"trihedron\.([a-z-]+)/\d+\"", re.MULTILINE)
_OF_RECORD = re.compile(rb"\b(alpha_deg|f1_mps2|w1_radps|dtheta1_rad)\b")
_NAMES = re.compile(rb'[\w"]+(,[\w" ]+){2,}')
_SNIFFED = 4000
"""Bytes at the beginning of a file that show its kind."""
KINDS_OF_FILES = {
    "scenario": "a scenario: did you mean `trihedron simulate {file}`?",
    "campaign": "a campaign: did you mean `trihedron campaign {file}`?",
    "calibration": "a calibration: did you mean `trihedron apply {file} RECORD`?",
    "diagnosis": "a diagnosis: did you mean `trihedron apply {file} RECORD`?",
    "plan": "a plan: did you mean `trihedron measure {file}`?",
    "imu-plan": "a plan for the whole IMU: did you mean `trihedron measure {file}`?",
    "run": "the account of a run: its rows are in run.parquet or run.csv beside it, its rests in positions.csv",
    "mapping": "a mapping: did you mean `trihedron import FILE --mapping {file}`?",
    "instrument": "an entry of an instrument's folder: did you mean `trihedron instrument trend FOLDER`?",
    "record": "a record: did you mean `trihedron calibrate {file}` or `trihedron check {file}`?",
    "FMU": "an FMU: did you mean `trihedron simulate {file}`?",
    "system": "a system of FMUs (SSP): did you mean `trihedron simulate {file}`?",
    "workbook": "a workbook: did you mean `trihedron import {file} --out RECORD.csv`?",
}
"""Kinds of file, and the advice when one is given in place of another."""
OTHER_RESULT = "a result of another command ({kind}): give the file that it was made from"


def kind_of_file(content: bytes) -> str:
    """Return the kind of a file, as its schema or `KINDS_OF_FILES` names it, from its bytes, or ""."""
    if is_workbook(content):
        return "workbook"
    if content.startswith(ZIP):
        if b"SystemStructure.ssd" in content:
            return "system"
        return "FMU" if b"modelDescription.xml" in content else ""
    beginning = content[:_SNIFFED]
    schema = _SCHEMA.search(beginning)
    if schema is not None:
        return schema[1].decode("ascii")
    names = next((line for line in beginning.splitlines() if line.strip() and not line.startswith(b"#")), b"")
    if _NAMES.fullmatch(names.strip()) and _OF_RECORD.search(names):
        return "record"
    return ""


def advice_on(path: object, content: bytes, *right: str) -> str:
    """Return a hint for a refused file, "; this is a scenario: did you mean ...?"; empty if unknown or right."""
    kind = kind_of_file(content)
    if not kind or kind in right:
        return ""
    return f"; this is {KINDS_OF_FILES.get(kind, OTHER_RESULT).format(file=shlex.quote(str(path)), kind=kind)}"


def _size(count: int) -> str:
    if count >= 1 << 30:
        return f"{count >> 30} GiB"
    return f"{count >> 20} MiB"


def json_text(content: Mapping[str, Any], indent: int = 2) -> str:
    """Plain values as the text of a JSON file."""
    return json.dumps(content, indent=indent, ensure_ascii=False, allow_nan=False) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8", newline="\n")


def ordinary_file(_: object, path: Path | None) -> None:
    """Refuse the name of a device or a pipe, because a complete file would replace it."""
    if path is None:
        return
    if path.is_dir():
        raise InputError(f"{path}: is a directory; give the name of a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is not a regular file; give the name of a file")
    _in_a_folder(path)


def ordinary_folder(_: object, path: Path | None) -> None:
    """Refuse the name of a folder if a file has it, before any computation."""
    if path is None:
        return
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file; give the name of a folder")
    _in_a_folder(path)


def _in_a_folder(path: Path) -> None:
    for above in path.parents:
        if above.is_dir():
            if not os.access(above, os.W_OK):
                raise InputError(f"{path}: cannot be written (nothing may be put into {above})")
            return
        if above.exists():
            raise InputError(f"{path}: cannot be written ({above} is a file)")


# Parquet files of others: another process looks at one first, as a corrupt one may end the process that reads it

MAGIC = b"PAR1"
"""First bytes of a Parquet file."""
MOST_NUMBERS = 200_000_000
"""Rows times columns of a file that is read, compressed as it may be: 1.6 GB in memory."""

_PROBE = f"""
import io, sys
import polars as pl
data = sys.stdin.buffer.read()
try:
    width = len(pl.read_parquet_schema(io.BytesIO(data)))
    rows = pl.scan_parquet(io.BytesIO(data)).select(pl.len()).collect().item()
    if rows * width > {MOST_NUMBERS}:
        print(f"has {{rows}} rows of {{width}} columns; at most {MOST_NUMBERS} numbers are read")
        sys.exit(1)
    pl.read_parquet(io.BytesIO(data))
except (Exception, pl.exceptions.PanicException) as error:
    reason = (str(error).strip() or type(error).__name__).splitlines()[0]
    print(f"is not a readable Parquet file ({{reason[:120]}})")
    sys.exit(1)
"""


def fault_of_parquet(content: bytes) -> str | None:
    """Why the bytes of a Parquet file cannot be read, or are too many numbers to read; None where they can."""
    probe = subprocess.run([sys.executable, "-I", "-c", _PROBE], input=content, capture_output=True, check=False)
    if probe.returncode == 0:
        return None
    message = probe.stdout.decode("utf-8", "replace").strip()
    return message or "is not a readable Parquet file (it is corrupt)"


def cut_warning(content: bytes) -> tuple[str, ...]:
    """Return a line for a text, given its end, that may be cut inside its last number; nothing of another.

    It has no end of line, and fewer digits in its last number than the rows before. Where these differ among
    themselves, it has fewer by more than that.
    """
    content = content[-TAIL:]
    if content.endswith((b"\n", b"\r")):
        return ()
    last = [re.split(rb"[,;\s]+", line.strip())[-1] for line in content.splitlines()[1:]]
    numbers = [text.lstrip(b"+-") for text in last if re.fullmatch(rb"[+-]?\d*\.?\d*(e[+-]?\d+)?", text, re.IGNORECASE)]
    if len(numbers) <= FEWEST_NUMBERS or numbers[-1] != last[-1].lstrip(b"+-"):
        return ()
    if any(b"." in text for text in numbers[:-1]):
        numbers = [text.partition(b".")[2] for text in numbers]
    *before, size = map(len, numbers)
    if size >= 2 * min(before) - max(before):
        return ()
    return (
        "the last row may be cut inside its last number: it has fewer digits than the rows before, and no end of line; "
        "record or copy the file again, or take that row out",
    )
