"""Where a command may write: not over its input, not over its other results, not in the place of a device."""

import os
from pathlib import Path

from trihedron.errors import InputError


def ordinary_file(_: object, path: Path | None) -> None:
    """Refuse the name of a device or a pipe: a file that appears whole takes the place of what stands there."""
    if path is not None and path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: is not a regular file; give the name of a file")


def distinct_files(files: dict[str, Path | None]) -> None:
    """Refuse a result that would be written over the record or over another result."""
    given = [(name, path) for name, path in files.items() if path is not None]
    for k, (name, path) in enumerate(given):
        for other, before in given[:k]:
            if os.path.realpath(path) == os.path.realpath(before):
                raise InputError(f"{name} {path}: is {other} too; give another name")
