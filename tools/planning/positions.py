"""What is asked of a common set of positions, the readings that such a set gives, and what they cost.

One set serves all targets and all accelerometers at once: a reading counts where the sign of its input is certain by
the admissible set, at every angle that an error of setting may lead to. The cost of a target is the least guaranteed
error with the readings that count.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..calibration.model import Parametrisation, mountings_of, parametrise
from ..calibration.targets import Target, asked_targets, convention_targets
from ..errors import InputError
from ..progress import shown_status
from .certificate import Columns, UndeterminedError, scaled_optimum
from .continuum import Continuum
from .forms import DEFAULT_BOUNDS, basis, padded_terms, sheets

CORNERS = ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0))
TURN = 2.0 * np.pi
MOST_STARTS, MOST_CUTS, MOST_EXTRA = 100_000, 100_000, 1000
"""More searches, cuts or positions would not end within days."""
SAMPLES = 40
"""Positions, drawn at random, at which a symmetry is checked: forms of nine terms are the same if they agree there."""
EQUAL = 1e-11
OFFSETS_DEG = (0.0, 1.4, 2.5, 5.0, 10.0, 20.0, 30.0, 45.0)
"""Distances of the pool's lines from the multiples of 90° of both axes."""
NOT_DETERMINED = 1e3
"""A ratio above this says that the positions do not determine the target."""


@dataclass(frozen=True)
class Request:
    """What a user asks of a common set of positions, angles in degrees: the options of `library.plan_positions`."""

    criterion: str = "worst"
    reserve_deg: float = 0.0
    resolution_deg: float | None = None
    keep_out: tuple[str, ...] = ()
    order: str = "tour"
    repeat: int = 0
    detect: tuple[str, ...] = ()
    extra: int = 6
    against_unlisted: bool = False
    seed: int = 0
    starts: int = 30
    cuts: int = 40
    admissible: str = "paper"
    bounds: tuple[float, float] = DEFAULT_BOUNDS
    convention: str = "A1"
    baseline: str = "asymmetric"
    mountings: tuple[Mapping[str, ArrayLike] | str, ...] = ("identity",)
    targets: tuple[str, ...] = ()

    def check(self) -> None:
        """Refuse options that no plan can fulfil: an InputError of one line that names the option."""
        for name, value, known in (
            ("criterion", self.criterion, ("worst", "mean")),
            ("order", self.order, ("tour", "random")),
            ("convention", self.convention, ("A1", "A2")),
            ("baseline", self.baseline, ("asymmetric", "symmetric")),
        ):
            if value not in known:
                raise InputError(f"--{name} {value}: must be one of {', '.join(known)}")
        if not 0.0 <= self.reserve_deg <= 10.0:
            raise InputError(f"--reserve {self.reserve_deg:g}: must be between 0 and 10 degrees")
        if self.resolution_deg is not None and not 1e-6 <= self.resolution_deg <= 30.0:
            raise InputError(f"--resolution {self.resolution_deg:g}: must be between 1e-6 and 30 degrees")
        for name, number, least, most in (
            ("starts", self.starts, 1, MOST_STARTS),
            ("cuts", self.cuts, 0, MOST_CUTS),
            ("extra", self.extra, 0, MOST_EXTRA),
            ("seed", self.seed, 0, 2**31 - 1),
        ):
            if not least <= number <= most:
                raise InputError(f"--{name} {number}: must be from {least} to {most}")
        for text in self.keep_out:
            parsed_keep_out(text)

    def parametrisation(self) -> Parametrisation:
        """The parameters with all mountings; an InputError for one that is unusable, comes twice or names no file."""
        found: dict[str, NDArray] = {}
        for given in self.mountings:
            for name, matrix in mountings_of(given).items():
                if name in found:
                    raise InputError(f"--mountings: {name} is given twice")
                if not name.replace("-", "").replace("_", "").isalnum():
                    raise InputError(f"--mountings: '{name}' cannot name files; use letters, digits, - and _")
                found[name] = matrix
        return parametrise(found, symmetric=self.baseline == "symmetric")


