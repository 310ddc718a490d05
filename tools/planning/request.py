"""What a user asks of a common set of positions, checked."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..calibration.model import parametrise
from ..calibration.mountings import mountings_of
from ..calibration.targets import convention_targets
from ..errors import InputError
from ..progress import shown_status
from .forms import DEFAULT_BOUNDS
from .optimum import UndeterminedError
from .places import Places, Task, free_arcs, task_of

MOST_STARTS, MOST_CUTS, MOST_EXTRA = 100_000, 100_000, 1000
"""More searches, cuts or positions would not end within days."""


@dataclass(frozen=True)
class Request:
    """What a user asks of a common plan; see `plan_positions`."""

    criterion: str = "worst"
    reserve_deg: float = 0.0
    resolution_deg: float | None = None
    keep_out: tuple[str, ...] = ()
    order: str = "tour"
    repeat: int = 0
    detect: tuple[str, ...] = ()
    extra: int = 6
    seed: int = 0
    starts: int = 30
    cuts: int = 40
    admissible: str = "paper"
    bounds: tuple[float, float] = DEFAULT_BOUNDS
    convention: str = "A1"
    baseline: str = "asymmetric"
    mountings: tuple[Mapping[str, ArrayLike] | str, ...] = ("identity",)


def requested_task(request: Request, *, progress: bool = False) -> Task:
    """Targets, admissible set and limits of a request, with the optimum of every target.

    Raises
    ------
    InputError
        for options that cannot be used
    """
    check_request(request)
    p = parametrise(_all_mountings(request.mountings), symmetric=request.baseline == "symmetric")
    targets = convention_targets(p, request.convention)
    keep_out: dict[int, list[tuple[float, float]]] = {0: [], 1: []}
    for text in request.keep_out:
        axis, low, high = parsed_keep_out(text)
        keep_out[axis].append((low, high))
    for axis, name in enumerate(("alpha", "beta")):
        if not free_arcs(keep_out[axis]):
            raise InputError(f"--keep-out: nothing of {name} is left; leave some of its angles free")
    options: dict[str, Any] = {"bounds": request.bounds, "rule": request.admissible, "keep_out": keep_out}
    try:
        with shown_status("optima of the targets", show=progress):
            task = task_of(p, targets, **options)
            reserve = np.radians(request.reserve_deg)
            reserved = task_of(p, targets, **options, best=task.best, reserve=reserve)
            return replace(reserved, support=task.support)
    except UndeterminedError:
        raise InputError("the admissible positions cannot determine every target; give smaller --bounds") from None


def check_request(request: Request) -> None:
    """Refuse options that no plan can fulfil.

    Raises
    ------
    InputError
        one line that names the option
    """
    for name, value, known in (
        ("criterion", request.criterion, ("worst", "mean")),
        ("order", request.order, ("tour", "random")),
        ("convention", request.convention, ("A1", "A2")),
        ("baseline", request.baseline, ("asymmetric", "symmetric")),
    ):
        if value not in known:
            raise InputError(f"--{name} {value}: must be one of {', '.join(known)}")
    if not 0.0 <= request.reserve_deg <= 10.0:
        raise InputError(f"--reserve {request.reserve_deg:g}: must be between 0 and 10 degrees")
    if request.resolution_deg is not None and not 1e-6 <= request.resolution_deg <= 30.0:
        raise InputError(f"--resolution {request.resolution_deg:g}: must be between 1e-6 and 30 degrees")
    for name, number, least, most in (
        ("starts", request.starts, 1, MOST_STARTS),
        ("cuts", request.cuts, 0, MOST_CUTS),
        ("extra", request.extra, 0, MOST_EXTRA),
        ("seed", request.seed, 0, 2**31 - 1),
    ):
        if not least <= number <= most:
            raise InputError(f"--{name} {number}: must be from {least} to {most}")
    for text in request.keep_out:
        parsed_keep_out(text)


def parsed_keep_out(text: str) -> tuple[int, float, float]:
    """Axis, low and high [rad] of a keep-out as a person writes it: "alpha:100:150".

    Raises
    ------
    InputError
        for what is not an axis and two angles, the second above the first, less than a turn apart
    """
    where, parts = f"--keep-out {text!r}", text.split(":")
    if len(parts) != 3 or parts[0] not in ("alpha", "beta"):
        raise InputError(f"{where}: write alpha:LOW:HIGH or beta:LOW:HIGH, in degrees")
    try:
        low, high = float(parts[1]), float(parts[2])
    except ValueError:
        raise InputError(f"{where}: LOW and HIGH must be numbers of degrees") from None
    if not (np.isfinite([low, high]).all() and 0.0 < high - low < 360.0):
        raise InputError(f"{where}: HIGH must be above LOW by less than 360")
    return ("alpha", "beta").index(parts[0]), float(np.radians(low)), float(np.radians(high))


def stored_positions(count: int) -> Places | None:
    """The plan of so many positions that the package holds: mounting `identity`, the tables' admissible set."""
    angle = [(float(r["alpha_deg"]), float(r["beta_deg"])) for r in _stored_rows() if int(r["positions"]) == count]
    return Places(np.radians(angle), np.zeros(count, dtype=int)) if angle else None


def stored_counts() -> list[int]:
    """For how many positions the package holds a plan."""
    return sorted({int(row["positions"]) for row in _stored_rows()})


def _stored_rows() -> Iterator[dict[str, str]]:
    text = resources.files("trihedron.tools.planning").joinpath("common_positions.csv").read_text(encoding="utf-8")
    return csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))


def _all_mountings(given: Sequence[Mapping[str, ArrayLike] | str]) -> dict[str, NDArray]:
    found: dict[str, NDArray] = {}
    for one in given:
        for name, matrix in mountings_of(one).items():
            if name in found:
                raise InputError(f"--mountings: {name} is given twice")
            if not name.replace("-", "").replace("_", "").isalnum():
                raise InputError(f"--mountings: '{name}' cannot name files; use letters, digits, - and _")
            found[name] = matrix
    return found
