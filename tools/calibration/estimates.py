"""The exact model fitted to readings, and the parameters that the readings leave possible.

Radius, values, guaranteed errors, exact intervals, pairs of targets.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.bench import (
    admissible,
    nominal_input,
    sign_margin,
)
from ..bounded.centre import Bounded, Central, Estimator, central
from ..bounded.factors import pivoted
from ..bounded.programmes import RELATIVE_TOLERANCE, Polytope, chebyshev_radius, shortened
from ..calibrated import Estimator as KindOfEstimate
from ..calibrated import Open, Parameter, ReadingError
from ..errors import InputError
from ..progress import tracked
from ..result import finite_or_none
from .model import (
    Linearisation,
    Parametrisation,
    Positions,
    determined,
    direction_jacobian,
    linearise,
    nominal_jacobian,
    predicted_input_and_reading,
    predicted_reading,
    reading_jacobian,
)
from .targets import Target, convention_targets, corners

NOT_OUTSIDE = 1e-4
"""Component of a unit vector outside the span that is put down to encoder errors."""
ITERATIONS_BEFORE_SIGNS_REST = 8
"""From then on the signs of the inputs are kept, so that one at zero cannot keep the fit from converging."""
MAX_ITERATIONS = 60
COARSE = 1e-2
"""Singular values below this fraction of the largest are left out of the first, coarse estimate."""
ROUNDING = 1e-12
"""Singular values below this fraction of the largest are rounding."""
NEAR = 1e-6
"""After a step of at most this size the derivatives change no more."""
MAX_ROUNDS = 30
ENOUGH = 6000
"""Measurements that are weighed, spread over the record: more would change little and take long."""
AT_ONCE = 64
MANY_MEASUREMENTS = 5000
"""From here on the programmes take seconds."""
GROUPS = (
    ("accelerometer 1", ("X4", "X5", "X16")),
    ("accelerometer 2", ("X9", "X10", "X6+X8", "X17")),
    ("accelerometer 3", ("X14", "X15", "X7+X12", "X11+X13", "X18")),
    ("table and mounting", ("X1", "X2", "X3", "X13", "-X12", "X8")),
)
"""Targets whose errors hang together: those of each accelerometer, those of the bench."""
MAX_CENTRED = 10
STILL = 1e-9
"""A step to the centre that moves no reading by more than this part of its bound is none."""
SMALLEST = 1e-18
"""Steps of parameters below it are none."""
SAME = 1e-6
"""A direction that gains no more than this part of the set's size gives no new vertex."""


GROSS = 0.2
"""No input of an aligned bench is read with an error of this size [g]."""
MOST_GROSS = 0.7
"""Where a larger part of the readings is so wrong, angles or the mounting are."""


