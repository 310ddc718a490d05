"""What an unexplained error depends on: rate, turn, orientation, time, temperature."""

from typing import Any

import numpy as np

from ..diagnosis.judge import MOST_ROWS, predicted_share, spread
from ..evidence.carried import Carried


def residual_structure(made: Carried) -> list[dict[str, Any]]:
    """How much of the quoted errors a smooth function of one quantity predicts at pieces that it was not fitted to.

    Returns
    -------
    list of dict
        ``axis`` of the block, ``on``, ``explained`` and ``explainable``, parts of the sum of squares; the most telling
        first
    """
    part = made.parts[made.quoted]
    left = made.about_axes(made.split(made.left_by(made.refit(())))[made.quoted])
    bound = part.bound.max(axis=1)
    rows = np.unique(np.linspace(0, len(left) - 1, MOST_ROWS).round().astype(int))
    quantities = made.quantities()
    entries = []
    for axis in range(3):
        error = left[rows, axis]
        total = float((error**2).sum())
        explainable = max(0.0, 1.0 - float((bound[rows] ** 2).sum()) / 3.0 / total) if total > 0.0 else 0.0
        for name, values in quantities.items():
            share = predicted_share(spread(values[rows]), error)
            entries.append({"axis": axis + 1, "on": name, "explained": share, "explainable": explainable})
    return sorted(entries, key=lambda entry: -round(float(entry["explained"]), 9))
