"""All sequences of calls on a native FMU; as a program (python native_checks.py SUBJECT.json) for memory checkers."""

import json
import sys
from pathlib import Path

import native_arguments
import native_sequences
from native_driver import Library
from native_sequences import Entry, Subject

CHECKS = {
    name: check
    for module in (native_sequences, native_arguments)
    for name, check in vars(module).items()
    if name.startswith("check_")
}


def main(path: Path) -> int:
    """Do all checks on the library of a description; print what fails."""
    said = json.loads(path.read_text())
    table = [Entry(**row) for row in said["table"]]
    failures = 0
    for name, check in CHECKS.items():
        try:
            check(Subject(Library(Path(said["binary"]), said["fmi"], said["token"]), table))
        except AssertionError as error:
            failures += 1
            print(f"{name}: {error}")
    print(f"{len(CHECKS)} checks, {failures} failures")
    return min(failures, 1)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