def fit(
    parametrisation: Parametrisation,
    positions: Positions,
    reading: NDArray,
    noise_bound: NDArray,
    bounds: tuple[float, float],
    extent: NDArray,
) -> Linearisation:
    """Fit the exact model to readings (N, 3) over g by least squares, relinearising to convergence; linear at the fit.

    The first estimate uses measurements whose sign is certain by (1.7), with its `bounds` u^max and v^0max. The second
    uses all, with the signs of the inputs from the first. Where the estimate leaves a sign open the bound (3 N,), σ as
    a fraction of g, is widened by |Γ⁺ − Γ⁻| |n|. Undetermined directions of the parameters stay at zero, and the bounds
    are widened by their possible effect, each direction at most of its `extent` (P,).

    Where the fit to all readings does not settle, it leaves out those whose error exceeds any of an aligned bench
    (`GROSS`): channels may be exchanged. Raises an InputError if the fit does not converge.
    """
    bound = noise_bound
    matrices = parametrisation.matrices[positions.mounting]
    certain = admissible(positions.alpha, positions.beta, matrices, bounds=bounds)
    nominal_sign = np.where(nominal_input(positions.alpha, positions.beta, matrices) >= 0.0, 1, -1)
    span = determined(nominal_jacobian(parametrisation, positions), float(noise_bound.min()))
    problem = _Problem(parametrisation, positions, reading, span)
    point = np.zeros(len(parametrisation.symbols))
    weight = certain.ravel().astype(float)
    point = problem.slopes(point, weight, nominal_sign, COARSE).step(problem.residual(point, nominal_sign) * weight)
    gross = np.abs(reading - nominal_input(positions.alpha, positions.beta, matrices)).ravel() > GROSS
    trusted = np.ones(reading.size)
    for _ in range(5):
        weight = trusted * noise_bound.min() / bound
        point, sign, settled = problem.minimise(point, weight)
        if not settled and 0.0 < gross.mean() < MOST_GROSS:
            trusted = np.where(gross, 0.0, 1.0)
            weight = weight * trusted
            point, sign, settled = problem.minimise(np.zeros(len(point)), weight)
        linearised = linearise(parametrisation, positions, reading, point, bound, sign)
        if linearised.span.shape[1] < problem.span.shape[1]:
            problem = replace(problem, span=linearised.span)
            point, sign, settled = problem.minimise(np.zeros(len(point)), weight)
            linearised = linearise(parametrisation, positions, reading, point, bound, sign)
        if not settled:
            raise InputError(
                "the fit of the bench model does not converge: are the angles in degrees and the mounting right?"
            )
        if parametrisation.symmetric:
            break
        widened = noise_bound + widening(linearised, certain & (sign == nominal_sign), noise_bound, bounds)
        if np.allclose(widened, bound, rtol=1e-6, atol=0.0):
            break
        bound = widened
    if linearised.deficient:
        linearised = replace(linearised, bound=linearised.bound + _open_remainder(linearised, extent))
    return linearised


@dataclass(frozen=True)
class _Problem:
    """Weighted least squares of the exact model, within the span of the determined directions."""

    parametrisation: Parametrisation
    positions: Positions
    reading: NDArray
    span: NDArray

    def residual(self, point: NDArray, sign: NDArray | None = None) -> NDArray:
        """Readings less those predicted at a point (3 N,), fractions of g."""
        return (self.reading - predicted_reading(self.parametrisation, point, self.positions, sign)).ravel()

    def slopes(self, point: NDArray, weight: NDArray, sign: NDArray, cut: float = ROUNDING) -> "_Slopes":
        """Derivatives at a point; directions with singular values below `cut` of the largest are left alone."""
        jacobian = reading_jacobian(self.parametrisation, point, self.positions, sign).reshape(-1, len(point))
        jacobian *= weight[:, None]
        inverse = self.span @ np.linalg.pinv(shortened(jacobian) @ self.span, rcond=cut)
        return _Slopes(jacobian, sign, inverse @ inverse.T)

    def minimise(self, point: NDArray, weight: NDArray) -> tuple[NDArray, NDArray, bool]:
        """Gauss-Newton from a point; the minimum, the signs of the inputs there, and whether it settled."""
        sign, last, slopes = np.zeros(self.reading.shape), np.inf, None
        for iteration in range(MAX_ITERATIONS):
            resting = iteration > ITERATIONS_BEFORE_SIGNS_REST
            if resting:
                residual = self.residual(point, sign)
            else:
                both = predicted_input_and_reading(self.parametrisation, point, self.positions)
                sign = np.where(both[..., 0] >= 0.0, 1, -1)
                residual = (self.reading - both[..., 1]).ravel()
            if slopes is None or last > NEAR or not np.array_equal(sign, slopes.sign):
                slopes = self.slopes(point, weight, sign)
            step = slopes.step(residual * weight)
            size = float(np.abs(step).max())
            if size > 1e-6:
                signs = None
                if resting:
                    signs = sign
                now = _size_of(residual, weight) * (1 + 1e-9)
                while _size_of(self.residual(point + step, signs), weight) > now and np.abs(step).max() > 1e-3 * size:
                    step = step / 2
            point = point + step
            still = size < 1e-11 and size >= 0.5 * last and resting
            if size < 1e-15 or still:
                return point, sign, True
            last = size
        return point, sign, last < 1e-8


