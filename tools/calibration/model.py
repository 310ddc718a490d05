"""The bench model of `models.bench` as a fit needs it: mountings, parameters, predicted readings, linearisation.

The formulas of the model live in `models.bench` alone. The parameters are the targets of case (A1) themselves, so that
the weights of a target are unit vectors and any other linear combination is a short sum. With several mountings each
has a mounting error of its own and everything else is common. The symmetric baseline has one scale factor for each
accelerometer.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from itertools import product
from math import atan, cos, radians, sin, sqrt
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.arrays import Ints
from ...models.bench import (
    SYMMETRIC_PAIRS,
    TARGETS,
    checked_rotation,
    input_direction,
    input_jacobian,
    reading_of_input,
    target_jacobian,
    target_reading,
)
from ..bounded.programmes import shortened
from ..errors import InputError, nearest
from ..files import LARGEST_TEXT, advice_on, bytes_of
from ..records import PositionRecord

MOUNTING_TARGETS = ("X8", "-X12", "X13")
"""Targets that differ by mounting."""
BLOCK = 4096
"""Positions that are evaluated at once: their intermediate arrays stay in the processor's cache."""


def frame_turn(axis: int, angle: float) -> NDArray:
    """Direction cosines (3, 3) of a frame turned by `angle` [rad] about its axis 1, 2 or 3."""
    i, j = {1: (1, 2), 2: (2, 0), 3: (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = cos(angle)
    matrix[i, j], matrix[j, i] = sin(angle), -sin(angle)
    return matrix


PRESETS: dict[str, NDArray] = {
    "identity": np.eye(3),
    "cyclic": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "rz45": frame_turn(3, radians(45)),
    "ry45": frame_turn(2, radians(45)),
    "tripod": frame_turn(2, atan(1 / sqrt(2))) @ frame_turn(1, radians(45)),
    "skew": frame_turn(3, radians(20)) @ frame_turn(2, radians(30)) @ frame_turn(1, radians(40)),
}
"""Q by name: components in the block's axes from those in the inner frame. `rz45` and `ry45` are turned by 45° about
axes 3 and 2; `tripod` has all three axes equally inclined; `skew` is turned by 20°, 30°, 40° about axes 3, 2, 1."""


def checked_mounting(matrix: Any, where: str) -> NDArray:
    """A proper rotation (3, 3) from nested lists, or an InputError that begins with `where`."""
    try:
        return checked_rotation(matrix)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def read_mounting_file(path: Path) -> dict[str, NDArray]:
    """The mountings of a TOML file, `[name] matrix = [[...], [...], [...]]` for each; an InputError for any other."""
    if not path.exists():
        raise InputError(f"--mounting {path}: neither a file nor a preset ({nearest(str(path), tuple(PRESETS))})")
    content_bytes = bytes_of(path, "a file of mountings is needed", label=f"--mounting {path}", most=LARGEST_TEXT)
    advice = advice_on(path, content_bytes)
    if advice:
        raise InputError(f"--mounting {path}: is not a file of mountings{advice}")
    try:
        content = tomllib.loads(content_bytes.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise InputError(f"--mounting {path}: not UTF-8 text") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"--mounting {path}: not TOML: {error}") from error
    if not content:
        raise InputError(f"--mounting {path}: holds no mounting; write [name] and matrix = [[...], [...], [...]]")
    mountings = {}
    for name, table in content.items():
        where = f"--mounting {path}: [{name}]"
        if not isinstance(table, dict):
            raise InputError(f"--mounting {path}: '{name}' stands outside a [name] table")
        for key in table:
            if key != "matrix":
                raise InputError(f"{where} has the unknown key '{key}'; write matrix = [[...], [...], [...]]")
        if "matrix" not in table:
            raise InputError(f"{where} has no matrix; write matrix = [[...], [...], [...]]")
        mountings[name] = checked_mounting(table["matrix"], where)
    return mountings


def mountings_of(mounting: Mapping[str, ArrayLike] | str) -> dict[str, NDArray]:
    """The matrices (3, 3) of mountings by name, of a preset, or of a TOML file; an InputError for any other."""
    if not isinstance(mounting, str):
        return {name: checked_mounting(q, f"mounting '{name}'") for name, q in mounting.items()}
    if mounting in PRESETS:
        return {mounting: PRESETS[mounting]}
    return read_mounting_file(Path(mounting))


def mountings_for(record: PositionRecord, choice: Mapping[str, ArrayLike] | str) -> dict[str, NDArray]:
    """Return the matrix (3, 3) of every mounting of a record, in the order in which they first appear.

    The record's `mounting` column names them, if it has one; else there is one entry. The mountings are matrices by
    name, a preset's name, or the path of a TOML file. Raises an InputError for an unreadable file, a matrix that is not
    a rotation, or a mounting of the record without a matrix.
    """
    option, source, available = "", "mounting", choice
    if isinstance(choice, str):
        option, source = choice, f"--mounting {choice}"
        available = PRESETS if choice in PRESETS else read_mounting_file(Path(choice))
    assert not isinstance(available, str)
    preset = option in PRESETS
    if record.mounting is None:
        if preset:
            return {option: PRESETS[option]}
        if option and len(available) > 1:
            raise InputError(
                f"{record.path}: has no column mounting, and --mounting {option} holds {len(available)} mountings "
                f"({', '.join(available)}); give a file with one, or the column"
            )
        if len(available) != 1:
            raise InputError(f"{record.path}: has no column mounting, so exactly one mounting must be given")
        return mountings_of(available)
    names = tuple(dict.fromkeys(record.mounting))
    if preset and len(names) == 1 and names[0] not in PRESETS:
        return {names[0]: PRESETS[option]}
    if preset and option != "identity" and names != (option,):
        raise InputError(
            f"{record.path}: its column mounting names {', '.join(names)}, which --mounting {option} does not give; "
            "give a TOML file with a matrix for each name"
        )
    for name in names:
        if name not in available:
            row = int(record.row[record.mounting.index(name)])
            raise InputError(
                f"{record.path}: row {row}, column mounting: {source} has no mounting '{name}' "
                f"({nearest(name, tuple(available))}); give a TOML file with [{name}] matrix = [[...], [...], [...]]"
            )
    return mountings_of({name: available[name] for name in names})


@dataclass(frozen=True)
class Parametrisation:
    """Parameters of the fit.

    `symbols` are the names of the P parameters, `X8@name` where there are several mountings; `matrices` (K, 3, 3) are
    the Q of the K mountings. The 18 targets of mounting k are `selection[k] @ parameters`, with `selection` (K, 18, P).
    The symmetric baseline has one scale factor for each accelerometer.
    """

    symbols: tuple[str, ...]
    mountings: tuple[str, ...]
    matrices: NDArray
    selection: NDArray
    symmetric: bool


@dataclass(frozen=True)
class Positions:
    """N table positions at which the block was, or might be, read.

    `alpha`, `beta` (N,) are encoder readings [rad]; `mounting` (N,) are indices into the mountings of the
    parametrisation. `tilts` (N, 2) are small turns [rad] by which κ and ε differ from the parameters' at each position.
    `slips` (N, 3) are rotation vectors [rad], in block axes, by which the block is turned on the table beside θ. By
    default there are no tilts and no slips.
    """

    alpha: NDArray
    beta: NDArray
    mounting: NDArray
    tilts: NDArray | None = None
    slips: NDArray | None = None

    def selected(self, rows: NDArray | slice) -> "Positions":
        """Return some of the positions."""
        return replace(self, **{name: column[rows] for name, column in vars(self).items() if column is not None})


def every_position(p: Parametrisation, angles: NDArray) -> Positions:
    """Every pair of angles [rad] with every mounting."""
    grids = np.meshgrid(angles, angles, range(len(p.mountings)), indexing="ij")
    alpha, beta, mounting = (grid.ravel() for grid in grids)
    return Positions(alpha, beta, mounting.astype(int))


def table_position(p: Parametrisation, at: Positions, row: int, digits: int = 12) -> dict[str, Any]:
    """One of the positions as results write it: angles of the table [deg], and the mounting where there are several."""
    alpha, beta = np.round(np.degrees([at.alpha[row], at.beta[row]]), digits).tolist()
    place: dict[str, Any] = {"alpha_deg": alpha, "beta_deg": beta}
    if len(p.mountings) > 1:
        place["mounting"] = p.mountings[int(at.mounting[row])]
    return place


def parametrise(mountings: Mapping[str, ArrayLike], *, symmetric: bool = False) -> Parametrisation:
    """The parameters for these mountings (name -> Q) and this baseline."""
    names = tuple(mountings)
    plus_of_minus: dict[str, str] = {}
    if symmetric:
        plus_of_minus = {minus: plus for plus, minus in SYMMETRIC_PAIRS}

    def place(target: str, name: str) -> str:
        if target in MOUNTING_TARGETS and len(names) > 1:
            return f"{target}@{name}"
        return plus_of_minus.get(target, target)

    symbols = [target for target in TARGETS if target not in MOUNTING_TARGETS and target not in plus_of_minus]
    symbols[-3:-3] = [place(target, name) for name, target in product(names, MOUNTING_TARGETS)]
    selection = np.zeros((len(names), len(TARGETS), len(symbols)))
    for k, name in enumerate(names):
        for row, target in enumerate(TARGETS):
            selection[k, row, symbols.index(place(target, name))] = 1.0
    matrices = np.array([np.asarray(q, dtype=float) for q in mountings.values()])
    return Parametrisation(tuple(symbols), names, matrices, selection, symmetric)


def _arguments(p: Parametrisation, point: NDArray, at: Positions) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    if len(p.mountings) == 1 and at.tilts is None:
        # one turn for all positions, not one for each
        targets = point @ p.selection[0].T
        if point.ndim > 1:
            targets = targets[:, None]
        return targets, at.alpha, at.beta, p.matrices[0]
    targets = np.stack([point @ selection.T for selection in p.selection], axis=-2)[..., at.mounting, :]
    if at.tilts is not None:
        targets[..., [TARGETS.index("X1"), TARGETS.index("X3")]] += at.tilts
    return targets, at.alpha, at.beta, p.matrices[at.mounting]


def _selection(p: Parametrisation, at: Positions) -> NDArray:
    if len(p.mountings) == 1:
        return p.selection[0]
    return p.selection[at.mounting]


def _in_blocks(evaluate: Callable[..., NDArray]) -> Callable[..., NDArray]:
    """Wrap a function that evaluates position by position, so that it handles many positions block by block."""

    @wraps(evaluate)
    def evaluated(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
        def of(rows: slice) -> NDArray:
            if sign is None:
                return evaluate(p, point, at.selected(rows))
            return evaluate(p, point, at.selected(rows), sign[rows])

        count, size = len(at.alpha), max(1, BLOCK * point.shape[-1] // point.size)
        if count <= size:
            return evaluate(p, point, at) if sign is None else evaluate(p, point, at, sign)
        parts = [of(slice(start, start + size)) for start in range(0, count, size)]
        return np.concatenate(parts, axis=point.ndim - 1)

    return evaluated


@_in_blocks
def predicted_reading(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
    """The exact reading over g (N, 3) at a point (P,) of the parameters, or (K, N, 3) at several (K, P).

    `sign` is as in `models.bench.target_reading`.
    """
    targets, alpha, beta, matrices = _arguments(p, point, at)
    return target_reading(targets, alpha, beta, matrices, sign, at.slips)


@_in_blocks
def predicted_input(p: Parametrisation, point: NDArray, at: Positions) -> NDArray:
    """Return the inputs of the accelerometers (N, 3) [g], up to the unobservable factor (1 − Δg/g)."""
    targets, alpha, beta, matrices = _arguments(p, point, at)
    return input_direction(targets, alpha, beta, matrices, at.slips)


@_in_blocks
def predicted_input_and_reading(p: Parametrisation, point: NDArray, at: Positions) -> NDArray:
    """Return `predicted_input` and `predicted_reading`, together (N, 3, 2)."""
    targets, alpha, beta, matrices = _arguments(p, point, at)
    inputs = input_direction(targets, alpha, beta, matrices, at.slips)
    return np.stack((inputs, reading_of_input(targets, inputs)), axis=-1)


@_in_blocks
def reading_jacobian(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
    """Derivatives (N, 3, P) of `predicted_reading`."""
    return target_jacobian(*_arguments(p, point, at), sign, at.slips) @ _selection(p, at)


@_in_blocks
def direction_jacobian(p: Parametrisation, point: NDArray, at: Positions) -> NDArray:
    """Derivatives (N, 3, P) of `predicted_input`."""
    return input_jacobian(*_arguments(p, point, at), at.slips) @ _selection(p, at)


def slip_jacobian(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
    """Derivatives (N, 3, 3) of `predicted_reading` by the slips, exact to rounding (complex step)."""
    slips, step = at.slips, 1e-30
    if slips is None:
        slips = np.zeros((len(at.alpha), 3))
    moved = [predicted_reading(p, point, replace(at, slips=slips + 1j * step * axis), sign) for axis in np.eye(3)]
    return np.imag(np.stack(moved, axis=-1)) / step


@dataclass(frozen=True)
class Linearisation:
    """The measurements near one point of the parameters: z ≈ f(point) + J (X − point).

    Measurements are ordered position by position, accelerometers 1, 2, 3 within each: M = 3 N.

    `reading` (N, 3) are the readings over g; `point` (P,) is X̂, in the order of `symbols`. `residual` (M,) is reading
    less prediction; `jacobian` (M, P) has the exact derivatives of the prediction. `bound` (M,) is σ, or more where the
    sign of the input is open, as fractions of g. `sign` (N, 3) of the inputs, +1 or -1, selects each scale factor.

    `span` (P, rank) is an orthonormal basis of the determined directions, for an aligned bench or, where that
    determines everything, at the point; the identity when the measurements determine everything.
    """

    parametrisation: Parametrisation
    positions: Positions
    reading: NDArray
    point: NDArray
    residual: NDArray
    jacobian: NDArray
    bound: NDArray
    sign: NDArray
    span: NDArray

    @cached_property
    def prediction(self) -> NDArray:
        """Exact readings over g (N, 3) at the point."""
        return predicted_reading(self.parametrisation, self.point, self.positions, self.sign)

    @cached_property
    def input(self) -> NDArray:
        """Inputs of the accelerometers (N, 3) [g] at the point."""
        return predicted_input(self.parametrisation, self.point, self.positions)

    @property
    def deficient(self) -> bool:
        """Return whether the measurements leave a parameter open."""
        return self.span.shape[1] < len(self.point)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.parametrisation.symbols

    def rows_of(self, positions: NDArray) -> Ints:
        """Return the rows of some positions (n,), and all rows after those of the readings."""
        count = self.reading.size
        of_readings = 3 * positions[3 * positions < count, None] + np.arange(3)
        return np.append(of_readings.ravel(), np.arange(count, len(self.bound)))

    def selected(self, rows: NDArray) -> Self:
        """Return the linearisation of some rows, as in `rows_of`."""
        at = rows[rows < self.reading.size][::3] // 3
        few = {name: getattr(self, name)[rows] for name in ("residual", "jacobian", "bound")}
        reading, sign = self.reading[at], self.sign[at]
        return replace(self, positions=self.positions.selected(at), reading=reading, sign=sign, **few)

    def residual_at(self, point: NDArray) -> NDArray:
        """Exact residuals (M,) at another point, with the signs of this one."""
        return self.residuals_at(point[None])[0]

    def residuals_at(self, points: NDArray) -> NDArray:
        """Exact residuals (K, M) at other points (K, P), with the signs of this one."""
        errors = self.reading - predicted_reading(self.parametrisation, points, self.positions, self.sign)
        return errors.reshape(len(points), -1)

    def jacobian_at(self, point: NDArray) -> NDArray:
        """Exact derivatives (M, P) of the prediction at another point, with the signs of this one."""
        return reading_jacobian(self.parametrisation, point, self.positions, self.sign).reshape(-1, len(point))


def linearise(
    parametrisation: Parametrisation,
    positions: Positions,
    reading: NDArray,
    point: NDArray,
    bound: NDArray,
    sign: NDArray | None = None,
) -> Linearisation:
    """Linearise the exact model at a point (P,): readings (N, 3) over g, their bounds (3 N,) as fractions of g.

    The signs (N, 3) of the inputs are by default those at the point.
    """
    if sign is None:
        sign = np.where(predicted_input(parametrisation, point, positions) >= 0.0, 1, -1)
    residual = (reading - predicted_reading(parametrisation, point, positions, sign)).ravel()
    jacobian = reading_jacobian(parametrisation, point, positions, sign).reshape(-1, len(point))
    span = determined(nominal_jacobian(parametrisation, positions), float(bound.min()))
    if span.shape[1] == len(point):
        span = determined(jacobian, float(bound.min()))
    return Linearisation(parametrisation, positions, reading, point, residual, jacobian, bound, sign, span)


def nominal_jacobian(parametrisation: Parametrisation, positions: Positions) -> NDArray:
    """Derivatives (M, P) of the readings for a bench and a block without errors."""
    count = len(parametrisation.symbols)
    return reading_jacobian(parametrisation, np.zeros(count), positions).reshape(-1, count)


def least_singular(noise_bound: float) -> float:
    """Directions with a smaller singular value [g] are not determined."""
    return max(1e-4, noise_bound**0.5)


def determined(jacobian: NDArray, noise_bound: float) -> NDArray:
    """Return an orthonormal basis (P, rank) of the determined directions; the identity when they are all.

    A direction counts when its singular value in the jacobian (M, P) exceeds √σ [g]. Noise then moves the estimate so
    little along it that the second-order remainder stays below the noise. Encoder errors alone give less than 1e-4.
    """
    rows, missing = shortened(jacobian), max(0, jacobian.shape[1] - len(jacobian))
    if missing:
        rows = np.pad(rows, ((0, missing), (0, 0)))
    _, values, directions = np.linalg.svd(rows, full_matrices=False)
    large = values > least_singular(noise_bound)
    if large.all():
        return np.eye(len(directions))
    return directions[large].T
