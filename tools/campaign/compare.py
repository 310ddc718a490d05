"""Two campaigns held against each other: what got better, what got worse, beyond chance.

Runs of the same number, parameters and file are pairs; else the two are samples of their own. Numbers: Wilcoxon's
signed-rank test of pairs, else Mann and Whitney's. What either happens or not (a run that fails, a text that is as it
should be, a flag): McNemar's exact test of pairs, else Fisher's. Holm's correction makes the probability that anything
is called better or worse by chance at most `CHANCE`, whatever the number of scalars.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import Field
from scipy import stats

from ..errors import InputError
from ..result import Result
from .store import open_result
from .summary import Results

CHANCE = 0.01
"""Probability that two campaigns that differ by chance alone are called different in anything."""
ROUNDING = 1e-9
"""Differences below this part of the scalar's usual size are rounding, not changes."""
FEWEST = 6
"""Fewer runs say nothing."""
Verdict = Literal["better", "worse", "changed", "same"]


class Change(Result):
    """What became of one scalar.

    Attributes
    ----------
    name : str
    what : str
        what is compared: "median", or the part of the runs that are so
    before, after : float or None
        its value in the campaign compared with, and in this one
    p : float or None
        probability of such a difference by chance, corrected for the number of scalars; None where it cannot be told
    verdict : str
        "better", "worse", "changed" (beyond chance, where neither way is better), or "same": no change beyond chance
    runs : int
        how many runs this rests on
    """

    name: str
    what: str
    before: float | None
    after: float | None
    p: float | None
    verdict: Verdict = "same"
    runs: int
    direction: int = Field(default=0, exclude=True)
    """+1 where the scalar grew, −1 where it fell."""
    better: str | None = Field(default=None, exclude=True)
    """Which way is better: "higher" or "lower"."""


class Comparison(Result):
    """All changes.

    Attributes
    ----------
    paired : bool
        whether runs of the same number were held against each other
    chance : float
        probability that two campaigns that differ by chance alone are called different in anything
    better, worse : int
        how many scalars got so
    changes : list of Change
    """

    schema_: Literal["trihedron.campaign-comparison/1"] = Field(
        default="trihedron.campaign-comparison/1", alias="schema"
    )
    paired: bool
    chance: float
    better: int
    worse: int
    changes: list[Change]

    def of(self, verdict: Verdict) -> list[Change]:
        """Changes of one kind."""
        return [change for change in self.changes if change.verdict == verdict]


def compare(folder: Path, other: Path) -> Comparison:
    """Hold a campaign against another one.

    Parameters
    ----------
    folder : Path
        of the campaign that is judged
    other : Path
        of the one that it is compared with

    Raises
    ------
    InputError
        a folder without a whole campaign, or campaigns of different kinds of runs
    """
    (store, manifest), (store_before, _) = open_result(folder), open_result(other)
    campaign, campaign_before = store.campaign, store_before.campaign
    if campaign.kind != campaign_before.kind:
        raise InputError(
            f"--against {other}: its runs are of the kind {campaign_before.kind}, those of {folder} {campaign.kind}"
        )
    now, before = Results(store), Results(store_before)
    paired = _same_runs(now, before)
    outputs: dict[str, dict[str, Any]] = manifest.get("outputs", {})
    tests = [_happens("failed", "part of the runs that failed", _failed(before), _failed(now), "lower", paired)]
    for name, output in outputs.items():
        if name not in now.schema or name not in before.schema or now.schema[name] != before.schema[name]:
            continue
        better, good = output.get("better"), output.get("good") or []
        if now.schema[name].is_numeric():
            tests.append(_numbers(name, before.numbers(name), now.numbers(name), better, paired))
        elif now.schema[name] == pl.Boolean:
            what = "part of the runs in which it is true"
            tests.append(_happens(name, what, before.numbers(name), now.numbers(name), better, paired))
        elif good:
            what = f"part of the runs in which it is {' or '.join(good)}"
            tests.append(_happens(name, what, _is(before, name, good), _is(now, name, good), "higher", paired))
    changes = _corrected(tests)
    better, worse = (sum(change.verdict == verdict for change in changes) for verdict in ("better", "worse"))
    return Comparison(paired=paired, chance=CHANCE, better=better, worse=worse, changes=changes)