@dataclass(frozen=True)
class _Slopes:
    """Weighted derivatives (M, P) of the readings, the signs (N, 3) they hold for, and the covariance (P, P) of a fit.

    Near the minimum they serve for further steps.
    """

    jacobian: NDArray
    sign: NDArray
    covariance: NDArray

    def step(self, residual: NDArray) -> NDArray:
        """Return the step (P,) of least squares for weighted residuals (M,)."""
        return self.covariance @ (residual @ self.jacobian)


def _size_of(residual: NDArray, weight: NDArray) -> float:
    """Return the norm of a weighted residual."""
    # A step so long that its misfit is infinite is halved like any other that is too long.
    with np.errstate(over="ignore"):
        return float(np.linalg.norm(residual * weight))


def widening(
    linearised: Linearisation, certain: NDArray, noise_bound: float | NDArray, bounds: tuple[float, float]
) -> NDArray:
    """Return |Γ⁺ − Γ⁻| |n|, as large as the data allow, where the sign of an input is open; 0 elsewhere.

    The result is the addition to the bound of each measurement (3 N,), as a fraction of g. `certain` (N, 3) marks the
    signs that are certain before any data, by the `bounds` u^max and v^0max of (1.7).

    At first (1.7) limits the distance of an input from its estimate. With the bounds that follow, all measurements
    together limit it further, by any unbiased weights (those of least squares are at hand); this is repeated until
    nothing is gained. At every step truth is within the bounds of the readings, and the fit within its residuals.
    """
    extra = np.zeros(linearised.input.shape)
    if certain.all():
        return extra.ravel()
    p = linearised.parametrisation
    matrices = p.matrices[linearised.positions.mounting]
    margin = sign_margin(linearised.positions.alpha, linearised.positions.beta, matrices, bounds=bounds)
    some = np.flatnonzero(~certain.all(axis=1))
    gradient = direction_jacobian(p, linearised.point, linearised.positions.selected(some))
    size = np.abs(linearised.input)
    uncertainty = np.where(certain, 0.0, np.maximum(margin, size))
    difference = p.selection[0, 3:9:2] - p.selection[0, 4:9:2]
    estimate = np.abs(difference @ linearised.point)
    asymmetry = np.maximum(estimate, 2.0 * bounds[1])
    for _ in range(MAX_ROUNDS):
        still_open = ~certain & (size <= uncertainty)
        last, extra = extra, np.where(still_open, asymmetry * (size + uncertainty), 0.0)
        if np.abs(extra - last).max() <= 1e-3 * np.min(noise_bound):
            break
        spread = _spread(linearised, noise_bound + extra.ravel())
        i, k = np.nonzero(still_open)
        uncertainty[i, k] = np.minimum(uncertainty[i, k], spread(gradient[np.searchsorted(some, i), k]))
        asymmetry = np.minimum(asymmetry, estimate + spread(difference))
    return extra.ravel()


