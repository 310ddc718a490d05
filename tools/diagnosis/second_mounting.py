"""What a second mounting of the block would tell apart that the record's mountings cannot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..calibration.model import Linearisation, Positions, linearise, parametrise
from ..calibration.mountings import PRESETS
from .classes import column_space, residual_spaces

WORTH_IT = 0.6
"""A mounting is proposed when it makes the correlation of two causes at most so many times what it was."""


@dataclass(frozen=True)
class SecondMounting:
    """A mounting to measure in besides.

    Attributes
    ----------
    mounting : str
        name of a preset
    separates : tuple of str
        the causes that it tells apart
    correlation_before, correlation_after : float
        largest correlation of what the causes add to the model, over all positions: now, and with both mountings
    """

    mounting: str
    separates: tuple[str, ...]
    correlation_before: float
    correlation_after: float

    def to_json(self) -> dict[str, Any]:
        """The entry `second_mounting`."""
        return {
            "mounting": self.mounting,
            "separates": list(self.separates),
            "correlation_before": self.correlation_before,
            "correlation_after": self.correlation_after,
        }


def with_mountings(here: Linearisation, more: Sequence[str]) -> Linearisation:
    """A faultless bench with the record's mountings and further presets; it has no readings to speak of."""
    p = here.parametrisation
    mountings = dict(zip(p.mountings, p.matrices, strict=True)) | {name: PRESETS[name] for name in more}
    extended = parametrise(mountings, symmetric=p.symmetric)
    at = Positions(np.array([0.7]), np.array([0.7]), np.zeros(1, dtype=int))
    return linearise(extended, at, np.zeros((1, 3)), np.zeros(len(extended.symbols)), np.ones(3))


def second_mounting(
    here: Linearisation, first: Sequence[EffectPlace], second: Sequence[EffectPlace], titles: tuple[str, str]
) -> SecondMounting | None:
    """The preset that tells two sets of linear effects apart best; None where none does it better than the record's.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    first, second : sequence of EffectPlace
        what has a signature; not empty
    titles : (str, str)
        the sets in words
    """
    if not first or not second:
        return None
    own = [np.round(matrix, 9).tolist() for matrix in here.parametrisation.matrices]
    tried = [name for name, matrix in PRESETS.items() if np.round(matrix, 9).tolist() not in own]
    before = correlation(with_mountings(here, ()), first, second)
    after = {name: correlation(with_mountings(here, (name,)), first, second) for name in tried}
    if not after:
        return None
    # Of presets that do about as well, the first: it is the easiest to mount.
    best = next(name for name, value in after.items() if value <= min(after.values()) + 0.1 * before)
    return SecondMounting(best, titles, before, after[best]) if after[best] <= WORTH_IT * before else None


def correlation(bench: Linearisation, first: Sequence[EffectPlace], second: Sequence[EffectPlace]) -> float:
    """Cosine of the least angle between the spaces that two sets add to the nominal model; 1 where one adds none."""
    spaces = residual_spaces(bench, [*first, *second])
    a, b = _joint(spaces[: len(first)]), _joint(spaces[len(first) :])
    return min(1.0, float(np.linalg.norm(a.T @ b, 2))) if a.shape[1] and b.shape[1] else 1.0


def _joint(spaces: Sequence[NDArray]) -> NDArray:
    return column_space(np.hstack(spaces))
