"""Predictions by fits of a bench, for held-out positions and for positions that might be measured.

The extended FMUs run at held-out positions, without and with the effects: the difference is the gain. Further
positions, and a second mounting, are named if they separate candidate causes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from ...fmus.parameters import component_parameters
from ...models.arrays import Ints
from ...models.bench import TARGETS, admissible
from ...models.effects import EffectPlace, Rows
from ..bounded.possible import Possible
from ..bounded.programmes import column_space, cosine, least_largest, spaces_beyond
from ..calibration.model import (
    PRESETS,
    Parametrisation,
    Positions,
    every_position,
    parametrise,
    predicted_input,
    reading_jacobian,
    table_position,
)
from ..orchestrator import run_scenario
from .bench_model import LARGEST_OF_BENCH, MAX_LEVERAGE, Cast, Readings, fitted, leverages
from .bench_visits import Circumstances, Visits, acted_on, is_linear, readings_at, signature_columns, untold_readings
from .cells import Cell
from .extension import READINGS, TABLE_AND_BLOCK, Visited, can_be_run
from .fit import Fit, Gain, contains, gain_of, with_effects

SEPARATING_STEP_DEG, DENSE_STEP_DEG = 5.0, 15.0
MOST_CANDIDATES = 10
"""Most candidates, the best ones first, that are separated from each other."""
MOST_FOR_A_PAIR = 4
"""Most new positions that are proposed to decide between two candidates."""
MOST_POSITIONS = 6
"""Most positions that are proposed in all; a pair that would need more waits for the next measurement."""
LATER = (0.25, 0.5, 0.75, 1.0)
"""Parts of a record's length after its end at which positions may be measured again."""
HOUR_DIGITS = 5
"""Decimals of a time [h]: 0.04 s."""
WORTH_IT = 0.6
"""Largest ratio of correlations of two causes, after and before, for which a mounting is proposed."""
HELD_OUT_EVERY = 4
"""Number of positions for each that is held out."""
FEWEST_SCORED = 3


def lasting_part(fit: Fit) -> tuple[tuple[EffectPlace, ...], NDArray]:
    """Return the linear effects of a fit that act at other positions too, and the mask of their coefficients."""
    places, numbers = [], []
    for place, block, variant in fit.ways:
        if place.effect != "outlier" and variant is None:
            places.append(place)
            numbers += range(block.start, block.stop)
    return tuple(places), np.array(numbers, dtype=int)


def later_part(fit: Fit) -> list[tuple[EffectPlace, slice, Callable[[Rows], NDArray]]]:
    """Return the effects of a fit that add columns by their variant, with coefficients and later columns (n, 3, K)."""
    return [
        (place, block, variant.elsewhere)
        for place, block, variant in fit.ways
        if isinstance(variant, Cell) and variant.elsewhere is not None
    ]


# Positions


@dataclass(frozen=True)
class Rival:
    """Predictions of a candidate at positions that might be measured, over all parameters that the record allows.

    `centre` (N, 3): readings over g at the centre of the possible parameters; `slopes` (N, 3, rank): derivatives in the
    coordinates of their set. `known` (N, 3): mask of the readings with a bounded prediction. `bent`: true if some
    effects are not linear, so that their sizes are fixed there.
    """

    fit: Fit
    possible: Possible
    centre: NDArray
    slopes: NDArray
    known: NDArray
    bent: bool


