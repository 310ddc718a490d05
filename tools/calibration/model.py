"""The bench's exact model: its mountings, its parameters, its linearisation at a point, its fit to a record.

With several mountings the mounting error is another one for each and everything else is common; the symmetric baseline
has one scale factor for each accelerometer. The parameters are the targets of case (A1) themselves, so that a target's
weights are unit vectors and any other linear combination is a short sum.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import atan, cos, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.bench import (
    SYMMETRIC_PAIRS,
    TARGETS,
    admissible,
    checked_rotation,
    input_direction,
    input_jacobian,
    nominal_input,
    sign_margin,
    target_jacobian,
    target_reading,
)
from ..errors import InputError, nearest
from ..records import PositionRecord

MOUNTING_TARGETS = ("X8", "-X12", "X13")
"""Targets that differ by mounting."""
NOT_OUTSIDE = 1e-4
"""Component of a unit vector outside the span that is put down to encoder errors."""
ITERATIONS_BEFORE_SIGNS_REST = 8
"""From then on the signs of the inputs are kept, so that one at zero cannot keep the fit from converging."""
MAX_ITERATIONS = 60
COARSE = 1e-2
"""Singular values below this fraction of the largest are left out of the first, coarse estimate."""
MAX_ROUNDS = 30
ENOUGH = 6000
"""So many measurements, spread over the record, are weighed: more would tell little more and take long."""


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
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(
            f"--mounting {path}: neither a file nor a preset ({nearest(str(path), tuple(PRESETS))})"
        ) from error
    except OSError as error:
        raise InputError(f"--mounting {path}: cannot be read ({error.strerror})") from error
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
        unknown = [key for key in table if key != "matrix"]
        if unknown or "matrix" not in table:
            wrong = f"has the unknown key '{unknown[0]}'" if unknown else "has no matrix"
            raise InputError(f"{where} {wrong}; write matrix = [[...], [...], [...]]")
        mountings[name] = checked_mounting(table["matrix"], where)
    return mountings


def mountings_of(given: Mapping[str, ArrayLike] | str) -> dict[str, NDArray]:
    """The matrices (3, 3) of mountings by name, of a preset, or of a TOML file; an InputError for any other."""
    if not isinstance(given, str):
        return {name: checked_mounting(q, f"mounting '{name}'") for name, q in given.items()}
    return {given: PRESETS[given]} if given in PRESETS else read_mounting_file(Path(given))


def mountings_for(record: PositionRecord, given: Mapping[str, ArrayLike] | str) -> dict[str, NDArray]:
    """The matrix of every mounting of a record, in the order in which they first appear.

    Parameters
    ----------
    record : PositionRecord
        its `mounting` column, where it has one, names the mountings
    given : mapping or str
        matrices by name, a preset's name, or the path of a TOML file

    Returns
    -------
    dict of str to (3, 3) array
        one entry when the record has no `mounting` column

    Raises
    ------
    InputError
        for an unreadable file, a matrix that is no rotation, a mounting of the record without a matrix
    """
    option = given if isinstance(given, str) else ""
    preset, source = option in PRESETS, f"--mounting {option}" if option else "mounting"
    known = given if not isinstance(given, str) else PRESETS if preset else read_mounting_file(Path(given))
    if record.mounting is None:
        if preset:
            return {option: PRESETS[option]}
        if option and len(known) > 1:
            raise InputError(
                f"{record.path}: has no column mounting, and --mounting {option} holds {len(known)} mountings "
                f"({', '.join(known)}); give a file with one, or the column"
            )
        if len(known) != 1:
            raise InputError(f"{record.path}: has no column mounting, so exactly one mounting must be given")
        return mountings_of(known)
    names = tuple(dict.fromkeys(record.mounting))
    if preset and len(names) == 1 and names[0] not in PRESETS:
        return {names[0]: PRESETS[option]}
    if preset and option != "identity" and names != (option,):
        raise InputError(
            f"{record.path}: its column mounting names {', '.join(names)}, which --mounting {option} does not give; "
            "give a TOML file with a matrix for each name"
        )
    for name in names:
        if name not in known:
            row = int(record.row[record.mounting.index(name)])
            raise InputError(
                f"{record.path}: row {row}, column mounting: {source} has no mounting '{name}' "
                f"({nearest(name, tuple(known))}); give a TOML file with [{name}] matrix = [[...], [...], [...]]"
            )
    return mountings_of({name: known[name] for name in names})


@dataclass(frozen=True)
class Parametrisation:
    """Parameters of the fit.

    Attributes
    ----------
    symbols : tuple of str
        one for each of the P parameters, `X8@name` where there are several mountings
    mountings : tuple of str
        names of the K mountings
    matrices : (K, 3, 3) array
        Q of each
    selection : (K, 18, P) array
        the 18 targets of each mounting are `selection[k] @ parameters`
    symmetric : bool
        one scale factor for each accelerometer
    """

    symbols: tuple[str, ...]
    mountings: tuple[str, ...]
    matrices: NDArray
    selection: NDArray
    symmetric: bool


@dataclass(frozen=True)
class Positions:
    """Table positions at which the block was, or might be, read.

    Attributes
    ----------
    alpha, beta : (N,) array
        encoder readings [rad]
    mounting : (N,) array of int
        index into the mountings of the parametrisation
    tilts : (N, 2) array or None
        small turns [rad] by which κ and ε differ from the parameters' at each position; none by default
    """

    alpha: NDArray
    beta: NDArray
    mounting: NDArray
    tilts: NDArray | None = None


def parametrise(mountings: Mapping[str, ArrayLike], *, symmetric: bool = False) -> Parametrisation:
    """The parameters for these mountings (name -> Q) and this baseline."""
    names = tuple(mountings)
    own_minus = {minus: plus for plus, minus in SYMMETRIC_PAIRS} if symmetric else {}

    def place(target: str, name: str) -> str:
        if target in MOUNTING_TARGETS:
            return f"{target}@{name}" if len(names) > 1 else target
        return own_minus.get(target, target)

    symbols = [target for target in TARGETS if target not in (*MOUNTING_TARGETS, *own_minus)]
    symbols[-3:-3] = [place(target, name) for name in names for target in MOUNTING_TARGETS]
    selection = np.zeros((len(names), len(TARGETS), len(symbols)))
    for k, name in enumerate(names):
        for row, target in enumerate(TARGETS):
            selection[k, row, symbols.index(place(target, name))] = 1.0
    matrices = np.array([np.asarray(q, dtype=float) for q in mountings.values()])
    return Parametrisation(tuple(symbols), names, matrices, selection, symmetric)


def _arguments(p: Parametrisation, point: NDArray, at: Positions) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    if len(p.mountings) == 1 and at.tilts is None:
        # one turn for all positions, not one for each
        return p.selection[0] @ point, at.alpha, at.beta, p.matrices[0]
    targets = (p.selection @ point)[at.mounting]
    if at.tilts is not None:
        targets[:, [TARGETS.index("X1"), TARGETS.index("X3")]] += at.tilts
    return targets, at.alpha, at.beta, p.matrices[at.mounting]


def _selection(p: Parametrisation, at: Positions) -> NDArray:
    return p.selection[0] if len(p.mountings) == 1 else p.selection[at.mounting]


def predicted_reading(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
    """The exact reading over g (N, 3) at a point (P,) of the parameters; `sign` as in `models.bench.target_reading`."""
    return target_reading(*_arguments(p, point, at), sign)


def predicted_input(p: Parametrisation, point: NDArray, at: Positions) -> NDArray:
    """The inputs of the accelerometers (N, 3) [g], up to the factor (1 − Δg/g) that readings cannot tell."""
    return input_direction(*_arguments(p, point, at))


def reading_jacobian(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
    """Derivatives (N, 3, P) of `predicted_reading`."""
    return target_jacobian(*_arguments(p, point, at), sign) @ _selection(p, at)


def direction_jacobian(p: Parametrisation, point: NDArray, at: Positions) -> NDArray:
    """Derivatives (N, 3, P) of `predicted_input`."""
    return input_jacobian(*_arguments(p, point, at)) @ _selection(p, at)


@dataclass(frozen=True)
class Linearisation:
    """The measurements near one point of the parameters: z ≈ f(point) + J (X − point).

    Measurements are ordered position by position, accelerometers 1, 2, 3 within each: M = 3 N.

    Attributes
    ----------
    parametrisation : Parametrisation
        the parameters and the mountings
    positions : Positions
        angles [rad] and mountings of the N positions
    reading : (N, 3) array
        readings over g
    point : (P,) array
        X̂, in the order of `parametrisation.symbols`
    prediction : (N, 3) array
        exact readings over g at the point
    residual : (M,) array
        reading less prediction
    jacobian : (M, P) array
        exact derivatives of the prediction
    bound : (M,) array
        σ, or more where the sign of the input is open, as fractions of g
    position, accelerometer : (M,) arrays of int
        index of the row in the record from 0, and accelerometer from 1
    input, sign : (N, 3) array
        inputs of the accelerometers [g] at the point, and the sign (+1, -1) that chose each scale factor
    span : (P, rank) array
        orthonormal basis of what the measurements determine, for an aligned bench or, when that is everything, at
        the point; the identity when they determine everything
    """

    parametrisation: Parametrisation
    positions: Positions
    reading: NDArray
    point: NDArray
    prediction: NDArray
    residual: NDArray
    jacobian: NDArray
    bound: NDArray
    position: NDArray
    accelerometer: NDArray
    input: NDArray
    sign: NDArray
    span: NDArray

    @property
    def deficient(self) -> bool:
        """Whether the measurements leave a parameter open."""
        return self.span.shape[1] < len(self.point)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.parametrisation.symbols

    def residual_at(self, point: NDArray) -> NDArray:
        """Exact residuals (M,) at another point, with the signs of this one."""
        return (self.reading - predicted_reading(self.parametrisation, point, self.positions, self.sign)).ravel()


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
    n = predicted_input(parametrisation, point, positions)
    sign = np.where(n >= 0.0, 1, -1) if sign is None else sign
    prediction = predicted_reading(parametrisation, point, positions, sign)
    jacobian = reading_jacobian(parametrisation, point, positions, sign).reshape(-1, len(point))
    span = determined(nominal_jacobian(parametrisation, positions), float(bound.min()))
    if span.shape[1] == len(point):
        span = determined(jacobian, float(bound.min()))
    count = len(reading)
    return Linearisation(
        parametrisation,
        positions,
        reading,
        point,
        prediction,
        (reading - prediction).ravel(),
        jacobian,
        bound,
        np.repeat(np.arange(count), 3),
        np.tile([1, 2, 3], count),
        n,
        sign,
        span,
    )


def nominal_jacobian(parametrisation: Parametrisation, positions: Positions) -> NDArray:
    """Derivatives (M, P) of the readings for a bench and a block without errors."""
    count = len(parametrisation.symbols)
    return reading_jacobian(parametrisation, np.zeros(count), positions).reshape(-1, count)


def determined(jacobian: NDArray, noise_bound: float) -> NDArray:
    """Orthonormal basis (P, rank) of the directions that measurements determine; the identity when they are all.

    A direction counts when its singular value in the jacobian (M, P) exceeds √σ [g]: then noise moves the estimate
    along it by so little that the second-order remainder of the move stays below the noise. Less than 1e-4 is what
    encoder errors alone give.
    """
    missing = max(0, jacobian.shape[1] - len(jacobian))
    _, values, directions = np.linalg.svd(np.pad(jacobian, ((0, missing), (0, 0))), full_matrices=False)
    kept = values > max(1e-4, noise_bound**0.5)
    return np.eye(len(directions)) if kept.all() else directions[kept].T


def fit(
    parametrisation: Parametrisation,
    positions: Positions,
    reading: NDArray,
    noise_bound: float,
    bounds: tuple[float, float],
    extent: NDArray,
) -> Linearisation:
    """Fit the exact model by least squares, relinearising to convergence, and linearise at the fit.

    The first estimate is from measurements whose sign is certain by (1.7); then all are used, with the signs of the
    inputs from the estimate. Where the estimate leaves a sign open the bound is widened by |Γ⁺ − Γ⁻| |n|. Directions
    of the parameters that the measurements leave open stay at zero, and the bounds are widened by what they may do.

    Parameters
    ----------
    parametrisation, positions
    reading : (N, 3) array
        readings over g
    noise_bound : float
        σ, as a fraction of g
    bounds : (float, float)
        u^max and v^0max of (1.7)
    extent : (P,) array
        how large each parameter may be where the measurements leave it open

    Raises
    ------
    InputError
        when the fit does not converge
    """
    bound = np.full(reading.size, noise_bound)
    matrices = parametrisation.matrices[positions.mounting]
    certain = admissible(positions.alpha, positions.beta, matrices, bounds=bounds)
    nominal_sign = np.where(nominal_input(positions.alpha, positions.beta, matrices) >= 0.0, 1, -1)
    span = determined(nominal_jacobian(parametrisation, positions), noise_bound)
    problem = _Problem(parametrisation, positions, reading, span)
    point = np.zeros(len(parametrisation.symbols))
    point = point + problem.step(point, certain.ravel().astype(float), nominal_sign, COARSE)
    for _ in range(5):
        weight = noise_bound / bound
        point, sign, settled = problem.minimise(point, weight)
        here = linearise(parametrisation, positions, reading, point, bound, sign)
        if here.span.shape[1] < problem.span.shape[1]:
            problem = replace(problem, span=here.span)
            point, sign, settled = problem.minimise(np.zeros(len(point)), weight)
            here = linearise(parametrisation, positions, reading, point, bound, sign)
        if not settled:
            raise InputError(
                "the fit of the bench model does not converge: are the angles in degrees and the mounting right?"
            )
        if parametrisation.symmetric:
            break
        widened = noise_bound + widening(here, certain & (sign == nominal_sign), noise_bound, bounds)
        if np.allclose(widened, bound, rtol=1e-6, atol=0.0):
            break
        bound = widened
    if here.deficient:
        here = replace(here, bound=here.bound + _open_remainder(here, extent))
    return here


@dataclass(frozen=True)
class _Problem:
    """Weighted least squares of the exact model within the span of what measurements determine."""

    parametrisation: Parametrisation
    positions: Positions
    reading: NDArray
    span: NDArray

    def residual(self, point: NDArray, sign: NDArray | None = None) -> NDArray:
        """Readings less those predicted at a point (3 N,), fractions of g."""
        return (self.reading - predicted_reading(self.parametrisation, point, self.positions, sign)).ravel()

    def step(self, point: NDArray, weight: NDArray, sign: NDArray, cut: float | None = None) -> NDArray:
        """One linear step; directions with singular values below `cut` of the largest are left alone."""
        jacobian = reading_jacobian(self.parametrisation, point, self.positions, sign).reshape(-1, len(point))
        rows = (jacobian @ self.span) * weight[:, None]
        return self.span @ np.linalg.lstsq(rows, self.residual(point, sign) * weight, rcond=cut)[0]

    def misfit(self, point: NDArray, weight: NDArray, sign: NDArray | None) -> float:
        """Norm of the weighted residual at a point."""
        return float(np.linalg.norm(self.residual(point, sign) * weight))

    def minimise(self, point: NDArray, weight: NDArray) -> tuple[NDArray, NDArray, bool]:
        """Gauss-Newton from a point; the minimum, the signs of the inputs there, and whether it settled."""
        sign, last = np.zeros(self.reading.shape), np.inf
        for iteration in range(MAX_ITERATIONS):
            resting = iteration > ITERATIONS_BEFORE_SIGNS_REST
            if not resting:
                sign = np.where(predicted_input(self.parametrisation, point, self.positions) >= 0.0, 1, -1)
            step = self.step(point, weight, sign)
            size = float(np.abs(step).max())
            if size > 1e-6:
                signs = sign if resting else None
                now = self.misfit(point, weight, signs) * (1 + 1e-9)
                while self.misfit(point + step, weight, signs) > now and np.abs(step).max() > 1e-3 * size:
                    step = step / 2
            point = point + step
            still = size < 1e-11 and size >= 0.5 * last and resting
            if size < 1e-15 or still:
                return point, sign, True
            last = size
        return point, sign, last < 1e-8


def widening(here: Linearisation, certain: NDArray, noise_bound: float, bounds: tuple[float, float]) -> NDArray:
    """|Γ⁺ − Γ⁻| |n|, as large as the data allow, where the sign of an input is open; 0 elsewhere.

    At first (1.7) says how far an input may be from its estimate. With the bounds that follow, all measurements
    together say it better, by any weights that are unbiased (those of least squares are at hand), and so on until
    nothing is gained: truth is within the bounds of the readings at every step, the fit within its residuals.

    Parameters
    ----------
    here : Linearisation
        at the fit
    certain : (N, 3) array of bool
        where the sign was certain before anything was known
    noise_bound, bounds
        σ, as a fraction of g; u^max and v^0max of (1.7)

    Returns
    -------
    (3 N,) array
        what to add to the bound of each measurement, as a fraction of g
    """
    extra = np.zeros(here.input.shape)
    if certain.all():
        return extra.ravel()
    p = here.parametrisation
    matrices = p.matrices[here.positions.mounting]
    margin = sign_margin(here.positions.alpha, here.positions.beta, matrices, bounds=bounds)
    gradient = direction_jacobian(p, here.point, here.positions)
    size = np.abs(here.input)
    uncertainty = np.where(certain, 0.0, np.maximum(margin, size))
    difference = p.selection[0, 3:9:2] - p.selection[0, 4:9:2]
    estimate = np.abs(difference @ here.point)
    asymmetry = np.maximum(estimate, 2.0 * bounds[1])
    for _ in range(MAX_ROUNDS):
        still_open = ~certain & (size <= uncertainty)
        last, extra = extra, np.where(still_open, asymmetry * (size + uncertainty), 0.0)
        if np.abs(extra - last).max() <= 1e-3 * noise_bound:
            break
        spread = _spread(here, noise_bound + extra.ravel())
        for i, k in zip(*np.nonzero(still_open), strict=True):
            uncertainty[i, k] = min(uncertainty[i, k], spread(gradient[i, k]))
        asymmetry = np.minimum(asymmetry, estimate + [spread(row) for row in difference])
    return extra.ravel()


def _spread(here: Linearisation, bound: NDArray) -> Callable[[NDArray], float]:
    """How far a linear function of the parameters may be from its estimate when readings are within `bound`."""
    every = len(bound) // ENOUGH + 1
    # three readings for each position: a stride of a multiple of three would leave accelerometers out
    every += every % 3 == 0
    jacobian = here.jacobian[::every] / bound[::every, None]
    span = determined(jacobian * bound.min(), float(bound.min()))
    if every > 1 and span.shape[1] < here.span.shape[1]:
        jacobian = here.jacobian / bound[:, None]
        span = determined(jacobian * bound.min(), float(bound.min()))
    weights = span @ np.linalg.pinv(jacobian @ span)
    excess = 1.0 + min(3.0, float(np.abs(here.residual / bound).max()))

    def spread(direction: NDArray) -> float:
        if np.linalg.norm(direction - span @ (span.T @ direction)) > NOT_OUTSIDE:
            return np.inf
        return excess * float(np.abs(direction @ weights).sum())

    return spread


def _open_remainder(here: Linearisation, extent: NDArray) -> NDArray:
    """How far the parameters that the measurements leave open may move readings (M,), as a fraction of g.

    Truth is within `extent` (P,): the bounds of (1.7), the biases like v, or priors. To first order that moves readings
    hardly at all; to second order what is left open turns into errors of everything else. The second differences along
    all pairs of moves are summed in absolute value.
    """
    directions = np.linalg.svd(here.span, full_matrices=True)[0][:, here.span.shape[1] :].T
    # as far as truth may be from the fit, which is where it is
    moves = directions * (np.abs(directions) @ extent + np.abs(directions @ here.point))[:, None]

    def shift(move: NDArray) -> NDArray:
        return here.residual_at(here.point + move) - here.residual

    moved = np.zeros(len(here.bound))
    single = [shift(move) for move in moves]
    for j, move in enumerate(moves):
        moved += np.maximum(np.abs(single[j]), np.abs(shift(-move)))
        for k in range(j):
            moved += np.abs(shift(move + moves[k]) - single[j] - single[k])
    return moved
