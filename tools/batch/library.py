"""Carry out a batch: work on each record, its folder, and the lot of its instruments."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

from .. import reports
from ..campaign.store import code_hash
from ..errors import InputError, reason
from ..files import bytes_of, json_text, made_folder, said_writable, whole_file, write_text
from ..locks import Taken, locked
from ..lot import Lot, Member, lot_of, read_tolerance
from ..options import Channels, NoiseBound, NoiseSd, Progress, Stamps, Trust
from ..progress import progress_bar
from ..workers import made
from .jobs import Do, Job, jobs_of
from .work import Done, worked

SCHEMA = "trihedron.batch/1"
MANIFEST, LOCK, TABLE, LOT, PAGE = "batch.json", "batch.lock", "records.parquet", "lot.json", "index.html"


def batch(
    *files: str | Path,
    do: Do,
    out: str | Path,
    noise_bound: NoiseBound = None,
    noise_sd: NoiseSd = None,
    gravity: float | None = None,
    mounting: str | None = None,
    baseline: Literal["asymmetric", "symmetric"] | None = None,
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
    calibration: str | Path | None = None,
    tolerance: str | Path | None = None,
    jobs: int | None = None,
    engine: Literal["local", "dask"] = "local",
    scheduler: str | None = None,
    resume: bool = False,
    progress: Progress = False,
) -> Lot:
    """Calibrate, diagnose or correct many records, and judge their instruments as a lot.

    A record that cannot be used is a row with its reason. The folder has a result for each record, a folder for each
    instrument, a table and a page.

    Parameters
    ----------
    files : path
        Records; or one table (CSV) with the column file, and if known serial, date, temperature_degC and options, as
        noise_bound.
    do : str
        Work on each record: calibrate, diagnose, noise or apply.
    out : path
        Folder for the results.
    gravity : float, optional
        Model value of gravity [m/s²]. Default: that of the work.
    mounting : str, optional
        Mounting of the block: a preset, or a TOML file.
    baseline : str, optional
        Scale factors of each accelerometer: two (asymmetric) or one (symmetric).
    calibration : path, optional
        With apply: a calibration, or the folder of a batch that has one for each instrument.
    tolerance : path, optional
        Table of tolerances (TOML): each record passes or fails.
    jobs : int, optional
        Number of worker processes. Default: the number of cores.
    engine : str
        Where the work runs: on this machine, or on a Dask cluster (extra `cluster`).
    scheduler : str, optional
        Address of the scheduler of --engine dask. Its workers read the same paths. Default: a local cluster.
    resume : bool
        Keep the results that the folder holds; work on new, changed and failed records.

    Returns
    -------
    Lot
        A row for each record; distributions, odd instruments, shared causes, trends.

    Raises
    ------
    InputError
        for options that do not go together, or a folder that holds another batch; earlier results are kept
    KeyboardInterrupt
        Ctrl-C; the folder is whole, and `resume` goes on

    Examples
    --------
    >>> import trihedron as th
    >>> th.batch("monday.csv", "tuesday.csv", do="calibrate", out="week", noise_bound=1e-5)  # doctest: +SKIP
    """
    options: dict[str, Any] = {"noise_bound": noise_bound, "noise_sd": noise_sd, "gravity": gravity}
    options |= {"mounting": mounting, "baseline": baseline, "stamps": stamps}
    if calibration is not None:
        options["calibration"] = str(Path(calibration).absolute())
    options |= {"channels": tuple(channels) or None, "trust": trust or None}
    wanted = {name: value for name, value in options.items() if value is not None}
    folder = Path(out)
    work = jobs_of([Path(file) for file in files], do, wanted)
    table = None if tolerance is None else read_tolerance(Path(tolerance))
    rows = _members_of_folder(folder, work) if resume else {}
    missing = [job for job in work if job.record not in rows]
    # Refuse impossible options before anything is written.
    results = made(worked, missing, engine=engine, jobs=jobs, scheduler=scheduler)
    with ExitStack() as stack:
        stack.enter_context(closing(results))
        stack.enter_context(_alone(folder))
        _begin(folder, do, resume=resume)
        advance = stack.enter_context(progress_bar("records", len(work), show=progress))
        advance(len(rows))
        try:
            for done in results:
                _write(folder, done, do)
                rows[done.member.record] = done.member
                advance(1)
        except InputError as error:
            raise InputError(f"{error}; {_kept(rows, work, folder)}") from error
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted; {_kept(rows, work, folder)}") from None
        members = [rows[job.record] for job in work]
        if all(member.failed is not None for member in members):
            raise InputError(f"no record has a result; the first: {members[0].failed}")
        lot = lot_of(members, do, table, _warnings(rows)).model_copy(update={"folder": folder})
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
                raise InputError(f"--out {folder}: another process works there") from None
            yield
    finally:
        if [path.name for path in folder.iterdir()] == [LOCK]:
            (folder / LOCK).unlink()
            folder.rmdir()


def _kept(rows: Mapping[str, Member], work: Sequence[Job], folder: Path) -> str:
    return f"{len(rows)} of {len(work)} records are in {folder}; --resume goes on"


def _begin(folder: Path, do: Do, *, resume: bool) -> None:
    """Check the manifest of the folder, if it has one.

    Raises InputError for a folder with another batch, with this one while `resume` is false, or with other files.
    """
    path = folder / MANIFEST
    if not path.exists():
        others = sorted(one.name for one in folder.iterdir() if one.name != LOCK)
        if others:
            raise InputError(f"--out {folder}: holds {others[0]}, which is of no batch; give another folder")
        return
    if not resume:
        raise InputError(f"--out {folder}: holds a batch already; --resume goes on with it, or give another folder")
    try:
        before = json.loads(bytes_of(path))
    except ValueError as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    if before.get("do") != do:
        raise InputError(f"--resume: {folder} is a batch of {before.get('do')}, not of {do}; give another --out")
    if before != _manifest(do):
        raise InputError(
            f"--resume: {folder} was made by another version of Trihedron, or of what it uses; give another --out"
        )


def _members_of_folder(folder: Path, work: Sequence[Job]) -> dict[str, Member]:
    """Return the rows that the folder holds of unchanged records with unchanged options, by record."""
    rows = {}
    for job in work:
        try:
            key = job.key(Path(job.path).read_bytes())
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
    """Return what the reader of a lot must know: records without a date have no place in an instrument's folder."""
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
