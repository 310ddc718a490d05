"""Linear programmes by another solver, for tests of ours."""

import numpy as np
from scipy.optimize import linprog


def farthest(jacobian, left, bound, weights) -> float:
    """Return the greatest weights'x with |left - jacobian x| ≤ bound, by another solver."""
    size, unit = np.abs(jacobian).max(axis=0), bound.min()
    scaled = jacobian / size
    a = np.vstack((scaled, -scaled))
    b = np.concatenate((left + bound, bound - left)) / unit
    result = linprog(-weights / size, A_ub=a, b_ub=b, bounds=[(None, None)] * len(weights), method="highs-ds")
    return float(-result.fun * unit)


def farthest_of_growing(jacobian, left, bound, rate, sign, size, weights) -> float:
    """Return the greatest weights'x with |left - jacobian x| ≤ bound + rate |x_1|, for x_1 of a sign and size; -inf
    if none."""
    scale, unit = np.abs(jacobian).max(axis=0), bound.min()
    scaled, grown = jacobian / scale, np.zeros_like(jacobian)
    grown[:, 0] = sign * rate / scale[0]
    a = np.vstack((scaled - grown, -scaled - grown))
    b = np.concatenate((left + bound, bound - left)) / unit
    ends = tuple(float(end) for end in sorted((0.0, sign * size * scale[0] / unit)))
    bounds = [ends] + [(None, None)] * (len(weights) - 1)
    result = linprog(-weights / scale, A_ub=a, b_ub=b, bounds=bounds, method="highs-ds")
    return float(-result.fun * unit) if result.success else -np.inf