def _spread(linearised: Linearisation, bound: NDArray) -> Callable[[NDArray], NDArray]:
    """Return a function: the largest error of linear functions (K, P) of the parameters for readings within `bound`."""
    every = len(bound) // ENOUGH + 1
    # three readings for each position: a stride of a multiple of three would leave accelerometers out
    every += every % 3 == 0
    jacobian = linearised.jacobian[::every] / bound[::every, None]
    span = determined(jacobian * bound.min(), float(bound.min()))
    if every > 1 and span.shape[1] < linearised.span.shape[1]:
        jacobian = linearised.jacobian / bound[:, None]
        span = determined(jacobian * bound.min(), float(bound.min()))
    weights = span @ np.linalg.pinv(jacobian @ span)
    excess = 1.0 + min(3.0, float(np.abs(linearised.residual / bound).max()))

    def spread(directions: NDArray) -> NDArray:
        largest = np.full(len(directions), np.inf)
        inside = np.linalg.norm(directions - (directions @ span) @ span.T, axis=1) <= NOT_OUTSIDE
        for some in np.array_split(np.flatnonzero(inside), inside.sum() // AT_ONCE + 1):
            largest[some] = excess * np.abs(directions[some] @ weights).sum(axis=1)
        return largest

    return spread


def _open_remainder(linearised: Linearisation, extent: NDArray) -> NDArray:
    """Return the largest change of readings (M,) by undetermined parameters, as a fraction of g.

    Truth is within `extent` (P,): the bounds of (1.7), the biases like v, or priors. To first order such parameters
    hardly change the readings; to second order they turn into errors of everything else. The second differences along
    all pairs of moves are summed in absolute value.
    """
    directions = np.linalg.svd(linearised.span, full_matrices=True)[0][:, linearised.span.shape[1] :].T
    # as far as truth may be from the fit
    moves = directions * (np.abs(directions) @ extent + np.abs(directions @ linearised.point))[:, None]

    def shift(move: NDArray) -> NDArray:
        return linearised.residual_at(linearised.point + move) - linearised.residual

    moved = np.zeros(len(linearised.bound))
    single = [shift(move) for move in moves]
    for j, move in enumerate(moves):
        moved += np.maximum(np.abs(single[j]), np.abs(shift(-move)))
        for k in range(j):
            moved += np.abs(shift(move + moves[k]) - single[j] - single[k])
    return moved


@dataclass(frozen=True)
class Solution:
    """Solution of a linear system for the parameters.

    `radius` is the least largest residual over its bound; `duals` (M,) prove it. `feasible` is None where the
    measurements contradict the model. `further` (K, 2) are the ends of further combinations of parameters.
    """

    radius: float
    duals: Floats
    feasible: "FeasibleSet | None"
    estimator: Estimator | None
    parameters: list[Parameter]
    further: Floats

    @property
    def stated(self) -> "KindOfEstimate | None":
        """Kind of the estimates; None where nothing is determined."""
        if self.estimator is None and any(p.estimate is not None for p in self.parameters):
            return "least squares"
        return self.estimator

    @property
    def reading_errors(self) -> list[ReadingError]:
        """The further ends as errors of readings at the `corners` of the input."""
        ends = zip(corners(), self.further.tolist(), strict=True)
        return [ReadingError.of(accelerometer, n, low, high) for (accelerometer, n), (low, high) in ends]

    @property
    def contradicted(self) -> bool:
        """Return whether no parameters keep every residual within its bound."""
        return self.feasible is None


def solve_system(
    system: Linearisation,
    targets: Sequence[Target],
    slack: float,
    noise_bound: float,
    further: NDArray | None = None,
    fitted: Linearisation | None = None,
) -> Solution:
    """Return the solution of a system for targets and further combinations (K, P) of parameters.

    The slack is the addition to the noise bound for the digits of the readings; both are fractions of g. Least squares
    use the system `fitted`, if it is another. Raises a SolverError if a programme cannot be solved.
    """
    weights = np.array([target.weights for target in targets])
    combinations = weights
    if further is not None:
        combinations = np.vstack([weights, further])
    radius, centre, duals = chebyshev_centre(system)
    feasible, estimator = None, None
    possible = np.full((len(combinations), 3), np.nan)
    if radius <= 1.0 + slack / noise_bound + RELATIVE_TOLERANCE:
        feasible = FeasibleSet(system, centre, slack)
        possible, estimator = possible_values(feasible, combinations)
    a_priori = a_priori_values(system, targets)
    squares = least_squares_values(fitted or system, weights)
    numbers = np.hstack((possible[: len(targets)], a_priori, squares))
    parameters = [_parameter(target, row.tolist()) for target, row in zip(targets, numbers, strict=True)]
    return Solution(radius, duals, feasible, estimator, parameters, possible[len(targets) :, 1:])


def _parameter(target: Target, numbers: Sequence[float]) -> Parameter:
    """Return a target with its numbers, NaN where there is none; least squares take the place of a missing centre."""
    central, low, high, a_priori, guaranteed, squares, deviation = map(finite_or_none, numbers)
    return Parameter(
        symbol=target.symbol,
        name=target.name,
        unit=target.unit,
        determined=a_priori is not None,
        estimate=squares if central is None else central,
        standard_error=deviation,
        low=low,
        high=high,
        a_priori=a_priori,
        guaranteed_error=guaranteed,
        least_squares=squares,
    )


@dataclass(frozen=True)
class FeasibleSet:
    """Everything that the readings leave possible."""

    linearised: Linearisation
    centre: NDArray
    slack: float

    @cached_property
    def residual(self) -> NDArray:
        """Exact residuals (M,) at the centre."""
        return self.linearised.residual_at(self.centre)

    @cached_property
    def room(self) -> NDArray:
        """Largest allowed residuals (M,): bound and slack, or the Chebyshev centre's residual if larger."""
        return np.maximum(self.linearised.bound + self.slack, np.abs(self.residual)) * (1.0 + RELATIVE_TOLERANCE)


LARGEST_STEP = 1e3
"""A longer step, in radians or in parts of one, leads to where no model holds: something is all but undetermined."""


def chebyshev_centre(system: Linearisation) -> tuple[float, NDArray, NDArray]:
    """Return the least max |z − f(X)| / bound of the exact model, its point (P,), and the duals (M,) that prove it.

    The programme is solved again about its own centre with exact residuals until it stays there: near the fit one more
    time is enough. Where the measurements leave parameters open, the programme at the fit is kept.
    """
    radius, step, duals = chebyshev_radius(system.jacobian, system.residual, system.bound)
    if system.deficient:
        return radius, system.point, duals
    best = system.point
    attained = float(np.abs(system.residual / system.bound).max())
    for _ in range(8):
        if np.abs(step).max() > LARGEST_STEP:
            break
        centre = best + step
        residual = system.residual_at(centre)
        worst = float(np.abs(residual / system.bound).max())
        if worst >= attained:
            break
        best, attained = centre, worst
        # By the same duals the programme about this centre has no smaller radius.
        if attained - min(radius, float(duals @ residual)) <= 1e-9 * radius:
            break
        radius, step, duals = chebyshev_radius(system.jacobian, residual, system.bound)
    return radius, best, duals


def a_priori_values(system: Linearisation, targets: Sequence[Target]) -> NDArray:
    """Return each target's a-priori estimate and guaranteed error (T, 2), NaN where the measurements leave it open.

    The weights of (2.4), (2.5) are chosen before anything is read: their worst error is least, and the readings may
    afterwards prove their estimate impossible.
    """
    values = np.full((len(targets), 2), np.nan)
    determinable = [k for k, target in enumerate(targets) if _is_determined(system, target.weights)]
    reduced = Polytope(system.jacobian @ system.span, system.bound)
    if determinable:
        reduced.confine(-system.bound, system.bound)
    solved = reduced.maximise_each([system.span.T @ targets[k].weights for k in determinable])
    shown = tracked(solved, "guaranteed errors", show=_takes_long(system), total=len(determinable))
    for k, (error, _, phi) in zip(determinable, shown, strict=True):
        weights = targets[k].weights
        values[k] = weights @ system.point + phi @ system.residual, error
    return values


def least_squares_values(system: Linearisation, weights: NDArray) -> NDArray:
    """Return usual least squares: weights'X (K,) at the fit and its standard error, together (K, 2).

    The standard error is from the scatter of the residuals with M − rank degrees of freedom. Both are NaN where the
    measurements do not determine the combination; the error also where they leave no freedom. Readings whose sign is
    open weigh less.
    """
    values = np.full((len(weights), 2), np.nan)
    weight = system.bound.min() / system.bound
    rank = system.span.shape[1]
    freedom = len(system.residual) - rank
    variance = np.nan
    if freedom > 0:
        variance = float(np.sum((weight * system.residual) ** 2)) / freedom
    _, triangle = np.linalg.qr(shortened((system.jacobian @ system.span) * weight[:, None]))
    for k, row in enumerate(weights):
        if _is_determined(system, row):
            spread = np.linalg.solve(triangle.T, system.span.T @ row)
            values[k] = row @ system.point, np.sqrt(variance * (spread @ spread))
    return values


def central_point(feasible: FeasibleSet, weights: NDArray, intervals: NDArray) -> Central:
    """The point (P,) of the feasible set to state: the analytic centre, with every exact residual within its room.

    The centre of the linearised set is sought again about itself, from the Chebyshev centre on, until it stays. Where
    the set has no interior the central programme takes its place, for weights'X (K, P) and their intervals (K, 2).
    """
    system, point, residual, room = feasible.linearised, feasible.centre, feasible.residual, feasible.room
    bounded = np.isfinite(intervals).all(axis=1)
    estimator: Estimator = "analytic centre"
    for _ in range(MAX_CENTRED):
        jacobian = system.jacobian_at(point) @ system.span
        about = Bounded(jacobian, residual, room)
        centre = central(
            about, weights[bounded] @ system.span, intervals[bounded] - (weights[bounded] @ point)[:, None]
        )
        step, estimator = centre.x, centre.estimator
        residual = system.residual_at(point + system.span @ step)
        while (np.abs(residual) > room).any() and step.any():
            # The exact model has smaller residuals than the linear one.
            step = np.where(np.abs(step) > SMALLEST, step / 2.0, 0.0)
            residual = system.residual_at(point + system.span @ step)
        point = point + system.span @ step
        if np.abs(jacobian @ step / room).max(initial=0.0) <= STILL:
            break
    return Central(point, estimator)


def possible_values(feasible: FeasibleSet, weights: NDArray) -> tuple[NDArray, Estimator | None]:
    """Return estimate, low and high (K, 3) of weights'X (K, P), and the kind of estimate.

    NaN where the measurements do not determine it; None where they determine nothing at all.
    """
    ends = exact_intervals(feasible, weights)
    if not np.isfinite(ends).any():
        return np.full((len(weights), 3), np.nan), None
    stated = central_point(feasible, weights, ends)
    values = np.where(np.isfinite(ends).all(axis=1), weights @ stated.x, np.nan)
    # The point is possible: an end that rounding moved before it goes to the point.
    low, high = np.minimum(ends[:, 0], values), np.maximum(ends[:, 1], values)
    return np.stack((values, low, high), axis=1), stated.estimator


def exact_intervals(feasible: FeasibleSet, weights: NDArray) -> NDArray:
    """Return the least and the greatest weights'X that the measurements leave possible.

    The ends are those of the linear programmes about the Chebyshev centre. They are moved outwards by the largest
    remainder of the linearisation at any of the vertices, weighted by each programme's duals.

    Shape (K, 2) for weights (K, P), NaN where the measurements do not determine it.
    """
    system, centre = feasible.linearised, feasible.centre
    intervals = np.full((len(weights), 2), np.nan)
    determinable = [k for k, row in enumerate(weights) if _is_determined(system, row)]
    if not determinable:
        return intervals
    polytope, residual = _steps_of(feasible)
    tops, steps = [], []
    senses = [(k, side, sense) for k in determinable for side, sense in enumerate((-1.0, 1.0))]
    solved = polytope.maximise_each([system.span.T @ (sense * weights[k]) for k, _, sense in senses])
    for value, step, phi in tracked(solved, "exact intervals", show=_takes_long(system), total=len(senses)):
        steps.append(system.span @ step)
        support = np.flatnonzero(phi)
        tops.append((value, support, np.abs(phi[support])))
    rows = system.rows_of(np.unique(np.concatenate([support for _, support, _ in tops]) // 3))
    near, remainder, moves = system.selected(rows), np.zeros(len(residual)), np.array(steps)
    beyond = residual[rows] - near.residuals_at(centre + moves) - moves @ near.jacobian.T
    remainder[rows] = np.abs(beyond).max(axis=0)
    for (k, side, sense), (value, support, phi) in zip(senses, tops, strict=True):
        intervals[k, side] = float(weights[k] @ centre) + sense * (value + phi @ remainder[support])
    # where hardly a point is left, rounding alone decides which end is which
    return np.sort(intervals, axis=1)


def _steps_of(feasible: FeasibleSet) -> tuple[Polytope, NDArray]:
    """Steps from the centre, in coordinates of `span`, that keep residuals within bounds; the residuals (M,) there."""
    system = feasible.linearised
    polytope = Polytope(system.jacobian @ system.span, system.bound)
    polytope.confine(feasible.residual - feasible.room, feasible.residual + feasible.room)
    return polytope, feasible.residual


def _takes_long(system: Linearisation) -> bool:
    """Return whether the measurements are numerous enough to show progress."""
    return len(system.bound) >= MANY_MEASUREMENTS


def _is_determined(system: Linearisation, weights: NDArray) -> bool:
    """Return whether the measurements determine weights'X."""
    if not system.deficient:
        return True
    outside = float(np.linalg.norm(weights - system.span @ (system.span.T @ weights)))
    return outside <= NOT_OUTSIDE * float(np.linalg.norm(weights))


def simplest_directions(beyond: NDArray) -> NDArray:
    """Return unit vectors (K, P) that span as columns (P, K) do; each has a parameter that is in no other."""
    if not beyond.size:
        return np.zeros((0, len(beyond)))
    of_one = pivoted(beyond.T)[1][: beyond.shape[1]]
    directions = beyond @ np.linalg.inv(beyond[of_one])
    return (directions / np.linalg.norm(directions, axis=0)).T


def open_directions(system: Linearisation, targets: Sequence[Target], close_by: str) -> list[Open]:
    """Return the directions that measurements leave open, each with the targets that it changes.

    They are chosen so that each changes few parameters: of each some parameter is in no other.
    """
    rank = system.span.shape[1]
    beyond = np.linalg.svd(system.span, full_matrices=True)[0][:, rank:]
    found = []
    for direction in simplest_directions(beyond):
        symbols = []
        for target in targets:
            if abs(target.weights @ direction) > NOT_OUTSIDE * float(np.linalg.norm(target.weights)):
                symbols.append(target.symbol)
        if symbols:
            found.append(Open(parameters=symbols, close_by=close_by))
    return found


@dataclass(frozen=True)
class PairSet:
    """Possible values of two targets: vertices (V, 2) in order, about the origin of the estimates."""

    first: Target
    second: Target
    vertices: NDArray


def joint_sets(feasible: FeasibleSet) -> dict[str, list[PairSet]]:
    """The pairwise projections of the feasible set, group by group; targets that readings leave open are left out."""
    system = feasible.linearised
    polytope, _ = _steps_of(feasible)
    by_symbol = {
        t.symbol.split("@")[0]: t
        for t in reversed(convention_targets(system.parametrisation, "A1"))
        if _is_determined(system, t.weights)
    }
    pairs = []
    for group, symbols in GROUPS:
        targets = [by_symbol[symbol] for symbol in symbols if symbol in by_symbol]
        for number, second in enumerate(targets):
            pairs += [(group, first, second) for first in targets[:number]]
    result: dict[str, list[PairSet]] = {}
    for group, first, second in tracked(pairs, "joint feasible set", show=_takes_long(system)):
        weights = np.array([first.weights, second.weights])
        middle = weights @ feasible.centre
        result.setdefault(group, []).append(PairSet(first, second, middle + _polygon(polytope, weights @ system.span)))
    return result


def _polygon(polytope: Polytope, weights: NDArray) -> NDArray:
    """Vertices of a polytope's projection {weights x}: from four on, each edge is pushed out until it holds."""
    size = np.array([polytope.maximise(-row)[0] + polytope.maximise(row)[0] for row in weights])
    scale = np.where(size > 0.0, size, 1.0)
    rows = weights / scale[:, None]

    def furthest(direction: NDArray) -> NDArray:
        return rows @ polytope.maximise(direction @ rows)[1]

    vertices = [furthest(np.array(d)) for d in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))]
    k = 0
    while k < len(vertices) and len(vertices) < 100:
        vertex, after = vertices[k], vertices[(k + 1) % len(vertices)]
        edge = after - vertex
        if np.abs(edge).max() <= SAME:
            k += 1
            continue
        outwards = np.array([edge[1], -edge[0]])
        outermost = furthest(outwards)
        if (outermost - vertex) @ outwards > SAME * np.linalg.norm(outwards):
            vertices.insert(k + 1, outermost)
        else:
            k += 1
    return np.array(vertices) * scale
