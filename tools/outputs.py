"""Where a command may write: not over its input, not over its other results, not in the place of a device."""

import os
from pathlib import Path

from .errors import InputError


def ordinary_file(_: object, path: Path | None) -> None:
    """Refuse the name of a device or a pipe: a file that appears whole takes the place of what stands there."""
    if path is None:
        return
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: is not a regular file; give the name of a file")
    _in_a_folder(path)


def ordinary_folder(_: object, path: Path | None) -> None:
    """Refuse the name of a folder where a file stands, before anything is computed for it."""
    if path is None:
        return
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file; give the name of a folder")
    _in_a_folder(path)


def _in_a_folder(path: Path) -> None:
    for above in path.parents:
        if above.is_dir():
            return
        if above.exists():
            raise InputError(f"{path}: cannot be written ({above} is a file)")


def json_file(_: object, path: Path | None) -> None:
    """Refuse an option where the name of a file for JSON should stand; "-" is standard output."""
    if path is not None and str(path).startswith("-") and str(path) != "-":
        raise InputError(f"--json {path}: is an option; give the name of a file, or - for standard output")
    if str(path) != "-":
        ordinary_file(None, path)


def distinct_files(files: dict[str, Path | None]) -> None:
    """Refuse a result that would be written over the record or over another result."""
    given = [(name, path) for name, path in files.items() if path is not None]
    for k, (name, path) in enumerate(given):
        for other, before in given[:k]:
            if os.path.realpath(path) == os.path.realpath(before):
                raise InputError(f"{name} {path}: is {other} too; give another name")