def parsed_keep_out(text: str) -> tuple[int, float, float]:
    """Axis, low and high [rad] of a keep-out as a person writes it: "alpha:100:150".

    An InputError for what is not an axis and two angles, the second above the first, less than a turn apart.
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


@dataclass(frozen=True)
class Places:
    """Table positions: angles α and β (N, 2) [rad], and indices into the mountings (N,)."""

    angle: NDArray
    mounting: NDArray

    def __len__(self) -> int:
        return len(self.angle)

    def at(self, angle: NDArray) -> "Places":
        """The same mountings at other angles (N, 2)."""
        return Places(angle, self.mounting)

    def chosen(self, rows: Sequence[int] | NDArray) -> "Places":
        """Some of them."""
        return Places(self.angle[rows], self.mounting[rows])

    def joined(self, other: "Places") -> "Places":
        """These and others after them."""
        return Places(np.concatenate([self.angle, other.angle]), np.concatenate([self.mounting, other.mounting]))


def on_all_mountings(angle: NDArray, mountings: int) -> Places:
    """The same angles (N, 2) [rad] with every mounting, one mounting after the other."""
    return Places(np.concatenate([angle] * mountings), np.repeat(np.arange(mountings), len(angle)))


@dataclass(frozen=True)
class Task:
    """What is asked: targets, admissible set, where the table may stand.

    Attributes
    ----------
    request : Request
    parametrisation : Parametrisation
    targets : tuple of Target
        K of them
    best : (K,) array
        cost of each target's own optimal plan over all angles [σ]
    support : (n, 2) array
        positions of those plans [rad]; none where the costs were given
    keep_out : tuple
        of each axis, intervals [rad] (low, high), low < high, of encoder readings that are not used
    regressor, base, terms : (S, P, 3, 3), (S, 3, 3), (S, T, 3, 3) array
        the sheets, stacked
    accelerometer, mounting : (S,) array of int
        of each sheet
    """

    request: Request
    parametrisation: Parametrisation
    targets: tuple[Target, ...]
    best: NDArray
    support: NDArray
    keep_out: tuple[tuple[tuple[float, float], ...], ...]
    regressor: NDArray
    base: NDArray
    terms: NDArray
    accelerometer: NDArray
    mounting: NDArray

    @cached_property
    def weights(self) -> NDArray:
        """a of every target (K, P)."""
        return np.array([target.weights for target in self.targets])

    @cached_property
    def shifts(self) -> NDArray:
        """Corners (C, 2) of the box of setting errors [rad]."""
        reserve = np.radians(self.request.reserve_deg)
        return reserve * np.array(CORNERS) if reserve > 0.0 else np.zeros((1, 2))

    @cached_property
    def room(self) -> NDArray:
        """How far the clearance (S,) inside that box may lie below that of its corners."""
        forms = np.concatenate([self.base[:, None], self.terms], axis=1)
        bent = np.linalg.norm(forms[..., :2, :], 2, axis=(-2, -1)) + np.linalg.norm(forms[..., :, :2], 2, axis=(-2, -1))
        # A form with second derivatives below M is within M r²/2, for each axis, of the interpolation of the corners.
        return 0.5 * np.radians(self.request.reserve_deg) ** 2 * np.sqrt(2.0) * bent.sum(axis=1)


def task_of(request: Request, *, best: NDArray | None = None, progress: bool = False) -> Task:
    """What is asked, checked, with the optimum of every target over all angles (setting errors not allowed for).

    `best` (K,) are the optima where they are known already. An InputError for options that cannot be used, also when
    no positions can determine a target.
    """
    request.check()
    p = request.parametrisation()
    targets = wanted(p, request.convention, request.targets)
    parsed = [parsed_keep_out(text) for text in request.keep_out]
    keep_out = tuple(tuple((low, high) for at, low, high in parsed if at == axis) for axis in (0, 1))
    for name, intervals in zip(("alpha", "beta"), keep_out, strict=True):
        if not free_arcs(intervals):
            raise InputError(f"--keep-out: nothing of {name} is left; leave some of its angles free")
    found = sheets(p, bounds=request.bounds, rule=request.admissible)
    support = np.zeros((0, 2))
    if best is None:
        with shown_status("optima of the targets", show=progress):
            matrices = tuple((name, matrix.tobytes()) for name, matrix in zip(p.mountings, p.matrices, strict=True))
            asked = tuple(map(float, request.bounds)), request.admissible, request.convention
            best, support = _optima(matrices, p.symmetric, *asked, request.targets)
    return Task(
        request,
        p,
        tuple(targets),
        best,
        support,
        keep_out,
        regressor=np.array([sheet.regressor for sheet in found]),
        base=np.array([sheet.base for sheet in found]),
        terms=padded_terms(found),
        accelerometer=np.array([sheet.accelerometer for sheet in found]),
        mounting=np.array([sheet.mounting for sheet in found]),
    )


def wanted(p: Parametrisation, convention: str, expressions: tuple[str, ...]) -> list[Target]:
    """The targets that are asked for; all of the convention where none are. An InputError for what is no target."""
    return asked_targets(expressions, p) if expressions else convention_targets(p, convention)


@lru_cache(maxsize=64)
def _optima(
    mountings: tuple[tuple[str, bytes], ...],
    symmetric: bool,
    bounds: tuple[float, float],
    admissible: str,
    convention: str,
    expressions: tuple[str, ...],
) -> tuple[NDArray, NDArray]:
    """The cost (K,) of each target's own optimal plan over all angles [σ], and the positions (n, 2) of them all [rad].

    They take seconds and depend on nothing else: the next request has them. Nobody writes into them.
    """
    matrices = {name: np.frombuffer(matrix).reshape(3, 3) for name, matrix in mountings}
    p = parametrise(matrices, symmetric=symmetric)
    everywhere = Continuum(sheets(p, bounds=bounds, rule=admissible))
    try:
        optima = [scaled_optimum(everywhere.optimum, target.weights) for target in wanted(p, convention, expressions)]
    except UndeterminedError:
        raise InputError("the admissible positions cannot determine every target; give smaller --bounds") from None
    best = np.array([optimum.cost for optimum in optima])
    support = np.concatenate([np.column_stack([optimum.alpha, optimum.beta]) for optimum in optima])
    for values in (best, support):
        values.setflags(write=False)
    return best, support


def clearances(task: Task, places: Places) -> NDArray:
    """Clearance (N, S) [g] of each sheet at each position, setting errors allowed for; a reading counts above 0."""
    lowest = np.full((len(places), len(task.base)), np.inf)
    for shift in task.shifts:
        a, b = basis(places.angle[:, 0] + shift[0]), basis(places.angle[:, 1] + shift[1])
        clear = np.einsum("sij,ni,nj->ns", task.base, a, b, optimize=True)
        clear -= np.abs(np.einsum("stij,ni,nj->nst", task.terms, a, b, optimize=True)).sum(axis=2)
        lowest = np.minimum(lowest, clear)
    lowest -= task.room
    lowest[places.mounting[:, None] != task.mounting] = -np.inf
    return lowest


@dataclass(frozen=True)
class Readings:
    """The readings that count: positions and sheets (M,), regressors F (M, P), clearances (M,) [g]."""

    position: NDArray
    sheet: NDArray
    regressor: NDArray
    clearance: NDArray


def readings(task: Task, places: Places) -> Readings:
    """The readings of a set of positions whose inputs are certain."""
    clear = clearances(task, places)
    position, sheet = np.nonzero(clear > 0.0)
    a, b = basis(places.angle[position, 0]), basis(places.angle[position, 1])
    f = np.einsum("mpij,mi,mj->mp", task.regressor[sheet], a, b, optimize=True)
    return Readings(position, sheet, f, clear[position, sheet])


@dataclass(frozen=True)
class Costs:
    """The cost of every target on a set of positions.

    Attributes
    ----------
    places : Places
    readings : Readings
    weights : (K, M) array
        Φ of each target's estimator
    duals : (K, P) array
        y: |F'y| ≤ 1 on the readings, a'y the cost
    ratio : (K,) array
        cost over the target's optimum over all angles
    """

    places: Places
    readings: Readings
    weights: NDArray
    duals: NDArray
    ratio: NDArray

    @property
    def worst(self) -> float:
        """The largest ratio."""
        return float(self.ratio.max())

    @property
    def mean(self) -> float:
        """The mean ratio."""
        return float(self.ratio.mean())

    @property
    def determined(self) -> NDArray:
        """Which targets (K,) the positions determine."""
        return self.ratio < NOT_DETERMINED


def costs(task: Task, places: Places) -> Costs:
    """Solve the linear programme of every target on the readings of these positions."""
    given = readings(task, places)
    weights = np.zeros((len(task.targets), len(given.position)))
    duals, value = np.zeros_like(task.weights), np.zeros(len(task.targets))
    programme = Columns(task.weights.shape[1])
    if len(given.position):
        programme.add(given.regressor)
    for k, target in enumerate(task.weights):
        programme.aim(target)
        weights[k], duals[k], possible = programme.solve()
        value[k] = duals[k] @ target
        if possible:
            used = np.flatnonzero(weights[k])
            columns = given.regressor[used].T
            # The solver's tolerance, taken out.
            weights[k, used] += np.linalg.lstsq(columns, target - columns @ weights[k, used], rcond=1e-12)[0]
    return Costs(places, given, weights, duals, value / task.best)


def allowed(task: Task, angle: NDArray) -> NDArray:
    """Which positions (N, 2) [rad] lie in no keep-out, ends included."""
    free = np.ones(len(angle), dtype=bool)
    for axis, intervals in enumerate(task.keep_out):
        for low, high in intervals:
            inside = np.mod(angle[:, axis] - low, TURN)
            free &= ~((inside > 1e-12) & (inside < high - low - 1e-12))
    return free


def free_arcs(intervals: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """What an axis' keep-outs leave of a turn: arcs [rad] (low, high), low < high; none where they leave nothing."""
    if not intervals:
        return [(0.0, TURN)]
    ends = np.unique(np.mod(np.ravel(intervals), TURN))
    return [
        (float(a), float(b))
        for a, b in pairwise([*ends, ends[0] + TURN])
        if b - a > 1e-9 and not any((0.5 * (a + b) - low) % TURN < high - low for low, high in intervals)
    ]