def _same_runs(now: Results, before: Results) -> bool:
    """Whether run k of both has the same parameters and the same random errors."""
    a, b = now.store.campaign, before.store.campaign
    if (a.runs, a.seed, a.sampling.method == "saltelli") != (b.runs, b.seed, b.sampling.method == "saltelli"):
        return False
    if list(a.parameters) != list(b.parameters):
        return False
    return all(now.column(name).equals(before.column(name), null_equal=True) for name in a.parameters)


def _failed(results: Results) -> NDArray:
    return results.column("failed").is_not_null().to_numpy().astype(float)


def _is(results: Results, name: str, good: Sequence[str]) -> NDArray:
    """1 where a text is as it should be, 0 where it is not, NaN where there is none."""
    column = results.column(name)
    return column.is_in(list(good)).cast(pl.Float64).fill_null(math.nan).to_numpy()


def _compared(before: NDArray, now: NDArray, *, paired: bool) -> tuple[NDArray, NDArray]:
    """The values that are there: of pairs where both are."""
    there, there_now = np.isfinite(before), np.isfinite(now)
    if paired:
        there = there_now = there & there_now
    return before[there], now[there_now]


def _happens(name: str, what: str, before: NDArray, now: NDArray, better: str | None, paired: bool) -> Change:
    """Compare how often something is so; arrays of 0, 1 and NaN."""
    before, now = _compared(before, now, paired=paired)
    if paired:
        up, down = int(((now == 1.0) & (before == 0.0)).sum()), int(((now == 0.0) & (before == 1.0)).sum())
        p = float(stats.binomtest(up, up + down).pvalue) if up + down else 1.0
        direction = int(np.sign(up - down))
    else:
        table = [[now.sum(), len(now) - now.sum()], [before.sum(), len(before) - before.sum()]]
        p = float(np.asarray(stats.fisher_exact(np.array(table, dtype=int))[1]))
        direction = int(np.sign(_mean(now) - _mean(before)))
    sizes = {"before": _number(_mean(before)), "after": _number(_mean(now)), "runs": len(now)}
    enough = min(len(before), len(now)) >= FEWEST
    return Change(name=name, what=what, p=p if enough else None, direction=direction, better=better, **sizes)


def _numbers(name: str, before: NDArray, now: NDArray, better: str | None, paired: bool) -> Change:
    """Compare the values of a scalar."""
    p: float | None = None
    direction = 0
    before, now = _compared(before, now, paired=paired)
    if paired:
        change = now - before
        change[np.abs(change) <= ROUNDING * _scale(before, now)] = 0.0
        moved = change[change != 0.0]
        if len(change) >= FEWEST:
            ranked: Any = stats.wilcoxon(moved) if len(moved) >= FEWEST else None
            p = 1.0 if ranked is None else float(ranked.pvalue)
        if len(moved):
            direction = int(np.sign(np.median(moved))) or int(np.sign(moved.mean()))
    elif min(len(before), len(now)) >= FEWEST:
        result: Any = stats.mannwhitneyu(now, before, method="asymptotic")
        p = 1.0 if np.ptp(np.concatenate((now, before))) == 0.0 else float(result.pvalue)
        direction = int(np.sign(result.statistic - 0.5 * len(now) * len(before)))
    middle = [_number(float(np.median(x)) if len(x) else math.nan) for x in (before, now)]
    sizes = {"before": middle[0], "after": middle[1], "runs": len(now)}
    return Change(name=name, what="median", p=p, direction=direction, better=better, **sizes)


def _scale(before: NDArray, now: NDArray) -> float:
    both = np.abs(np.concatenate((before, now)))
    return float(np.median(both[both > 0.0])) if (both > 0.0).any() else 0.0


def _mean(values: NDArray) -> float:
    return float(values.mean()) if len(values) else math.nan


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _corrected(tests: Sequence[Change]) -> list[Change]:
    """Holm's correction over all scalars that can be told, and what it leaves of each."""
    told = sorted((test.p, k) for k, test in enumerate(tests) if test.p is not None)
    changes, largest = list(tests), 0.0
    for rank, (p, k) in enumerate(told):
        largest = max(largest, min(1.0, p * (len(told) - rank)))
        verdict: Verdict = "same"
        if largest <= CHANCE and tests[k].direction:
            higher = "higher" if tests[k].direction > 0 else "lower"
            verdict = "changed" if tests[k].better is None else "better" if tests[k].better == higher else "worse"
        changes[k] = tests[k].model_copy(update={"p": largest, "verdict": verdict})
    return changes
