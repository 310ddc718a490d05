"""The value of a plan on the real bench: angles with setting errors, and effects that no model contains.

Errors of setting (section 4 of Golovan, Matasov, Tarygin 2022), before the measurement. At the actual angles the plan's
weights Φ estimate with the bias Σ b X, b = Σ Φ F − a. The bias is tolerable if Σ|b| X^max is small beside σ Σ|Φ|.
Otherwise the weights are compensated by (4.2), l̃ = A L⁻¹ (Φ z) with L = Σ Φ Fᵀ at the actual angles. Or the programme
is solved again on the actual angles, which is optimal. At the actual angles a reading counts by (1.7) as printed. The
plan's further margins, the bias rows or a reserve, may be used up.

Effects: a unit effect changes the readings by d. Parameters imitate it to within dist = min over X of max |d − F'X| at
best, so noise within σ cannot hide an effect larger than 2 σ / dist. Near the optimal positions some effects are nearly
parameters; extra positions separate them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.bench import regressors
from ...models.effects import CATALOGUE, POSITION_EFFECTS, EffectPlace
from ..bounded.programmes import chebyshev_radius
from ..calibration.calibration import checked_noise_bound
from ..calibration.model import Positions
from ..errors import InputError, nearest
from ..evidence.bench_visits import Circumstances, Visits, is_linear, signature_columns
from ..orchestrator.stimuli import read_number_table
from ..quantity import Quantity
from ..records.columns import LIMITS
from ..result import Result
from .forms import x_from_targets
from .request import parsed_keep_out
from .task import NOT_DETERMINED, Costs, Places, Task, allowed, clearances, costs, on_all_mountings, readings, task_of

TOLERABLE = 0.1
"""Largest tolerable bias, as a fraction of the guaranteed error."""
AS_GOOD = 1.01
"""Largest cost of compensated weights, relative to new ones, at which they are good enough."""
UNBIASED = 1e-9
DECIMALS_DEG = 9
"""Decimals of setting errors [deg]: the rest is rounding of sines and cosines."""
ADVICE = ("tolerable", "compensate", "re-solve", "measure again")
"""Advice in order of increasing effort."""
EDGE_DEG = 1e-8
"""Angles within this distance of the end of a keep-out are outside it [deg]."""
LATTICE_DEG = 15.0
PHASES = 8
"""Number of phases over which an effect with two coefficients is judged by its least distance."""
SHORTLIST = 10
"""Number of most promising positions that are judged by the distance itself."""
NOTHING = 1e-9


class TargetCheck(Result):
    """Consequence of the actual angles for one target; all in units of σ.

    Attributes
    ----------
    target : str
        symbol of the target
    planned : float
        Σ|Φ| of the plan
    bias : float
        Σ|b| X^max / σ with the plan's weights at the actual angles
    compensated : float or None
        Σ|Φ| by (4.2); None if that is impossible
    solved : float or None
        Σ|Φ| of the programme on the actual angles; None if they do not determine the target
    advice : str
        one of `ADVICE`
    """

    target: Annotated[str, Quantity("target")]
    planned: Annotated[float, Quantity("plan Σ|Φ|", "", "up", 5)]
    bias: Annotated[float, Quantity("Σ|b|X^max", "", "up", 4)]
    compensated: Annotated[float | None, Quantity("(4.2) Σ|Φ|", "", "up", 5)]
    solved: Annotated[float | None, Quantity("re-solved", "", "up", 5)]
    advice: Annotated[str, Quantity("advice")]


class SettingCheck(Result):
    """Consequence of setting errors for a plan.

    Attributes
    ----------
    advice : str
        advice for the worst target
    lost_readings : int
        readings with weight whose sign is no longer certain
    largest_error_deg : float
        largest error of setting [deg]
    noise_bound : float
        σ
    targets : tuple of TargetCheck
        consequence for each target
    """

    schema_: Literal["trihedron.setting-check/1"] = Field(default="trihedron.setting-check/1", alias="schema")
    advice: str
    lost_readings: int
    largest_error_deg: float
    noise_bound: float
    targets: tuple[TargetCheck, ...]


def read_settings(path: Path, keep_out: Sequence[str] = ()) -> tuple[Places, Places]:
    """Return planned and actual positions of an `angles.csv`.

    Raises InputError for another file, for angles that no table has, and for a position inside a keep-out, with its
    row.
    """
    names = ("planned_alpha_deg", "planned_beta_deg", "alpha_deg", "beta_deg")
    table, _ = read_number_table(path, str(path), names)
    low, high, needed = LIMITS["alpha_deg"]
    for name in names:
        angles = table.columns[name]
        outside = np.flatnonzero((angles < low) | (angles > high))
        if len(outside):
            k = int(outside[0])
            raise InputError(f"{table.row(k)}, column '{name}': {angles[k]:g} is outside {low:g} to {high:g}; {needed}")
        for text in keep_out:
            axis, start, end = parsed_keep_out(text)
            inside = np.mod(angles - np.degrees(start), 360.0)
            wrong = (inside > EDGE_DEG) & (inside < np.degrees(end - start) - EDGE_DEG)
            if name.endswith(("alpha_deg", "beta_deg")[axis]) and wrong.any():
                k = int(wrong.argmax())
                raise InputError(f"{table.row(k)}, column '{name}': {angles[k]:g} is inside --keep-out {text}")
    angle = np.radians(np.column_stack([table.columns[name] for name in names]))
    mounting = np.zeros(len(angle), dtype=int)
    return Places(angle[:, :2], mounting), Places(angle[:, 2:], mounting)


def check_settings(task: Task, planned: Places, actual: Places, noise_bound: float) -> SettingCheck:
    """Compare bias and noise σ of a plan's estimators at the actual angles of the table, position by position.

    Raises InputError if the planned positions do not determine every target, for an impossible noise bound, for a
    symmetric baseline, and for more than one mounting.
    """
    p, noise_bound = task.parametrisation, checked_noise_bound(noise_bound)
    if p.symmetric or len(p.mountings) != 1:
        raise InputError("plan check: is for the asymmetric baseline and one mounting")
    plan = costs(task, planned)
    if missing := plan.missing(task):
        raise InputError(f"plan check: the planned positions do not determine {', '.join(missing)}")
    exact = task_of(replace(task.request, admissible="paper", reserve_deg=0.0, keep_out=()), best=task.best)
    at = _actual_estimators(task, exact, plan, actual)
    u, v = task.request.bounds
    bias = np.abs(at.reached - at.aimed) @ np.where(np.arange(18) < 3, u, v) / noise_bound
    compensated = at.compensated()
    again = costs(exact, actual)
    checks = []
    for k, target in enumerate(task.targets):
        solved = float(again.ratio[k] * task.best[k]) if again.ratio[k] < NOT_DETERMINED else None
        mended = None if compensated is None else float(np.abs(compensated[k]).sum())
        cost = float(np.abs(plan.weights[k]).sum())
        unchanged = bias[k] <= TOLERABLE * cost and at.certain[at.used[k]].all()
        advice = _advice(unchanged=bool(unchanged), compensated=mended, solved=solved)
        checks.append(
            TargetCheck(
                target=target.symbol,
                planned=cost,
                bias=float(bias[k]),
                compensated=mended,
                solved=solved,
                advice=advice,
            )
        )
    turned = np.degrees(np.abs(np.angle(np.exp(1j * (actual.angle - planned.angle)))))
    return SettingCheck(
        advice=max((check.advice for check in checks), key=ADVICE.index),
        lost_readings=int((at.used.any(axis=0) & ~at.certain).sum()),
        largest_error_deg=float(np.round(turned.max(initial=0.0), DECIMALS_DEG)),
        noise_bound=noise_bound,
        targets=tuple(checks),
    )


@dataclass(frozen=True)
class _Estimators:
    """A plan's estimators at the actual angles.

    Readings (K, M) with weight, certain readings (M,), their weights (K, M), the parameters (K, 18) that these
    estimate, and the parameters that they should estimate.
    """

    used: NDArray
    certain: NDArray
    weights: NDArray
    reached: NDArray
    aimed: NDArray

    def compensated(self) -> NDArray | None:
        """Return the weights (K, M) of (4.2), unbiased at the actual angles; None if L is singular."""
        reached, aimed = self.reached, self.aimed
        if reached.shape[0] != reached.shape[1] or np.linalg.cond(reached) > 1e9:
            return None
        if np.abs(aimed @ np.linalg.solve(reached, reached) - aimed).max() >= UNBIASED:
            return None
        return aimed @ np.linalg.solve(reached, self.weights)


def _actual_estimators(task: Task, exact: Task, plan: Costs, actual: Places) -> _Estimators:
    position, sheet = plan.readings.position, plan.readings.sheet
    certain = clearances(exact, actual)[position, sheet] > 0.0
    weights = np.where(certain, plan.weights, 0.0)
    alpha, beta = actual.angle[position].T
    p = task.parametrisation
    f = regressors(alpha, beta, p.matrices[0])[np.arange(len(position)), task.accelerometer[sheet]]
    aimed = task.weights @ np.linalg.inv(x_from_targets() @ p.selection[0])
    return _Estimators(np.abs(plan.weights) > 1e-9, certain, weights, weights @ f, aimed)


def _advice(*, unchanged: bool, compensated: float | None, solved: float | None) -> str:
    """Return the easiest sufficient advice from Σ|Φ| of (4.2) and of the programme solved again."""
    if solved is None:
        return "measure again"
    if unchanged:
        return "tolerable"
    if compensated is not None and compensated <= AS_GOOD * solved:
        return "compensate"
    return "re-solve"


class EffectDistance(Result):
    """Visibility of an effect: the distance of the unit effect from the model's range.

    Attributes
    ----------
    effect : str
        title of the effect
    distance_before, distance_after, distance_at_most : float
        with the plan, with the extra positions, and with every position of the lattice
    """

    effect: Annotated[str, Quantity("effect")]
    distance_before: Annotated[float, Quantity("distance before", "", "down", 4)]
    distance_after: Annotated[float, Quantity("now", "", "down", 4)]
    distance_at_most: Annotated[float, Quantity("at most", "", "up", 4)]


def named_effects(names: Sequence[str]) -> list[EffectPlace]:
    """Return the effects of names: "quadratic accelerometer-3", or "quadratic" for all its places.

    Raises InputError for a name that is not in the catalogue.
    """
    places: list[EffectPlace] = []
    for effect in POSITION_EFFECTS.values():
        places += effect.places
    chosen: list[EffectPlace] = []
    for name in names:
        words = " ".join(name.split())
        if words in POSITION_EFFECTS and not CATALOGUE[words].places:
            raise InputError(f"--detect {name!r}: is of one reading; no choice of positions shows it better")
        meant = [place for place in places if words in (place.title, place.effect)]
        if not meant:
            effect, known = words.split(" ")[0], list(POSITION_EFFECTS)
            if effect in POSITION_EFFECTS:
                known = [place.title for place in places if place.title.split(" ")[0] == effect]
            raise InputError(f"--detect {name!r}: is not in the catalogue; {nearest(words, known)}")
        chosen += [place for place in meant if place not in chosen]
    return chosen


def detecting(task: Task, places: Places, effects: Sequence[EffectPlace]) -> tuple[Places, tuple[EffectDistance, ...]]:
    """Append extra positions to a plan that raise the least distance, relative to the distance on a whole lattice.

    The request sets the largest number of extra positions; positions without a gain are not added. Raises InputError
    for an effect that does not depend on the positions.
    """
    lattice = _lattice(task)
    most, before = _distances(task, effects, places.joined(lattice)), _distances(task, effects, places)
    for effect, limit in zip(effects, most, strict=True):
        if limit <= NOTHING:
            raise InputError(f"--detect {effect.title!r}: is imitated by the parameters at every position")
    extended, now = places, before
    for _ in range(task.request.extra):
        weakest = int((now / most).argmin())
        if now[weakest] > 0.999 * most[weakest]:
            break
        best, least_worth = None, (-np.inf, -np.inf)
        for row in _promising(task, effects[weakest], extended, lattice):
            trial = extended.joined(lattice.chosen([row]))
            shown = _distances(task, effects, trial)
            worth = round(float((shown / most).min()), 9), round(float((shown / most).mean()), 9)
            if worth > least_worth:
                best, least_worth = (trial, shown), worth
        assert best is not None
        extended, now = best
    distances = []
    for k, effect in enumerate(effects):
        distances.append(
            EffectDistance(
                effect=effect.title,
                distance_before=float(before[k]),
                distance_after=float(now[k]),
                distance_at_most=float(most[k]),
            )
        )
    return extended, tuple(distances)


def _lattice(task: Task) -> Places:
    """Return the lattice's positions outside the keep-outs at which a reading counts."""
    degrees = np.arange(0.0, 360.0, LATTICE_DEG)
    angle = np.radians(np.stack(np.meshgrid(degrees, degrees, indexing="ij"), axis=-1).reshape(-1, 2))
    lattice = on_all_mountings(angle[allowed(task, angle)], len(task.parametrisation.mountings))
    return lattice.chosen(np.unique(readings(task, lattice).position))


