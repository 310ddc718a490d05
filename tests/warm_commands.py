"""`trihedron` for tests that run many commands: a copy of a process with everything imported runs each of them.

As a program (python warm_commands.py SOCKET) it is that process: it ends when its standard input does.
"""

import atexit
import importlib
import json
import os
import pkgutil
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

OTHERS = (
    *("fmpy", "highspy", "jinja2", "matplotlib.backends.backend_svg", "numba", "polars", "pythonfmu.builder"),
    *("rich.progress", "rich.table", "scipy.optimize", "scipy.signal", "scipy.spatial.transform", "scipy.special"),
)
"""Libraries that the product imports lazily."""
LONGEST = 1 << 20
SHIM = f"""#!{sys.executable} -IS
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as there:
    there.connect({{path!r}})
    said = json.dumps({{{{"argv": sys.argv[1:], "cwd": os.getcwd(), "environment": dict(os.environ)}}}})
    socket.send_fds(there, [said.encode()], [0, 1, 2])
    sys.exit(int(there.recv(16) or b"70"))
"""


@contextmanager
def warm_commands(folder: Path, environment: Mapping[str, str]) -> Iterator[Path]:
    """Return a folder for the path with a `trihedron` that runs in copies of one process.

    Parameters
    ----------
    folder : Path
        empty folder
    environment : mapping
        environment of that process; each command has its own

    Returns
    -------
    Path
        the folder
    """
    # A socket's name may have no more than about a hundred characters.
    with tempfile.TemporaryDirectory(prefix="warm-") as short:
        path = Path(short) / "socket"
        shim = folder / "trihedron"
        shim.write_text(SHIM.format(path=str(path)), encoding="utf-8")
        shim.chmod(0o755)
        with subprocess.Popen([sys.executable, __file__, str(path)], stdin=subprocess.PIPE, env=environment) as server:
            while not path.exists() and server.poll() is None:
                time.sleep(0.02)
            assert server.poll() is None, "the process that runs the commands has ended"
            yield folder


def import_all() -> None:
    """Import the product, and the modules that it imports lazily."""
    package = importlib.import_module("trihedron")
    product_modules = [result.name for result in pkgutil.walk_packages(package.__path__, "trihedron.")]
    product = ("trihedron.models", "trihedron.fmus", "trihedron.tools")
    for name in (*OTHERS, *(n for n in product_modules if n.startswith(product) and not n.endswith("__main__"))):
        importlib.import_module(name)


def serve(path: Path) -> None:
    """Run commands until the standard input ends."""
    import_all()
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(str(path.with_suffix(".new")))
        door.listen()
        path.with_suffix(".new").rename(path)
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)
        while sys.stdin not in select.select([door, sys.stdin], [], [])[0]:
            caller, _ = door.accept()
            with caller:
                output, streams, _, _ = socket.recv_fds(caller, LONGEST, 3)
                if os.fork() == 0:
                    door.close()
                    answer(caller, json.loads(output), streams)
                for stream in streams:
                    os.close(stream)


def answer(caller: socket.socket, request: dict, streams: list[int]) -> None:
    """Run the command in its folder, environment and streams; send its exit status and end."""
    from trihedron.tools.cli import main

    status = 70
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
            os.close(stream)
        sys.stdin = os.fdopen(0, encoding="utf-8", closefd=False)
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
        sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False, buffering=1)
        os.chdir(request["cwd"])
        os.environ.clear()
        os.environ.update(request["environment"])
        if request["environment"].get("PYTHONWARNINGS") == "error":
            warnings.simplefilter("error")
        sys.argv = ["trihedron", *request["argv"]]
        try:
            status = main() or 0
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        with suppress(OSError):
            caller.sendall(str(status).encode())
        atexit._run_exitfuncs()
        os._exit(status)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