def rival_of(fit: Fit, visits: Visits, room: float) -> Rival:
    """Return a candidate as a rival of others at some visits; `room` is the addition to the bounds for rounding."""
    count, bench = len(visits), len(fit.point)
    places, numbers = lasting_part(fit)
    central = fit.central
    sign = np.where(predicted_input(visits.parametrisation, central[:bench], visits.at) >= 0.0, 1, -1)
    at = (visits.parametrisation, visits.at, visits.circumstances)
    readings = Readings(*at, reading=np.zeros((count, 3)), bound=np.full(3 * count, np.inf), sign=sign)
    model = Cast(places).model(readings, central[:bench], central[bench:][numbers])
    assert model is not None
    slopes = np.zeros((count, 3, len(central)))
    slopes[..., np.append(np.arange(bench), bench + numbers)] = model.jacobian.reshape(count, 3, -1)
    reading, rows = model.reading.reshape(count, 3), visits.rows(fit.point)
    for _, block, elsewhere in later_part(fit):
        columns = bench + np.arange(block.start, block.stop)
        slopes[..., columns] = elsewhere(rows)
        reading = reading + slopes[..., columns] @ central[columns]
    possible = fit.possible(room)
    scaled = slopes / possible.scale
    inside = scaled @ possible.span
    outside = np.linalg.norm(scaled - inside @ possible.span.T, axis=2) > 1e-6 * np.linalg.norm(scaled, axis=2)
    # A dead zone, saturation or rounding acts last.
    adding = {place for place, _, _ in later_part(fit)}
    bent = []
    for place, values in zip(fit.places, fit.values(), strict=True):
        if not is_linear(place) and place not in adding:
            bent.append((place, values))
    reading = acted_on(bent, rows, reading) if bent else reading
    return Rival(fit, possible, reading, inside, ~outside, bool(bent))


def separating_positions(
    readings: Readings, point: NDArray, fits: Sequence[Fit], bounds: tuple[float, float], room: float
) -> list[dict[str, Any]]:
    """Return positions to measure next whose readings together decide between candidates, the best one first.

    If candidates depend on time, the list includes positions of the record, to be measured again at once or at times up
    to twice the record's length. The order is then that of time.

    For two candidates, the search finds the possible parameters with the nearest predictions at the positions chosen so
    far. It adds the position where the two then differ most, until they differ somewhere by more than 2 σ for any
    parameters: then no readings can be within σ of both.

    `point` (P,) is the nominal fit. With the `bounds`, u^max and v^0max, only readings whose sign is certain count.
    `room` is the addition to the bounds for the rounding of the readings, as a fraction of g.

    Each position has alpha_deg, beta_deg, and its mounting if there are several. Where time matters it has the hours
    since the first row and, in ``repeats``, the row that it repeats. Where the senses of the approach matter it has
    these. It also has the candidates that it separates and ``apart_g``. That is the guaranteed difference of the
    predictions of the pair for which it was chosen, at one position at least, over all parameters; more than 2 σ
    decides. A candidate that contains another one can never be separated from it.
    """
    chosen = list(fits[:MOST_CANDIDATES])
    every: set[EffectPlace] = set()
    for fit in chosen:
        every.update(lasting_part(fit)[0])
    lasting = sorted(every, key=lambda place: place.title)
    programme = Programme.of(readings, point, chosen, lasting)
    visits, sided = programme.visits, programme.sided
    at, p = visits.at, visits.parametrisation
    is_told = ~untold_readings(lasting, visits.rows(point)).reshape(-1, 3)
    usable = admissible(at.alpha, at.beta, p.matrices[at.mounting], bounds=bounds) & is_told
    rivals = [rival_of(fit, visits, room) for fit in chosen]
    sure = 2.0 * (float(readings.bound.min()) + room)
    apart: dict[int, float] = {}
    names: dict[int, list[str]] = {}
    for first, second in combinations(rivals, 2):
        sets = first.fit.places, second.fit.places
        if contains(*sets) or contains(*reversed(sets)):
            continue
        distance, rows_chosen = decide(first, second, usable, list(apart), sure)
        if distance <= sure or len({*apart, *rows_chosen}) > MOST_POSITIONS:
            continue
        for row in rows_chosen:
            apart[row] = min(apart.get(row, np.inf), distance)
            names[row] = list(dict.fromkeys((*names.get(row, ()), first.fit.title, second.fit.title)))
    positions = []
    for row, distance in apart.items():
        position = table_position(p, at, row, digits=6)
        if programme.timed:
            position["hours"] = float(visits.circumstances.hours[row])
            if programme.again[row] >= 0:
                position["repeats"] = int(programme.again[row]) + 1
        if sided:
            position["approach_alpha"] = int(visits.circumstances.sense_alpha[row])
            position["approach_beta"] = int(visits.circumstances.sense_beta[row])
        positions.append({**position, "separates": names[row], "apart_g": max(0.0, float(distance))})
    return sorted(positions, key=lambda position: position["hours"]) if programme.timed else positions


