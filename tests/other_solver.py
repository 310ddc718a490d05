"""Linear programmes by another solver, for tests of ours."""

import numpy as np
from scipy.optimize import linprog


def farthest(jacobian, left, bound, weights) -> float:
    """The greatest weights'x with |left - jacobian x| ≤ bound, by another solver."""
    size, unit = np.abs(jacobian).max(axis=0), bound.min()
    scaled = jacobian / size
    a = np.vstack((scaled, -scaled))
    b = np.concatenate((left + bound, bound - left)) / unit
    found = linprog(-weights / size, A_ub=a, b_ub=b, bounds=[(None, None)] * len(weights), method="highs-ds")
    return float(-found.fun * unit)
