"""Carry out a batch: work on each record, its folder, and the lot of its instruments."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from io import BytesIO
from pathlib import Path

from .. import reports
from ..campaign.code import code_hash
from ..errors import InputError, reason
from ..files import bytes_of, json_text, made_folder, said_writable, whole_file, write_text
from ..locks import Taken, locked
from ..lot import Lot, Member, lot_of, read_tolerance
from ..progress import progress_bar
from ..workers import made
from .jobs import Job, jobs_of
from .library import BatchRequest, Do
from .work import Done, worked

SCHEMA = "trihedron.batch/1"
MANIFEST, LOCK, TABLE, LOT, PAGE = "batch.json", "batch.lock", "records.parquet", "lot.json", "index.html"


def carry_out(request: BatchRequest) -> Lot:
    """Carry out a batch; see `trihedron.batch`."""
    folder = request.out
    work = jobs_of(request.files, request.do, request.options)
    table = None if request.tolerance is None else read_tolerance(request.tolerance)
    rows = _members_of_folder(folder, work) if request.resume else {}
    missing = [job for job in work if job.record not in rows]
    # Refuse impossible options before anything is written.
    results = made(worked, missing, engine=request.engine, jobs=request.jobs, scheduler=request.scheduler)
    with ExitStack() as stack:
        stack.enter_context(closing(results))
        stack.enter_context(_alone(folder))
        _begin(folder, request.do, resume=request.resume)
        advance = stack.enter_context(progress_bar("records", len(work), show=request.progress))
        advance(len(rows))
        try:
            for done in results:
                _write(folder, done, request.do)
                rows[done.member.record] = done.member
                advance(1)
        except InputError as error:
            raise InputError(f"{error}; {_kept(rows, work, folder)}") from error
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted; {_kept(rows, work, folder)}") from None
        members = [rows[job.record] for job in work]
        if all(member.failed is not None for member in members):
            raise InputError(f"no record has a result; the first: {members[0].failed}")
        lot = lot_of(members, request.do, table, _warnings(rows)).model_copy(update={"folder": folder})
        _write_lot(folder, lot)
    return lot


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep others out of the folder of a batch; take it away if nothing was written."""
    made_folder(folder, folder)
    try:
        with ExitStack() as stack:
            try:
                with said_writable(folder / LOCK):
                    stack.enter_context(locked(folder / LOCK))
            except Taken:
                raise InputError(f"--out {folder}: another process uses it") from None
            yield
    finally:
        if [path.name for path in folder.iterdir()] == [LOCK]:
            (folder / LOCK).unlink()
            folder.rmdir()


def _kept(rows: Mapping[str, Member], work: Sequence[Job], folder: Path) -> str:
    return f"{len(rows)} of {len(work)} records are in {folder}; continue with --resume"


def _begin(folder: Path, do: Do, *, resume: bool) -> None:
    """Check the manifest of the folder, if it has one.

    Raises InputError for a folder with another batch, with this one while `resume` is false, or with other files.
    """
    path = folder / MANIFEST
    if not path.exists():
        others = sorted(one.name for one in folder.iterdir() if one.name != LOCK)
        if others:
            raise InputError(
                f"--out {folder}: holds {others[0]}, which does not belong to a batch; give another folder"
            )
        return
    if not resume:
        raise InputError(f"--out {folder}: already has a batch; continue it with --resume, or give another folder")
    try:
        before = json.loads(bytes_of(path))
    except ValueError as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    if before.get("do") != do:
        raise InputError(f"--resume: {folder} is a batch of {before.get('do')}, not of {do}; give another --out")
    if before != _manifest(do):
        raise InputError(
            f"--resume: {folder} was made by another version of Trihedron or of its libraries; give another --out"
        )


def _members_of_folder(folder: Path, work: Sequence[Job]) -> dict[str, Member]:
    """Return the rows that the folder holds of unchanged records with unchanged options, by record."""
    rows = {}
    for job in work:
        try:
            key = job.key()
            text = (folder / "rows" / f"{key}.json").read_bytes()
        except OSError:
            continue
        try:
            member = Member.model_validate_json(text)
        except ValueError:
            continue
        changed = any(getattr(member, _FIELDS[name]) != _fact(name, text) for name, text in job.facts.items())
        if not changed and (folder / str(member.result)).is_file():
            rows[job.record] = member
    return rows


_FIELDS = {"serial": "serial", "date": "date", "temperature_degC": "temperature"}
"""Facts of a table -> fields of a row."""


def _fact(name: str, text: str) -> str | float:
    return float(text) if name == "temperature_degC" else text


def _manifest(do: Do) -> dict[str, str]:
    return {"schema": SCHEMA, "do": do, "code_sha256": code_hash()}


def _write(folder: Path, done: Done, do: Do) -> None:
    """Write the files of a record, and before the first ones the manifest."""
    if done.files and not (folder / MANIFEST).exists():
        write_text(folder / MANIFEST, json_text(_manifest(do)))
    for name, content in done.files.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path.parent}: cannot be written ({reason(error)})") from error
        with whole_file(path) as temporary:
            temporary.write_bytes(content)


def _warnings(rows: Mapping[str, Member]) -> list[str]:
    """Return the sentence on records without a date, which have no place in an instrument's folder."""
    without = sum(member.date is None and member.failed is None for member in rows.values())
    if without:
        return [f"{without} records have no date, so no entry in an instrument's folder; add the column date"]
    return []


def _write_lot(folder: Path, lot: Lot) -> None:
    """Write the table, the lot and the page."""
    stream = BytesIO()
    lot.to_polars().write_parquet(stream, compression="zstd", compression_level=3)
    with whole_file(folder / TABLE) as temporary:
        temporary.write_bytes(stream.getvalue())
    write_text(folder / LOT, lot.json_text())
    reports.write_report(folder / PAGE, lot)
