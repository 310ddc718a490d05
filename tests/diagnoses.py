"""Diagnoses as the tests ask for them, and their expected results."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from generator import SIGMA, G
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import Cause, Diagnosis, diagnose
from trihedron.tools.evidence.references import turned
from trihedron.tools.records import PositionRecord

Sizes = Sequence[float | tuple[float, float]]
"""True values of an effect's parameters; a time between two rows is a pair."""


def diagnosed(record: Any, **options: Any) -> Any:
    """Return the diagnosis of a record, without a further simulation of the result."""
    if isinstance(record, PositionRecord):
        options.setdefault("noise_bound", SIGMA)
    return diagnose(record, **{"rerun": False, **options})


def sets_of(result: Any) -> list[set[EffectPlace]]:
    """Return the effects of each possible set."""
    return [{cause.place for cause in causes} for causes in result.sets]


def holds(cause: Cause, sizes: Sizes) -> bool:
    """Return True if the true sizes are within the intervals of a cause, phases up to whole turns."""
    for parameter, size, (low, high) in zip(cause.parameters, sizes, cause.intervals, strict=True):
        least, most = size if isinstance(size, tuple) else (size, size)
        if parameter.name.endswith("phase"):
            turns = 2.0 * math.pi * round((0.5 * (low + high) - least) / (2.0 * math.pi))
            least, most = least + turns, most + turns
        if not low <= least <= most <= high:
            return False
    return True


def assert_named(result: Any, hidden: Mapping[EffectPlace, Sizes]) -> None:
    """Assert that only these effects explain the record, and that their intervals hold the true sizes."""
    assert result.verdict == "explained", str(result)
    assert sets_of(result) == [set(hidden)]
    for cause in result.causes:
        assert holds(cause, hidden[cause.place]), (cause, hidden[cause.place])


def worst_carried(evidence: Any, run: Any) -> float:
    """Return the largest error, over its bound, of gravity carried by a run's attitudes to the end of every move.

    The reference is gravity by the run's accelerometers.
    """
    attitude = run.select("q0", "q1", "q2", "q3").to_numpy()
    force = run.select("f1_mps2", "f2_mps2", "f3_mps2").to_numpy()[1:] / G
    reference, rows, worst = evidence.model.reference, evidence.rows, 0.0
    means = np.array([force[max(rest.start - 1, 0) : rest.stop - 1].mean(axis=0) for rest in reference.rests.rows])
    up = means / np.linalg.norm(means, axis=1)[:, None]
    for number, moves in enumerate(reference.scored):
        error = reference.errors(number, turned(moves, attitude), up, up)
        worst = max(worst, float(np.abs(error / rows.parts[rows.scored[number]].bound).max()))
    return worst


def flowing(result: Diagnosis) -> str:
    """Return the answer of a diagnosis at a terminal, as one line."""
    return " ".join(str(result).split())
