"""Positions on the graduation of a real table."""

from itertools import product

import numpy as np

from .improvement import merit
from .places import Task, allowed
from .position_costs import Costs, costs

SWEEPS = 6


def rounded(task: Task, found: Costs, step_deg: float, criterion: str) -> Costs:
    """The set with every angle a multiple of the step, chosen so that the cost stays least.

    One position after the other goes to the best of the four multiples around it, while the later ones are still where
    they were; then each may move by one step, while that helps.

    Parameters
    ----------
    step_deg : float
        resolution of both axes [deg]
    """
    best = found
    for row in range(len(found.places)):
        low = np.floor(np.degrees(best.places.angle[row]) / step_deg)
        best = _best_of(task, best, row, [(low + shift) * step_deg for shift in product((0, 1), repeat=2)], criterion)
    for _ in range(SWEEPS):
        before = merit(best, criterion)
        for row in range(len(found.places)):
            own = np.round(np.degrees(best.places.angle[row]) / step_deg)
            around = [(own + shift) * step_deg for shift in product((0, -1, 1), repeat=2)]
            best = _best_of(task, best, row, around, criterion)
        if merit(best, criterion) >= before:
            break
    return best


def _best_of(task: Task, here: Costs, row: int, trials_deg: list, criterion: str) -> Costs:
    found = []
    for trial in trials_deg:
        angle = here.places.angle.copy()
        angle[row] = np.radians(trial)
        if allowed(task, angle[row : row + 1]).all():
            found.append(costs(task, here.places.at(angle)))
    if not found:
        angle = here.places.angle.copy()
        angle[row] = np.radians(trials_deg[0])
        return costs(task, here.places.at(angle))
    return min(found, key=lambda trial: merit(trial, criterion))
