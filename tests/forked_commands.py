"""Commands in copies of one process with everything imported: each is watched, and may be struck.

As a program (python forked_commands.py) it is that process. It reads a line of JSON for each command on its standard
input, and writes a line for the result on its standard output.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, TextIO


@dataclass(frozen=True)
class Strike:
    """A blow at the n-th call, of Python's functions and of C's, within one of some functions.

    With `stored`, the blow comes some seconds after the first file of that name appears.

    Attributes
    ----------
    within : str
        name of a function of the product, "" for calls in none of `among`
    among : tuple of str
        the distinguished functions; the innermost counts
    number : int
        from 1; 0: no blow, calls are counted
    blow : str
        a name of `BLOWS`
    stored : str
        pattern of a file's name below the command's folder, as "out/runs/part-*"
    delay : float
        delay after the file appears [s]
    """

    within: str
    among: tuple[str, ...]
    number: int = 0
    blow: str = "kill"
    stored: str = ""
    delay: float = 0.0


@dataclass(frozen=True)
class Done:
    """Result of a command: exit status (below 0: the signal that ended it), output, time and memory.

    `seconds` are wall-clock time, `cpu_seconds` processor time.
    """

    status: int
    out: str
    err: str
    seconds: float
    cpu_seconds: float
    peak_bytes: int
    struck: bool = False
    calls: dict[str, int] = field(default_factory=dict)


class ForkedCommands:
    """A process that runs commands, one at a time; use it in a `with`."""

    def __init__(self, environment: Mapping[str, str], scratch: Path) -> None:
        self._environment, self._scratch = dict(environment), scratch

    def __enter__(self) -> "ForkedCommands":
        self._process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=self._environment
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def run(
        self,
        arguments: Sequence[str],
        folder: Path,
        *,
        strike: Strike | None = None,
        seconds: float = 300.0,
        cpu_seconds: int = 0,
        most_bytes: int = 0,
    ) -> Done:
        """Run a command in a folder; it gets no file larger than `most_bytes`.

        It is ended after these seconds of wall-clock or processor time; 0 means no limit.
        """
        output = {
            "arguments": list(arguments),
            "folder": str(folder),
            "scratch": str(self._scratch),
            "strike": None if strike is None else asdict(strike),
            "seconds": seconds,
            "cpu_seconds": cpu_seconds,
            "most_bytes": most_bytes,
        }
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(output) + "\n")
        self._process.stdin.flush()
        came: dict[str, Any] = json.loads(self._process.stdout.readline())
        came |= {name: (self._scratch / name).read_text(encoding="utf-8", errors="replace") for name in ("out", "err")}
        calls = self._scratch / "calls"
        content = json.loads(calls.read_text(encoding="utf-8")) if calls.exists() else {}
        return Done(**came, struck=bool(content.get("struck")), calls=content.get("calls", {}))


def with_temporary_folder(folder: Path) -> ForkedCommands:
    """Return commands whose temporary folder is `temporary` in an existing folder, so that a test sees their
    leftovers."""
    (folder / "temporary").mkdir()
    environment = {**os.environ, "TMPDIR": str(folder / "temporary"), "PYTHONWARNINGS": "ignore"}
    return ForkedCommands(environment, folder / "said")


def serve() -> None:
    """Run commands until the standard input ends."""
    from warm_commands import import_all

    import_all()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    for line in sys.stdin:
        output = json.loads(line)
        scratch = Path(output["scratch"])
        scratch.mkdir(exist_ok=True)
        (scratch / "calls").unlink(missing_ok=True)
        began = time.perf_counter()
        child = os.fork()
        if child == 0:
            answers.close()
            _be_the_command(output, scratch)
        status, usage = _waited_for(child, began + output["seconds"])
        came = {
            "status": status,
            "seconds": time.perf_counter() - began,
            "cpu_seconds": usage.ru_utime + usage.ru_stime,
            "peak_bytes": usage.ru_maxrss * 1024,
        }
        answers.write(json.dumps(came) + "\n")
        answers.flush()


def _waited_for(child: int, until: float) -> tuple[int, resource.struct_rusage]:
    while True:
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status), usage
        if time.perf_counter() > until:
            os.kill(child, signal.SIGKILL)
            _, status, usage = os.wait4(child, 0)
            return os.waitstatus_to_exitcode(status), usage
        time.sleep(0.002)


def _be_the_command(request: dict[str, Any], scratch: Path) -> None:
    from trihedron.tools.cli import main

    status = 70
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for number, name, mode in ((0, os.devnull, os.O_RDONLY), (1, "out", os.O_RDWR), (2, "err", os.O_RDWR)):
            stream = os.open(scratch / name, mode | (0 if mode == os.O_RDONLY else os.O_CREAT | os.O_TRUNC), 0o600)
            os.dup2(stream, number)
            os.close(stream)
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
        sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False, buffering=1)
        os.chdir(request["folder"])
        if request["cpu_seconds"]:
            resource.setrlimit(resource.RLIMIT_CPU, (request["cpu_seconds"], request["cpu_seconds"]))
        if request["most_bytes"]:
            # Python ignores the signal and gets an error when it writes.
            resource.setrlimit(resource.RLIMIT_FSIZE, (request["most_bytes"], request["most_bytes"]))
        struck = None if request["strike"] is None else _Struck(Strike(**request["strike"]), scratch / "calls")
        sys.argv = ["trihedron", *request["arguments"]]
        sys.setprofile(struck)
        try:
            status = main() or 0
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
        finally:
            sys.setprofile(None)
        if struck is not None:
            struck.tell()
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            _flushed(stream)
        # Objects that wait for the end of a process, such as folders, have been waited for.
        import atexit

        atexit._run_exitfuncs()
        os._exit(status)


def _flushed(stream: TextIO) -> None:
    with suppress(OSError):
        stream.flush()


class _Struck:
    """Count calls by the function in which they are made, and strike once."""

    def __init__(self, strike: Strike, report: Path) -> None:
        self._strike, self._told = strike, report
        self._among = {*strike.among}
        self._calls: Counter[str] = Counter()
        self._struck = False
        self._inside = [""]
        if strike.stored:
            threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        """Wait for the first file, then for the delay, and strike."""
        while not any(Path().glob(self._strike.stored)):
            time.sleep(0.002)
        time.sleep(self._strike.delay)
        self._strike_now()

    def _strike_now(self) -> None:
        self._struck = True
        self.tell()
        BLOWS[self._strike.blow](self._strike)

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        # A generator is called at each continuation, and returns at each yield.
        if event in ("call", "return") and frame.f_code.co_name in self._among:
            if event == "call":
                self._inside.append(frame.f_code.co_name)
            elif len(self._inside) > 1:
                self._inside.pop()
        if event not in ("call", "c_call"):
            return
        where = self._inside[-1]
        self._calls[where] += 1
        if where == self._strike.within and self._calls[where] == self._strike.number and not self._struck:
            self._strike_now()

    def tell(self) -> None:
        self._told.write_text(json.dumps({"struck": self._struck, "calls": self._calls}), encoding="utf-8")


def _kill_all(_: Strike) -> None:
    from campaign_runs import workers_of

    for pid in (*workers_of(os.getpid()), os.getpid()):
        os.kill(pid, signal.SIGKILL)


BLOWS: dict[str, Callable[[Strike], None]] = {
    "kill": lambda _: os.kill(os.getpid(), signal.SIGKILL),
    "kill all": _kill_all,
    "ctrl-c": lambda _: os.kill(os.getpid(), signal.SIGINT),
}
"""SIGKILL of the process, of it and all its workers; Ctrl-C."""

if __name__ == "__main__":
    serve()