def _distances(task: Task, effects: Sequence[EffectPlace], places: Places) -> NDArray:
    return np.array([distance(task, effect, places) for effect in effects])


def distance(task: Task, effect: EffectPlace, places: Places) -> float:
    """Return the Chebyshev distance of the unit effect from the range of the model on the readings of these
    positions."""
    return _imitated(task, effect, places)[0]


def _imitated(task: Task, effect: EffectPlace, places: Places) -> tuple[float, NDArray, NDArray]:
    """Return the least distance over the effect's phases, the phase, and the parameters that imitate it best."""
    regressor, columns = readings(task, places).regressor, _columns(task, effect, places)
    units = np.eye(columns.shape[1])
    if len(units) == 2:
        phases = np.pi * np.arange(PHASES) / PHASES
        units = np.column_stack([np.cos(phases), np.sin(phases)])
    least = np.inf, units[0], np.zeros(regressor.shape[1])
    for unit in units:
        signal = columns @ unit
        size = float(np.abs(signal).max(initial=0.0))
        imitation = 0.0, unit, np.zeros(regressor.shape[1])
        if size >= NOTHING:
            radius, x, _ = chebyshev_radius(regressor, signal / size, np.ones(len(signal)))
            imitation = (radius if radius > 1e-8 else 0.0) * size, unit, x * size
        if imitation[0] < least[0]:
            least = imitation
    return least