def decide(first: Rival, second: Rival, usable: NDArray, rows: Sequence[int], sure: float) -> tuple[float, list[int]]:
    """Positions that decide between two candidates, of those chosen already and up to `MOST_FOR_A_PAIR` new ones.

    Before them the least distance of the predictions at the worst of the positions [g].
    """
    usable = usable & first.known & second.known
    difference = np.where(usable, first.centre - second.centre, 0.0)
    chosen = [row for row in rows if np.abs(difference[row]).max() > sure]
    if first.bent or second.bent:
        # A nonlinear effect has fixed sizes, not a set of them: compare the fitted predictions.
        best = int(np.argmax(np.round(np.abs(difference).max(axis=1), 12)))
        chosen = chosen or [best]
        return float(np.abs(difference[chosen]).max()), chosen
    new = 0
    while True:
        distance, apart = nearest(first, second, usable, difference, chosen)
        if distance > sure or new == MOST_FOR_A_PAIR:
            return distance, chosen
        farthest = int(np.argmax(np.round(np.abs(apart).max(axis=1), 12)))
        if farthest in chosen:
            return distance, chosen
        chosen.append(farthest)
        new += 1


def nearest(
    first: Rival, second: Rival, usable: NDArray, difference: NDArray, rows: Sequence[int]
) -> tuple[float, NDArray]:
    """Return the least distance of the predictions at some positions [g], and all differences (N, 3) at that point."""
    if not rows:
        return 0.0, difference
    axes = usable[list(rows)]
    offset = difference[list(rows)][axes]
    slopes = np.hstack((first.slopes[list(rows)][axes], -second.slopes[list(rows)][axes]))
    if not len(offset):
        return 0.0, difference
    steps, steps_of_second = first.possible, second.possible
    lower = np.concatenate((steps.lower, steps_of_second.lower))
    upper = np.concatenate((steps.upper, steps_of_second.upper))
    matrix = np.asarray(block_diag(steps.matrix, steps_of_second.matrix))
    distance, x = least_largest(matrix, lower, upper, offset, slopes)
    first_step, second_step = np.split(x, [first.possible.matrix.shape[1]])
    return distance, np.where(usable, difference + first.slopes @ first_step - second.slopes @ second_step, 0.0)


@dataclass(frozen=True)
class Programme:
    """Positions that might be measured after a record, N visits.

    `sided`: true if senses of the approach matter; `timed`: true if the time does; `again` (N,): the row of the record
    with the same position, -1 for a new one.
    """

    visits: Visits
    sided: bool
    timed: bool
    again: Ints

    @staticmethod
    def of(measured: Visits, point: NDArray, fits: Sequence[Fit], lasting: Sequence[EffectPlace]) -> "Programme":
        """A grid of positions with every mounting, those where outliers would be, and repeats where time matters."""
        p, circumstances, own = measured.parametrisation, measured.circumstances, measured.at
        grid = every_position(p, np.radians(np.arange(0.0, 360.0, SEPARATING_STEP_DEG)))
        repeated: set[int] = set()
        for fit in fits:
            for place in fit.places:
                if place.effect == "outlier":
                    repeated.add(int(place.where.removeprefix("position-")) - 1)
        again = sorted(repeated)
        count, span = len(circumstances.hours), float(circumstances.hours[-1])
        now = round(span * (1.0 + 1.0 / max(count - 1, 1)), HOUR_DIGITS)

        def seen_by(visits: Visits) -> NDArray:
            """Return the columns (3 n, K) of the candidates' coefficients at the visits."""
            rows = visits.rows(point)
            columns = [signature_columns(lasting, rows)]
            for fit in fits:
                for _, _, elsewhere in later_part(fit):
                    columns.append(elsewhere(rows).reshape(3 * len(visits), -1))
            return np.hstack(columns)

        def at_hours(when: float, rows: NDArray) -> Visits:
            """Return the record's own positions at a time, with the last temperature."""
            last = 20.0 if circumstances.temperature is None else float(circumstances.temperature[-1])
            alike = np.ones(len(rows))
            circumstances_there = Circumstances(when * alike, last * alike, 0.0 * alike, 0.0 * alike, True)
            return Visits(p, Positions(own.alpha[rows], own.beta[rows], own.mounting[rows]), circumstances_there)

        every = np.arange(count)
        first, end = seen_by(at_hours(0.0, every)), seen_by(at_hours(now, every))
        twice = seen_by(at_hours(now + span, every))
        times = [now]
        timed = bool(np.any(first != end) or any(later_part(fit) for fit in fits))
        if timed:
            again = every.tolist()
        if np.any(end != twice):
            times += [round(now + part * span, HOUR_DIGITS) for part in LATER]
        new = Visits(p, grid, at_hours(now, np.zeros(len(grid.alpha), dtype=int)).circumstances)
        parts, of_record = [new], np.array(again, dtype=int)
        for when in times:
            parts.append(at_hours(when, of_record))
        plain = _together(parts)
        numbers = np.concatenate((np.full(len(new), -1), np.tile(of_record, len(times))))
        few = plain.selected(np.arange(0, len(plain), 97))
        columns = []
        for sense in (-1.0, 1.0):
            senses = np.full(len(few), sense)
            moved = replace(few.circumstances, sense_alpha=senses, sense_beta=senses)
            columns.append(signature_columns(lasting, replace(few, circumstances=moved).rows(point)))
        if not np.any(columns[0] != columns[1]):
            return Programme(plain, False, timed, numbers)
        sided = []
        for sense_alpha, sense_beta in product((-1.0, 1.0), repeat=2):
            sided.append(_approached(plain, sense_alpha, sense_beta))
        return Programme(_together(sided), True, timed, np.tile(numbers, len(sided)))


