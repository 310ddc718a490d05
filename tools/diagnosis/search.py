"""Which single effects would make the record consistent."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from trihedron.calibration.linearisation import Linearisation
from trihedron.diagnosis.extended_fit import ExtendedFit, fit_extended
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.models.effects.outlier import place_of

MANY_MEASUREMENTS = 1500
"""From here on the search takes seconds and shows its progress."""


@dataclass(frozen=True)
class Candidate:
    """An effect that was tried.

    Attributes
    ----------
    fit : ExtendedFit
        the model with it
    values : tuple of float
        its parameters at the Chebyshev centre
    possible : bool
        whether its catalogue entry calls that size possible
    """

    fit: ExtendedFit
    values: tuple[float, ...]
    possible: bool

    @property
    def place(self) -> EffectPlace:
        """The effect."""
        return self.fit.places[0]


def catalogue_places(baseline: str) -> list[EffectPlace]:
    """Every effect at every place that the baseline's model does not hold already, outliers apart."""
    return [place for effect in CATALOGUE.values() if effect.within != baseline for place in effect.places]


def outlier_places(here: Linearisation, duals: NDArray) -> list[EffectPlace]:
    """Outliers that could mend the record: only those of the witness, which alone proves the falsification."""
    witness = np.abs(duals) * here.bound > 1e-9
    return [
        place_of(int(i) + 1, int(axis))
        for i, axis in zip(here.position[witness], here.accelerometer[witness], strict=True)
    ]


def try_effects(
    here: Linearisation, hours: NDArray, places: Sequence[EffectPlace], *, progress: bool = False
) -> list[Candidate]:
    """Fit the model with each effect in turn; the one that leaves the least radius comes first."""
    console = Console(stderr=True)
    quiet = not progress or not console.is_terminal or len(here.residual) < MANY_MEASUREMENTS
    tried = [
        assess(fit_extended(here, hours, [place]))
        for place in track(places, "effects", console=console, disable=quiet, transient=True)
    ]
    return sorted(tried, key=lambda candidate: candidate.fit.radius)


def assess(fit: ExtendedFit) -> Candidate:
    """The parameters of a fitted effect, and whether they are possible."""
    effect = CATALOGUE[fit.places[0].effect]
    coefficients = fit.coefficients + fit.centre[len(fit.point) :]
    values = effect.from_coefficients(coefficients)
    possible = all(
        abs(value) <= parameter.largest * (1.0 + 1e-9)
        for value, parameter in zip(values, effect.parameters, strict=True)
    )
    return Candidate(fit, values, possible)