def freedom(task: Task, angle: NDArray, radius: float) -> tuple[NDArray, NDArray]:
    """How far (N, 2) each angle may go down and up [rad], at most `radius`, without entering a keep-out."""
    down, up = np.full(angle.shape, radius), np.full(angle.shape, radius)
    for axis, intervals in enumerate(task.keep_out):
        for low, high in intervals:
            up[:, axis] = np.minimum(up[:, axis], np.mod(low - angle[:, axis] + 1e-12, TURN))
            down[:, axis] = np.minimum(down[:, axis], np.mod(angle[:, axis] - high + 1e-12, TURN))
    return np.maximum(down - 1e-12, 0.0), np.maximum(up - 1e-12, 0.0)


@dataclass(frozen=True)
class Symmetry:
    """θ → sense θ + shift, for both angles: senses (2,) ±1 and shifts (2,) 0 or π [rad]."""

    sense: NDArray
    shift: NDArray

    def of(self, angle: NDArray) -> NDArray:
        """Images (N, 2) of positions (N, 2) [rad]."""
        return np.mod(self.sense * angle + self.shift, TURN)


def symmetries(task: Task) -> list[Symmetry]:
    """Of the sixteen candidates, those that map readings to readings and targets to targets, up to signs.

    The cost of every target on a set of positions and on its image under one of these is then that of a target with
    the same optimum: what is proven of a set holds for its images. Keep-outs are not looked at.
    """
    angle = np.random.default_rng(1).uniform(0.0, TURN, (SAMPLES, 2))
    here, clear = _regressors_and_clearances(task, angle)
    found = []
    for senses in product((1.0, -1.0), repeat=2):
        for shifts in product((0.0, np.pi), repeat=2):
            symmetry = Symmetry(np.array(senses), np.array(shifts))
            there, moved = _regressors_and_clearances(task, symmetry.of(angle))
            if np.abs(clear - moved).max() <= EQUAL and _holds(task, here, there):
                found.append(symmetry)
    return found