def _approached(visits: Visits, alpha: float, beta: float) -> Visits:
    """The visits with a sense of the approach of each axis."""
    alike = np.ones(len(visits))
    return replace(
        visits, circumstances=replace(visits.circumstances, sense_alpha=alpha * alike, sense_beta=beta * alike)
    )


def _together(parts: Sequence[Visits]) -> Visits:
    """Visits of one bench, one after the other."""
    first = parts[0]

    def joined(name: str, of: Callable[[Visits], object]) -> NDArray:
        return np.concatenate([getattr(of(part), name) for part in parts])

    def place_of(part: Visits) -> Positions:
        return part.at

    circumstances = {}
    for name in ("hours", "temperature", "sense_alpha", "sense_beta"):
        circumstances[name] = joined(name, lambda part: part.circumstances)
    at = Positions(joined("alpha", place_of), joined("beta", place_of), joined("mounting", place_of))
    return replace(first, at=at, circumstances=replace(first.circumstances, **circumstances))


# Mountings


@dataclass(frozen=True)
class DenseVisits:
    """A dense set of positions with the signatures' arguments and the columns (M, P) of the bench's parameters.

    The positions cover the sphere with every mounting, no input near zero; times, temperatures and senses come in an
    order that no angle follows. To first order: the model is linearised at a faultless bench.
    """

    rows: Rows
    bench: NDArray

    @staticmethod
    def of(p: Parametrisation) -> "DenseVisits":
        """Return the dense positions with the mountings of a parametrisation."""
        angles = np.radians(np.arange(0.5 * DENSE_STEP_DEG, 360.0, DENSE_STEP_DEG))
        at, point = every_position(p, angles), np.zeros(len(p.symbols))
        bench = reading_jacobian(p, point, at).reshape(3 * len(at.alpha), -1)
        index = np.arange(len(at.alpha))
        # Fractional parts of multiples of irrational numbers fill the unit interval evenly and are unrelated.
        time, temperature = index * 0.618034 % 1.0, 20.0 + 10.0 * (index * 0.414214 % 1.0)
        sense_alpha = np.where(index * 0.732051 % 1.0 < 0.5, -1.0, 1.0)
        sense_beta = np.where(index * 0.236068 % 1.0 < 0.5, -1.0, 1.0)
        visits = Visits(p, at, Circumstances(time, temperature, sense_alpha, sense_beta, True))
        return DenseVisits(visits.rows(point), column_space(bench))

    def spaces(self, places: Sequence[EffectPlace]) -> list[NDArray]:
        """Return the orthonormal columns of each effect's signature beyond the nominal model."""
        return spaces_beyond(self.bench, [signature_columns([place], self.rows) for place in places])


