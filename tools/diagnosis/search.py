"""The smallest sets of effects that explain a record: candidates, linear search, exact judgement."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.progress import track

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.parametrisation import Positions
from trihedron.calibration.programmes import chebyshev_radius
from trihedron.diagnosis.circumstances import Circumstances
from trihedron.diagnosis.extended_fit import ExtendedFit, fit_extended, rows_at, signature_columns
from trihedron.diagnosis.lawson import Problem
from trihedron.diagnosis.sets import MAX_SET, EffectSet, sets_of_size
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.models.effects.outlier import place_of


@dataclass(frozen=True)
class Explanation:
    """A set of effects, fitted.

    Attributes
    ----------
    fit : ExtendedFit
        the model with them
    values : tuple of tuple of float
        parameters of each effect at the Chebyshev centre
    possible : bool
        whether the catalogue calls all those sizes possible
    """

    fit: ExtendedFit
    values: tuple[tuple[float, ...], ...]
    possible: bool

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """The effects."""
        return self.fit.places

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(place.title for place in self.places)


def catalogue_places(baseline: str, circumstances: Circumstances) -> list[EffectPlace]:
    """Every effect at every place that can be tried: not in the baseline's model, nothing missing in the record."""
    return [
        place
        for effect in CATALOGUE.values()
        if effect.within != baseline
        and effect.variants is None
        and all(getattr(circumstances, need) is not None for need in effect.needs)
        for place in effect.places
    ]


def is_linear(place: EffectPlace) -> bool:
    """Whether an effect is linear in its coefficients, so that its signature says it all."""
    return CATALOGUE[place.effect].variants is None


def explain(fit: ExtendedFit) -> Explanation:
    """The parameters of fitted effects, and whether they are possible."""
    coefficients = fit.coefficients + fit.centre[len(fit.point) :]
    values, possible = [], True
    if fit.variant is not None:
        parameters = fit.variant.values(coefficients)
        effect = CATALOGUE[fit.places[0].effect]
        possible = all(p.possible(v) for v, p in zip(parameters, effect.parameters, strict=True))
        return Explanation(fit, (parameters,), possible)
    first = 0
    for place in fit.places:
        effect = CATALOGUE[place.effect].at(place)
        count = len(effect.parameters)
        parameters = effect.from_coefficients(coefficients[first : first + count])
        first += count
        values.append(parameters)
        possible &= all(
            parameter.possible(value) for value, parameter in zip(parameters, effect.parameters, strict=True)
        )
    return Explanation(fit, tuple(values), possible)


def linear_problem(here: Linearisation, circumstances: Circumstances, places: Sequence[EffectPlace]) -> Problem:
    """The search as a linear problem at the fit of the nominal model, in units of the bounds."""
    at: Positions = here.positions
    rows = rows_at(here, here.point, at, circumstances)
    columns, blocks, first = [], [], 0
    for place in places:
        block = signature_columns([place], rows) / here.bound[:, None]
        columns.append(block)
        blocks.append(slice(first, first + block.shape[1]))
        first += block.shape[1]
    stacked = np.hstack(columns) if columns else np.zeros((len(here.residual), 0))
    return Problem(here.residual / here.bound, here.jacobian / here.bound[:, None], stacked, tuple(blocks))


def smallest_explanations(
    here: Linearisation,
    circumstances: Circumstances,
    places: Sequence[EffectPlace],
    limit: float,
    radius: float,
    others: Sequence[Explanation] = (),
    *,
    progress: bool = False,
) -> list[Explanation]:
    """All sets of effects of the smallest size, up to two, that make the record consistent; the least radius first.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    places : sequence of EffectPlace
        candidates; outliers are tried at every reading besides
    limit : float
        radius up to which a model is consistent
    radius : float
        of the nominal model: the larger, the farther its fit may be from the truth
    others : sequence of Explanation
        single effects that explain the record but are not linear: where there are any, larger sets are not needed
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    list of Explanation
    """
    problem = linear_problem(here, circumstances, places)
    found: dict[EffectSet, Explanation] = {}
    # Of second order in the misfit: by so much the linear model at a wrong fit may err.
    slack = 0.05 + 20.0 * radius**2 * float(here.bound.min())

    def judge(candidate: EffectSet) -> bool:
        chosen = [places[i] for i in candidate.effects]
        chosen += [place_of(int(here.position[i]) + 1, int(here.accelerometer[i])) for i in candidate.outliers]
        explanation = explain(fit_extended(here, circumstances, chosen))
        found[candidate] = explanation
        return explanation.possible and explanation.fit.radius <= limit

    console = Console(stderr=True)
    sets: list[EffectSet] = []
    for size in range(1, (1 if others else MAX_SET) + 1):
        stream = sets_of_size(problem, size, slack)
        bar = track(
            stream,
            f"sets of {size}",
            total=None,
            console=console,
            disable=not (progress and console.is_terminal),
            transient=True,
        )
        sets = [candidate for candidate in bar if judge(candidate)]
        if sets:
            break
    return sorted([*(found[candidate] for candidate in sets), *others], key=lambda e: (round(e.fit.radius, 9), e.title))


def single_radii(
    here: Linearisation, circumstances: Circumstances, places: Sequence[EffectPlace]
) -> list[tuple[str, float]]:
    """What each single effect leaves, by the model linearised at the nominal fit; the least radius first."""
    rows = rows_at(here, here.point, here.positions, circumstances)
    tried = []
    for place in places:
        jacobian = np.hstack((here.jacobian, signature_columns([place], rows)))
        tried.append((place.title, chebyshev_radius(jacobian, here.residual, here.bound)[0]))
    return sorted(tried, key=lambda entry: (round(entry[1], 9), entry[0]))
