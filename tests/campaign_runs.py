"""Campaigns for the tests: small files, an engine whose workers die when the test says so, folders as bytes."""

import random
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from trihedron.tools.campaign.engines import Killed

CALIBRATION = """
schema = "trihedron.campaign/1"
seed = 3
partition = 2
[calibration]
[sampling]
method = "latin-hypercube"
points = 7
[parameters]
kappa = { uniform = [-3e-3, 3e-3] }
noise_part = { values = [0.5, 1.0] }
[keep]
scalars = ["verdict", "radius", "misses", "X4_error", "X4_guaranteed"]
[[compute]]
quantiles = ["radius"]
[[compute]]
rate = "verdict"
is = ["falsified"]
"""
"""Fourteen calibrations in seven files."""


def written(folder: Path, text: str, name: str = "campaign.toml") -> Path:
    """A campaign file in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a campaign's folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


class ScriptedEngine:
    """Workers in this process; calls are made when their result is asked for, in random order.

    Parameters
    ----------
    size : int
        how many workers
    fate : callable
        (function's name, partitions or run) -> whether the worker dies of it
    seed : int
        of the order
    """

    def __init__(self, size: int = 3, fate: Callable[[str, Any], bool] = lambda *_: False, seed: int = 0) -> None:
        self.size, self.fate, self.calls = size, fate, []
        self._random = random.Random(seed)
        self._open: list[Future] = []
        self._what: dict[Future, tuple[Callable[..., Any], tuple[Any, ...]]] = {}

    def free(self, busy: int) -> int:
        return self.size - busy

    def workers(self) -> int:
        return self.size

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        future: Future = Future()
        self._what[future] = (function, arguments)
        self._open.append(future)
        if len(self._open) == self.size or self._random.random() < 0.3:
            self._open.pop(self._random.randrange(len(self._open))).set_result(None)
        return future

    def finish(self) -> None:
        """Nothing more comes in: let everything that is open be done."""
        while self._open:
            self._open.pop(self._random.randrange(len(self._open))).set_result(None)

    def result(self, future: Future) -> Any:
        function, arguments = self._what.pop(future)
        self.calls.append((function.__name__, arguments[1]))
        if self.fate(function.__name__, arguments[1]):
            raise Killed(working=True)
        return function(*arguments)