def dense_spaces(p: Parametrisation, places: Sequence[EffectPlace]) -> list[NDArray]:
    """Return the orthonormal columns of each effect beyond the nominal model, over a dense set of positions."""
    return DenseVisits.of(p).spaces(places)


def second_mounting(
    p: Parametrisation,
    first: Sequence[EffectPlace],
    second: Sequence[EffectPlace],
    titles: Sequence[str],
    known: dict[str, DenseVisits] | None = None,
) -> dict[str, Any] | None:
    """Return the preset that best separates two sets of linear effects; None where none is better than the record's.

    Sets have their titles in words. ``correlation_before`` and ``correlation_after`` are the largest correlation of the
    sets' columns over all positions, now and with both mountings. `known` keeps the positions with each mounting for
    the next pair of sets.
    """
    if not first or not second:
        return None
    visits = {} if known is None else known

    def correlation(name: str = "") -> float:
        if name not in visits:
            mountings = dict(zip(p.mountings, p.matrices, strict=True)) | ({name: PRESETS[name]} if name else {})
            visits[name] = DenseVisits.of(parametrise(mountings, symmetric=p.symmetric))
        spaces = visits[name].spaces([*first, *second])
        a, b = column_space(np.hstack(spaces[: len(first)])), column_space(np.hstack(spaces[len(first) :]))
        return cosine(a, b) if a.shape[1] and b.shape[1] else 1.0

    mounted = [np.round(matrix, 9).tolist() for matrix in p.matrices]
    before = correlation()
    after = {}
    for name, matrix in PRESETS.items():
        if np.round(matrix, 9).tolist() not in mounted:
            after[name] = correlation(name)
    if not after:
        return None
    # Of presets that do about as well, take the first: it is the easiest to mount.
    best = next(name for name, value in after.items() if value <= min(after.values()) + 0.1 * before)
    if after[best] > WORTH_IT * before:
        return None
    keys = {"mounting": best, "separates": tuple(titles)}
    return {**keys, "correlation_before": before, "correlation_after": after[best]}


def helpful_mounting(
    p: Parametrisation, fits: Sequence[Fit], positions: Sequence[Mapping[str, Any]], sure: float
) -> dict[str, Any] | None:
    """Return a mounting that separates two candidates, where no further position surely does."""
    visits: dict[str, DenseVisits] = {}
    settled = [set(entry["separates"]) for entry in positions if entry["apart_g"] > sure]
    for first, second in combinations(fits[:MOST_CANDIDATES], 2):
        titles = first.title, second.title
        if any(names >= set(titles) for names in settled) or not (first.linear and second.linear):
            continue
        mounting = second_mounting(p, lasting_part(first)[0], lasting_part(second)[0], titles, visits)
        if mounting is not None:
            return mounting
    return None


def held_out_rows(fit: Fit) -> tuple[NDArray, NDArray] | None:
    """Return positions to hold out, with a mask (H, 3) of the scored readings; None where the others are too few.

    Of the ways to hold out every fourth position the function takes the one with most scored readings; the others must
    keep the rank of the extended model.
    """
    count = len(fit.residual) // 3
    best: tuple[NDArray, NDArray] | None = None
    # The first position is never held out: the simulation begins there, and no move leads to it.
    for offset in range(1, HELD_OUT_EVERY + 1):
        out = np.arange(offset, count, HELD_OUT_EVERY)
        rows_out = readings_at(out)
        leverage = leverages(fit.jacobian, np.setdiff1d(np.arange(3 * count), rows_out), rows_out)
        if len(out) and leverage is not None:
            scored = leverage.reshape(-1, 3) <= MAX_LEVERAGE
            if best is None or scored.sum() > best[1].sum():
                best = (out, scored)
    return None if best is None or best[1].sum() < FEWEST_SCORED else best