def _regressors_and_clearances(task: Task, angle: NDArray) -> tuple[NDArray, NDArray]:
    """F (N, 3, P) of the sheets with the larger clearance, and that clearance (N, 3), with every mounting."""
    places = on_all_mountings(angle, len(task.parametrisation.mountings))
    clear = clearances(task, places)
    a, b = basis(places.angle[:, 0]), basis(places.angle[:, 1])
    f = np.einsum("spij,ni,nj->nsp", task.regressor, a, b, optimize=True)
    clear = np.stack([np.where(task.accelerometer == p, clear, -np.inf) for p in range(3)], axis=1)
    best = clear.argmax(axis=2)[..., None]
    return np.take_along_axis(f, best, axis=1), np.take_along_axis(clear, best, axis=2)[..., 0]


def _holds(task: Task, here: NDArray, there: NDArray) -> bool:
    """Whether F at the images, times a sign for each accelerometer, is F with its parameters in another order."""
    for signs in product((1.0, -1.0), repeat=2):
        turned = there * np.array([1.0, *signs])[None, :, None]
        mixed = _permutation(here.reshape(-1, here.shape[2]), turned.reshape(-1, here.shape[2]))
        if mixed is not None:
            moved = (task.weights @ mixed)[:, None]
            near = np.minimum(np.abs(task.weights - moved).max(axis=2), np.abs(task.weights + moved).max(axis=2))
            if near.min(axis=1).max() <= EQUAL:
                return True
    return False


