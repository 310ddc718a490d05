"""The diagnosis of what is measured so far, in a process of its own: `trihedron diagnose` on the positions' file."""

import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from time import monotonic

from pydantic import ValidationError

from ..calibration.model import PRESETS
from ..diagnosis import Diagnosis
from ..locks import own_folder
from ..rounding import exactly
from .session import Session

PATIENCE_S = 3.0
"""A diagnosis that is not wanted any more has so long to end itself."""
LONG_S = 40.0
"""A diagnosis of fewer positions that has taken so long gives way to one of more, which has less to tell apart."""


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
        self.of, self.trouble, self._began = 0, "", 0.0
        self._process: subprocess.Popen[bytes] | None = None
        self._asked: frozenset[int] = frozenset()
        self._held = ExitStack()
        self._folder = self._held.enter_context(own_folder())

    @property
    def running(self) -> bool:
        """Whether one is being made."""
        return self._process is not None

    def wants(self, session: Session) -> bool:
        """Whether the good visits are others than those of the last diagnosis, which has ended or is not worth more."""
        if not session.good or self._visits(session) == self._asked:
            return False
        return not self.running or not session.left or monotonic() - self._began > LONG_S

    def start(self, session: Session, positions: Path, page: Path) -> None:
        """Begin one of the positions' file, in place of one that is being made; it writes its page, too."""
        self._kill()
        asked, programme = session.asked, session.programme
        (name, matrix), *_ = programme.mounting.items()
        mounting = name
        if name not in PRESETS or PRESETS[name].tolist() != matrix:
            path = self._folder / "mounting.toml"
            path.write_text(f"[mounting]\nmatrix = {matrix!r}\n", encoding="utf-8")
            mounting = str(path)
        command = [sys.executable, "-P", "-m", "trihedron.tools.cli", "diagnose", str(positions.absolute())]
        command += ["--noise-bound", exactly(asked.noise_bound), "--gravity", exactly(asked.gravity), "--quiet"]
        command += ["--baseline", programme.baseline, "--bounds", *map(exactly, programme.bounds)]
        command += ["--mounting", mounting, "--json", str(self._file), "--report", str(page)]
        command += [f"--channels={said}" for said in asked.channels]
        self._asked, self._going, self._began = self._visits(session), len(session.good), monotonic()
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
        self._kill()
        self._held.close()

    def _kill(self) -> None:
        if self._process is None:
            return
        # as Ctrl-C, which leaves nothing half-written; where that is not heard, at once
        self._process.send_signal(signal.SIGTERM if sys.platform == "win32" else signal.SIGINT)
        try:
            self._process.communicate(timeout=PATIENCE_S)
        except (subprocess.TimeoutExpired, OSError, ValueError):
            self._process.kill()
            self._process.communicate()
        self._process = None

    @property
    def _file(self) -> Path:
        return self._folder / "diagnosis.json"

    @staticmethod
    def _visits(session: Session) -> frozenset[int]:
        return frozenset(visit.number for visit in session.good)
