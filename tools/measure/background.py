"""The diagnosis of what is measured so far, in a process of its own: `trihedron diagnose` on the positions' file."""

import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from pydantic import ValidationError

from ..calibration.model import PRESETS
from ..diagnosis import Diagnosis
from ..rounding import exactly
from .session import Session


class Diagnosing:
    """At most one diagnosis at a time; the last that ended, and of how many positions it is.

    Attributes
    ----------
    found : Diagnosis or None
    of : int
        positions that it is of
    trouble : str
        why the last one could not be made
    """

    def __init__(self) -> None:
        self.found: Diagnosis | None = None
        self.of, self.trouble = 0, ""
        self._process: subprocess.Popen[bytes] | None = None
        self._asked: frozenset[int] = frozenset()
        self._scratch = tempfile.TemporaryDirectory(prefix="trihedron-measure-", ignore_cleanup_errors=True)

    @property
    def running(self) -> bool:
        """Whether one is being made."""
        return self._process is not None

    def wants(self, session: Session) -> bool:
        """Whether the good visits are others than those of the last diagnosis, and it has ended."""
        return not self.running and bool(session.good) and self._visits(session) != self._asked

    def start(self, session: Session, positions: Path, files: list[str]) -> None:
        """Begin one of the positions' file; `files` are options for what it is to write besides."""
        asked, programme = session.asked, session.programme
        (name, matrix), *_ = programme.mounting.items()
        mounting = name
        if name not in PRESETS or PRESETS[name].tolist() != matrix:
            path = Path(self._scratch.name) / "mounting.toml"
            path.write_text(f"[mounting]\nmatrix = {matrix!r}\n", encoding="utf-8")
            mounting = str(path)
        command = [sys.executable, "-P", "-m", "trihedron.tools.cli", "diagnose", str(positions.absolute())]
        command += ["--noise-bound", exactly(asked.noise_bound), "--gravity", exactly(asked.gravity), "--quiet"]
        command += ["--baseline", programme.baseline, "--bounds", *map(exactly, programme.bounds)]
        command += ["--mounting", mounting, "--json", str(self._file), *files]
        command += [f"--channels={said}" for said in asked.channels]
        self._asked, self._going = self._visits(session), len(session.good)
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )

    def ended(self, seconds: float = 0.0) -> bool:
        """Whether one has ended since it was asked last; waits for it so long [s]."""
        if self._process is None:
            return False
        try:
            _, said = self._process.communicate(timeout=max(seconds, 1e-3))
        except subprocess.TimeoutExpired:
            return False
        status, self._process = self._process.returncode, None
        self.trouble = ""
        try:
            if status:
                raise ValueError
            self.found, self.of = Diagnosis.model_validate_json(self._file.read_bytes()), self._going
        except (OSError, ValueError, ValidationError):
            lines = said.decode("utf-8", "replace").splitlines() or [f"it ended with status {status}"]
            self.trouble = lines[-1].removeprefix("trihedron: ")
        return True

    def close(self) -> None:
        """End the one that is being made."""
        if self._process is not None:
            self._process.kill()
            with suppress(OSError, ValueError):
                self._process.communicate()
            self._process = None
        self._scratch.cleanup()

    @property
    def _file(self) -> Path:
        return Path(self._scratch.name) / "diagnosis.json"

    @staticmethod
    def _visits(session: Session) -> frozenset[int]:
        return frozenset(visit.number for visit in session.good)