def measure_gain(readings: Readings, start: NDArray, fit: Fit, gravity: float) -> Gain | None:
    """Fit without every fourth position, simulate those by the orchestrator without and with the effects, compare.

    Fits begin at `start` (P,); `gravity` is the model's g [m/s²]. None where too few positions remain to judge.
    """
    chosen, circumstances = held_out_rows(fit), readings.circumstances
    if chosen is None or not can_be_run(circumstances):
        return None
    out, scored = chosen
    training = readings.selected(np.setdiff1d(np.arange(len(readings)), out))
    errors = []
    for places in ((), fit.places):
        trained = fitted_like(training, places, start, fit)
        if trained is None or np.abs(trained.point).max() > LARGEST_OF_BENCH:
            return None
        errors.append(readings.reading[out] - simulate_rows(readings, trained, out, gravity))
        scored = scored & ~undecided(readings, trained)[out]
    if scored.sum() < FEWEST_SCORED:
        return None
    before, after = np.where(scored, errors[0], np.nan), np.where(scored, errors[1], np.nan)
    gain = gain_of(errors[0][scored][:, None], errors[1][scored][:, None], rows=out)
    return gain.model_copy(update={"before": before, "after": after})


def fitted_like(readings: Readings, places: Sequence[EffectPlace], start: NDArray, like: Fit) -> Fit | None:
    """Fit effects to other readings; a nonlinear one as the variant with parameters nearest to those of `like`."""
    rows, ways = readings.rows(like.point), {}
    values_like = dict(zip(like.places, like.values(), strict=True))
    for place in places:
        if is_linear(place):
            continue
        variants = readings.ways(place, rows)
        if not variants:
            return None
        beyond = [_farthest_outside(values_like[place], variant.limits) for variant in variants]
        ways[place] = int(np.argmin(beyond))
    return fitted(readings, Cast(tuple(places), ways), start)


def _farthest_outside(values: Sequence[float], limits: Sequence[tuple[float, float]]) -> float:
    """Return the largest distance of a value outside its limits; 0 where all are inside."""
    farthest = 0.0
    for value, (low, high) in zip(values, limits, strict=True):
        farthest = max(farthest, low - value, value - high)
    return farthest


def undecided(readings: Readings, fit: Fit) -> NDArray:
    """Return which readings (N, 3) the effects of a fit leave open, so that no simulation can predict them."""
    rows = readings.rows_with(fit)
    untold = untold_readings(fit.places, rows).reshape(-1, 3)
    for _, _, variant in fit.ways:
        if variant is not None:
            untold |= variant.undecided(rows, float(readings.bound.min()))
    return untold


def simulate_rows(readings: Readings, fit: Fit, rows: NDArray, gravity: float) -> NDArray:
    """Return readings (n, 3) over g by the FMUs, extended with the effects of `fit`, at some rows of the record."""
    simulated = np.zeros((len(readings), 3))
    # Least-squares coefficients of a variant may be impossible to run; a possible point is not.
    fit = fit if fit.linear else fit.centred()
    bench, coefficients = np.split(fit.estimate, [len(fit.point)])
    at = readings.true_angles(bench, [(place, coefficients[block]) for place, block, _ in fit.ways])
    commands, p = np.stack((at.alpha, at.beta), axis=1), readings.parametrisation
    for index in range(len(p.mountings)):
        rows_mounted = np.flatnonzero(at.mounting == index)
        if np.isin(rows_mounted, rows).any():
            values = dict(zip(TARGETS, p.selection[index] @ bench, strict=True))
            parameters = component_parameters(values, gravity, p.matrices[index])
            fmus = with_effects(
                {name: (component, parameters[component]) for name, component in TABLE_AND_BLOCK.items()},
                effect_entries(fit),
            )
            visited = Visited.of(readings, commands, rows_mounted)
            run = run_scenario(visited.scenario("the positions of a record, simulated again", fmus, READINGS)).table
            time = run["time_s"].to_numpy()
            for axis, name in enumerate(READINGS):
                simulated[rows_mounted, axis] = np.interp(visited.times, time, run[name].to_numpy()) / gravity
    return simulated[rows]


def effect_entries(fit: Fit) -> list[dict[str, object]]:
    """Effects of a fit at its estimate, as a scenario writes them."""
    entries = []
    for place, values in zip(fit.places, fit.values(fit.estimate[len(fit.point) :]), strict=True):
        names = [parameter.name for parameter in place.definition.parameters]
        entries.append(place.entry | dict(zip(names, values, strict=True)))
    return entries