def _permutation(here: NDArray, there: NDArray) -> NDArray | None:
    """D (P, P), a permutation with signs, with there = here D; None where there is none."""
    size = here.shape[1]
    mixed = np.zeros((size, size))
    for column in range(size):
        for sign in (1.0, -1.0):
            same = np.abs(here - sign * there[:, column : column + 1]).max(axis=0) < EQUAL
            if same.sum() == 1:
                mixed[int(same.argmax()), column] = sign
    return mixed if (np.abs(mixed).sum(axis=0) == 1).all() and (np.abs(mixed).sum(axis=1) == 1).all() else None


@dataclass(frozen=True)
class Pool:
    """Positions on which bounds are proven, the group (n,) that each forms with its images, and all their readings."""

    places: Places
    orbit: NDArray
    readings: Readings

    def heights(self, dual: NDArray) -> NDArray:
        """The greatest |F'y| (n,) over the readings of each position."""
        first = np.searchsorted(self.readings.position, np.arange(len(self.places)))
        return np.maximum.reduceat(np.abs(self.readings.regressor @ dual[:, None])[:, 0], first)


def pool_of(task: Task, extra: Places | None = None) -> Pool:
    """Crossings of lines at fixed distances from the multiples of 90°, optimal plans, other positions; all images too.

    Positions in a keep-out, and those where no reading counts, are left out.
    """
    offsets = np.array(sorted({sign * offset for offset in OFFSETS_DEG for sign in (1.0, -1.0)}))
    lines = np.unique(np.mod((90.0 * np.arange(4)[:, None] + offsets).ravel(), 360.0))
    grid = np.radians(np.stack(np.meshgrid(lines, lines, indexing="ij"), axis=-1).reshape(-1, 2))
    given = on_all_mountings(np.concatenate([grid, task.support]), len(task.parametrisation.mountings))
    if extra is not None:
        given = given.joined(extra)
    group = symmetries(task)
    images = np.stack([np.round(np.mod(np.degrees(s.of(given.angle)), 360.0), 9) % 360.0 for s in group], axis=1)
    mounting = np.broadcast_to(given.mounting[:, None, None], (*images.shape[:2], 1))
    keys = np.concatenate([mounting, images], axis=2)
    least = np.array([min(map(tuple, of_one)) for of_one in keys])
    _, orbit = np.unique(least, axis=0, return_inverse=True)
    every, first = np.unique(keys.reshape(-1, 3), axis=0, return_index=True)
    places = Places(np.radians(every[:, 1:]), every[:, 0].astype(int))
    orbit = np.repeat(orbit.ravel(), len(group))[first]
    read = np.unique(readings(task, places).position)
    read = read[allowed(task, places.angle[read])]
    _, orbit = np.unique(orbit[read], return_inverse=True)
    places = places.chosen(read)
    return Pool(places, orbit.ravel(), readings(task, places))
