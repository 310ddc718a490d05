"""Properties that the instruments of a lot share, and the instruments that differ.

Every search has one budget of chance, shared among all its trials (Bonferroni). A lot without a hidden cause or an odd
instrument shows one with a probability of at most `CHANCE`. Ranks and medians keep odd instruments from hiding each
other. An instrument with several records counts once, with its last.
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

import numpy as np
import scipy

from ...models.arrays import Bools, Floats
from ...models.effects import CATALOGUE
from ..diagnosis.cause import NamedEffect
from ..instrument import moment
from ..rounding import digits
from .result import Against, Distribution, InstrumentValue, Lot, LotTrend, Member, Odd, SharedCause
from .tolerance import Tolerance

CHANCE = 1e-2
"""Probability that a search names anything in a lot where there is nothing."""
LEAST_INSTRUMENTS = 8
"""Fewer instruments have no distribution to which one could be unlike."""
SMALL = 20
"""Fewer instruments are a small lot."""
LEAST_GROUP = 5
"""Fewest instruments before and after a step."""
NEAR = 10
"""Places of a step that are compared on each side of the surest one."""
NORMAL_SPREAD = 1.4826
"""Standard deviation of a normal law over its median distance from the median."""
EFFICIENCY = 0.37
"""Of the median distance as an estimate of a standard deviation: Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993)."""
HOURS_A_YEAR = 8766.0
INDEPENDENT = ("consistent", "explained")
"""Verdicts that tell the causes of an instrument: none, or those that are named."""


@dataclass(frozen=True, eq=False)
class LotColumn:
    """A parameter over the instruments of a lot that have it, in order of the serial numbers."""

    symbol: str
    unit: str
    members: Sequence[Member]
    estimates: Floats
    """(n,)"""
    lows: Floats
    """(n,); the estimate where no interval is guaranteed"""
    highs: Floats

    @property
    def median(self) -> float:
        """Return the median of the estimates."""
        return float(np.median(self.estimates))

    @property
    def spread(self) -> float:
        """Return the standard deviation of a normal law with this median distance from the median."""
        return NORMAL_SPREAD * float(np.median(np.abs(self.estimates - self.median)))


def lot_of(
    members: Sequence[Member],
    do: Literal["calibrate", "diagnose", "noise", "apply"],
    tolerance: Tolerance | None = None,
    warnings: Sequence[str] = (),
) -> Lot:
    """Return the lot of some records.

    Parameters
    ----------
    members : sequence of Member
        the records with their results in short
    do : str
        work on each record
    tolerance : Tolerance, optional
        table by which each record passes or fails
    warnings : sequence of str
        sentences on the batch for the reader

    Returns
    -------
    Lot
        distributions, odd instruments, shared causes and dependences

    Raises
    ------
    InputError
        for a tolerance of a parameter that no record has
    """
    judged = list(members)
    if tolerance is not None:
        tolerance.check_symbols(judged)
        judged = [tolerance.judged(member) for member in judged]
    instruments = last_records(judged)
    columns = columns_of(instruments)
    shared = shared_causes(instruments)
    verdicts = Counter(member.verdict for member in judged if member.verdict is not None)
    out = [member.serial for member in sorted(judged, key=order_of) if member.status == "fail"]
    return Lot(
        do=do,
        instruments=len({member.serial for member in judged}),
        failed=sum(member.failed is not None for member in judged),
        verdicts=dict(sorted(verdicts.items())),
        members=tuple(judged),
        distributions=tuple(distribution_of(column) for column in columns),
        odd=(*odd_values(columns), *odd_causes(instruments, shared)),
        shared=tuple(shared),
        dependences=tuple(dependences_of(columns)),
        first_out=out[0] if out else None,
        warnings=tuple(warnings),
    )


def order_of(member: Member) -> tuple[tuple[tuple[int, int, str], ...], str]:
    """Return a key by which serial numbers sort as people count: A9 before A10; equal ones by date."""
    parts = []
    for part in re.findall(r"\d+|\D+", member.serial):
        number = int(part) if part.isdecimal() else 0
        parts.append((int(not part.isdecimal()), number, part))
    return tuple(parts), member.date or ""


def last_records(members: Sequence[Member]) -> list[Member]:
    """Return the last record of each instrument that has a result, in order of the serial numbers."""
    last: dict[str, Member] = {}
    for member in sorted(members, key=order_of):
        if member.failed is None:
            last[member.serial] = member
    return list(last.values())


def columns_of(instruments: Sequence[Member]) -> list[LotColumn]:
    """Return the parameters that at least two instruments have."""
    by_symbol: dict[str, list[tuple[Member, InstrumentValue]]] = {}
    for member in instruments:
        for symbol, value in member.values.items():
            by_symbol.setdefault(symbol, []).append((member, value))
    columns = []
    for symbol, pairs in by_symbol.items():
        if len(pairs) < 2:
            continue
        estimates = np.array([value.estimate for _, value in pairs])
        lows = [value.estimate if value.low is None else value.low for _, value in pairs]
        highs = [value.estimate if value.high is None else value.high for _, value in pairs]
        column_members = [member for member, _ in pairs]
        columns.append(LotColumn(symbol, pairs[0][1].unit, column_members, estimates, np.array(lows), np.array(highs)))
    return columns


def distribution_of(column: LotColumn) -> Distribution:
    """Return the distribution of a parameter over its instruments."""
    halves = (column.highs - column.lows) / 2.0
    halves = halves[halves > 0.0]
    return Distribution(
        symbol=column.symbol,
        unit=column.unit,
        instruments=len(column.members),
        median=column.median,
        spread=column.spread,
        half_width=float(np.median(halves)) if len(halves) else None,
        least=float(column.estimates.min()),
        greatest=float(column.estimates.max()),
    )


# Odd instruments


def odd_values(columns: Sequence[LotColumn]) -> list[Odd]:
    """Return the instruments whose whole interval lies outside the range of the lot.

    The range is that of a normal law with the lot's median and spread; as the spread itself is uncertain, the quantile
    is Student's. Of a small lot the median and spread have no simple law. The value must then also be outside the range
    by the mean and standard deviation of the others, whose law is exact.
    """
    odd = []
    tried = sum(len(column.members) for column in columns)
    chance = CHANCE / (2.0 * max(1, tried))
    for column in columns:
        count = len(column.members)
        if count < LEAST_INSTRUMENTS or column.spread == 0.0:
            continue
        reach = column.spread * float(scipy.stats.t.isf(chance, EFFICIENCY * count))
        for k, member in enumerate(column.members):
            above = column.lows[k] - column.median
            below = column.median - column.highs[k]
            if max(above, below) <= reach:
                continue
            others = np.delete(column.estimates, k)
            exact = (
                others.std(ddof=1) * float(scipy.stats.t.isf(chance, count - 2)) * math.sqrt(1.0 + 1.0 / (count - 1))
            )
            if count < SMALL and abs(column.estimates[k] - others.mean()) <= exact:
                continue
            times = abs(column.estimates[k] - column.median) / column.spread
            sentence = (
                f"{column.symbol} = {digits(column.estimates[k], 4)} {column.unit}, {digits(times, 2)} spreads from "
                f"the lot's median {digits(column.median, 4)}"
            )
            odd.append(Odd(serial=member.serial, record=member.record, symbol=column.symbol, sentence=sentence))
    return odd


def odd_causes(instruments: Sequence[Member], shared: Sequence[SharedCause]) -> list[Odd]:
    """Return the instruments with a cause that they do not share with their lot."""
    common = {(key_of(cause.cause), serial) for cause in shared for serial in cause.serials}
    odd = []
    for member in instruments:
        for cause in member.causes:
            if (key_of(cause), member.serial) not in common:
                odd.append(Odd(serial=member.serial, record=member.record, symbol="", sentence=cause.title))
    return odd


# Shared causes


def key_of(cause: NamedEffect) -> str:
    """Return what makes two causes the same: effect, place, order, axes."""
    content = cause.model_dump(include={"effect", "where", "order", "accelerometer", "axes", "law"})
    return repr(sorted(content.items()))


def shared_causes(instruments: Sequence[Member]) -> list[SharedCause]:
    """Return the causes that more instruments share than chance explains, and since which serial number.

    By chance an instrument that has a cause has each cause of the catalogue with the same probability. An outlier is
    of one record and never shared.
    """
    judged = [member for member in instruments if member.verdict in INDEPENDENT]
    by_key: dict[str, NamedEffect] = {}
    carriers: dict[str, set[str]] = {}
    causes_in_all = 0
    for member in judged:
        for cause in member.causes:
            if cause.effect == "outlier":
                continue
            causes_in_all += 1
            by_key.setdefault(key_of(cause), NamedEffect(**NamedEffect.keys(cause.place)))
            carriers.setdefault(key_of(cause), set()).add(member.serial)
    possible = sum(len(effect.places) for effect in CATALOGUE.values())
    shared = []
    for key, serials in carriers.items():
        has = np.array([member.serial in serials for member in judged])
        rate = causes_in_all / (possible * len(judged))
        chance = min(1.0, possible * float(scipy.stats.binom.sf(len(serials) - 1, len(judged), min(rate, 1.0))))
        if len(serials) < 2 or chance > CHANCE:
            continue
        begin, end = _part_of(has)
        title = by_key[key].title
        count = int(has[begin:end].sum())
        since = judged[begin].serial if begin else None
        until = judged[end - 1].serial if end < len(judged) else None
        where = "in all serial numbers"
        if since is not None:
            where = f"since serial {since}"
        if until is not None:
            where = f"up to serial {until}" if since is None else f"from serial {since} to {until}"
        shared.append(
            SharedCause(
                cause=by_key[key],
                count=count,
                of=end - begin,
                since=since,
                until=until,
                chance=chance,
                serials=tuple(member.serial for member in judged[begin:end] if member.serial in serials),
                sentence=f"{where}: {title} in {count} of {end - begin}",
            )
        )
    return sorted(shared, key=lambda cause: cause.chance)


def _part_of(has: Bools) -> tuple[int, int]:
    """Return the first instrument, and the one after the last, of the part in which a cause is more frequent.

    A split is taken only where chance does not explain the difference of the two sides.
    """
    begin, end = 0, len(has)
    for _ in range(2):
        split = _split_of(has[begin:end])
        if split is None and end - begin == len(has):
            return _stretch_of(has)
        if split is None:
            break
        at = begin + split
        if has[at:end].mean() > has[begin:at].mean():
            begin = at
        else:
            end = at
    return begin, end


def _stretch_of(has: Bools) -> tuple[int, int]:
    """Return the part between two instruments with a cause in which it is more frequent; all where chance may be why.

    One split may be explained by chance where a part between two is not.
    """
    count, total = len(has), int(has.sum())
    at = np.flatnonzero(has)
    first, last = np.triu_indices(total)
    chances = scipy.stats.hypergeom.sf(last - first, count, total, at[last] - at[first] + 1)
    best = int(np.argmin(chances))
    if chances[best] * 0.5 * count**2 > CHANCE:
        return 0, count
    return int(at[first[best]]), int(at[last[best]]) + 1


def _split_of(has: Bools) -> int | None:
    """Return where the rate of a cause changes; None where it may be the same everywhere."""
    count, total = len(has), int(has.sum())
    best: tuple[float, int] | None = None
    before = np.cumsum(has)
    for at in range(1, count):
        larger, size = int(before[at - 1]), at
        if larger * count < total * at:
            larger, size = total - larger, count - at
        chance = float(scipy.stats.hypergeom.sf(larger - 1, count, total, size))
        if best is None or chance < best[0]:
            best = chance, at
    if best is None or best[0] * 2.0 * count > CHANCE:
        return None
    return best[1]


# Steps and trends


def dependences_of(columns: Sequence[LotColumn]) -> list[LotTrend]:
    """Return the parameters that change with serial number, date or temperature, the surest of these for each."""
    dependences = []
    for column in columns:
        tests = 3.0 * len(columns)
        candidates = [_step_of(column), _trend_of(column, "date"), _trend_of(column, "temperature")]
        sure = []
        for candidate in candidates:
            if candidate is not None and candidate.chance * tests <= CHANCE:
                sure.append(candidate.model_copy(update={"chance": candidate.chance * tests}))
        if sure:
            dependences.append(min(sure, key=lambda dependence: _remainder(column, dependence)))
    return dependences


def _remainder(column: LotColumn, dependence: LotTrend) -> float:
    """Return the mean distance of the estimates from a step or a trend, where the instruments tell its abscissa."""
    abscissa, members = _abscissa(column, dependence.against)
    estimates = column.estimates[members]
    if dependence.since is not None:
        serials = [member.serial for member in column.members]
        abscissa = np.arange(len(serials)) >= serials.index(dependence.since)
    left = estimates - dependence.size * abscissa
    return float(np.abs(left - np.median(left)).mean())


def _abscissa(column: LotColumn, against: Against) -> tuple[Floats, list[int]]:
    """Return the place of each instrument by serial number, the date [years] or the temperature [°C].

    Also returns the numbers of the instruments that tell it.
    """
    abscissa, members = [], []
    for k, member in enumerate(column.members):
        at = {"serial": float(k), "date": _year_of(member), "temperature": member.temperature}[against]
        if at is not None:
            abscissa.append(at)
            members.append(k)
    return np.array(abscissa), members


def _step_of(column: LotColumn) -> LotTrend | None:
    """Return the surest step of a parameter at a serial number, by the sum of ranks; None for too few instruments."""
    count = len(column.members)
    if count < 2 * LEAST_GROUP:
        return None
    ranks = scipy.stats.rankdata(column.estimates)
    sizes = np.arange(1, count)
    sums = np.cumsum(ranks)[:-1]
    deviations = np.sqrt(sizes * (count - sizes) * (count + 1) / 12.0)
    scores = np.abs(sums - sizes * (count + 1) / 2.0) / deviations
    allowed = slice(LEAST_GROUP - 1, count - LEAST_GROUP)
    surest = int(np.argmax(scores[allowed])) + LEAST_GROUP

    def distances(at: int) -> float:
        """Return the sum of distances from the medians before and after a place."""
        parts = column.estimates[:at], column.estimates[at:]
        return float(sum(np.abs(part - np.median(part)).sum() for part in parts))

    # The highest value before a step has a rank as of those after it: the values themselves place the step.
    near = range(max(LEAST_GROUP, surest - NEAR), min(count - LEAST_GROUP, surest + NEAR) + 1)
    at = min(near, key=distances)
    before, after = column.estimates[:at], column.estimates[at:]
    moved = np.sort(np.subtract.outer(after, before).ravel())
    width = 1.96 * math.sqrt(len(before) * len(after) * (count + 1) / 12.0)
    first = max(0, math.floor(len(moved) / 2.0 - width))
    size, low, high = float(np.median(moved)), float(moved[first]), float(moved[len(moved) - 1 - first])
    serial = column.members[at].serial
    return LotTrend(
        symbol=column.symbol,
        unit=column.unit,
        against="serial",
        size=size,
        low=low,
        high=high,
        since=serial,
        chance=min(1.0, 2.0 * count * float(scipy.stats.norm.sf(scores[surest - 1]))),
        sentence=f"since serial {serial}: {column.symbol} {_change(size, low, high, column.unit)}",
    )


def _trend_of(column: LotColumn, against: Against) -> LotTrend | None:
    """Return the trend of a parameter with date or temperature, by ranks; None for too few or equal ones."""
    abscissa, members = _abscissa(column, against)
    if len(members) < LEAST_INSTRUMENTS or abscissa.max() == abscissa.min():
        return None
    estimates = column.estimates[members]
    if estimates.max() == estimates.min():
        return None
    # Kendall's ranks have exact chances in small lots.
    _, chance = np.array(scipy.stats.kendalltau(abscissa, estimates), dtype=float).tolist()
    slope, _, low, high = np.array(scipy.stats.theilslopes(estimates, abscissa), dtype=float).tolist()
    per = "a year" if against == "date" else "a kelvin"
    return LotTrend(
        symbol=column.symbol,
        unit=column.unit,
        against=against,
        size=slope,
        low=low,
        high=high,
        since=None,
        chance=chance,
        sentence=f"with {against}: {column.symbol} {_change(slope, low, high, column.unit)} {per}",
    )


def _change(size: float, low: float, high: float, unit: str) -> str:
    """Return a change in words, with its 95 % interval."""
    word = "higher" if size > 0.0 else "lower"
    ends = sorted((abs(low), abs(high)))
    if low < 0.0 < high:
        ends[0] = 0.0
    return f"{word} by {digits(abs(size), 3)} {unit} (95 %: {digits(ends[0], 3)} to {digits(ends[1], 3)})"


def _year_of(member: Member) -> float | None:
    """Return the date of a record in years since 1970; None without a date."""
    if member.date is None:
        return None
    elapsed = moment(member.date, member.record) - datetime(1970, 1, 1)
    return elapsed.total_seconds() / 3600.0 / HOURS_A_YEAR