def _columns(task: Task, effect: EffectPlace, places: Places) -> NDArray:
    """Return the change of the counting readings by the unit effect (M, K)."""
    columns = np.zeros((3 * len(places), 1))
    if is_linear(effect):
        still, p = np.zeros(len(places)), task.parametrisation
        at = Positions(places.angle[:, 0], places.angle[:, 1], places.mounting)
        rows = Visits(p, at, Circumstances(still, still + 20.0, still, still, True)).rows(np.zeros(len(p.symbols)))
        columns = signature_columns([effect], rows)
    if not columns.any():
        raise InputError(
            f"--detect {effect.title!r}: is not linear, or shows in time, temperature or moves, not by positions alone"
        )
    counted = readings(task, places)
    return columns.reshape(len(places), 3, -1)[counted.position, task.accelerometer[counted.sheet]]


def _promising(task: Task, effect: EffectPlace, present: Places, lattice: Places) -> NDArray:
    """Return positions of the lattice at which the parameters that imitate the effect best on the plan fail most."""
    _, unit, x = _imitated(task, effect, present)
    counted = readings(task, lattice)
    missed = np.abs(_columns(task, effect, lattice) @ unit - counted.regressor @ x)
    highest = np.zeros(len(lattice))
    np.maximum.at(highest, counted.position, missed)
    return np.argsort(-np.round(highest, 9), kind="stable")[:SHORTLIST]
