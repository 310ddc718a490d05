"""What comes of a campaign's runs, and what got better or worse than in another one, beyond chance.

Quantiles, rates, confusion, sensitivity: one column is read at a time. Of two campaigns, runs of the same number,
parameters and file are pairs; else the two are samples of their own. Numbers: Wilcoxon's signed-rank test of pairs,
else Mann and Whitney's. What either happens or not (a run that fails, a text that is as it should be, a flag):
McNemar's exact test of pairs, else Fisher's. Holm's correction makes the probability that anything is called better or
worse by chance at most `CHANCE`, whatever the number of scalars.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import Field
from scipy import stats

from ..errors import InputError
from ..result import Result
from ..rounding import digits
from .file import Campaign, Computation
from .store import RUNS, Store, open_result

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
CONFIDENCE = 0.95
RESAMPLES = 200
"""Bootstrap samples behind the intervals of Sobol indices."""
MOST_MESSAGES = 20
MOST_RECORD_ROWS = 4_000_000
"""With so many rows of records no further file is read."""
CHANCE = 0.01
"""Probability that two campaigns that differ by chance alone are called different in anything."""
ROUNDING = 1e-9
"""Differences below this part of the scalar's usual size are rounding, not changes."""
FEWEST = 6
"""Fewer runs say nothing."""
Verdict = Literal["better", "worse", "changed", "same"]


class Results:
    """The columns of a campaign's data set."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._files = [store.scalars_path(k) for k in range(store.campaign.partitions)]
        missing = [path for path in self._files if not path.is_file()]
        if missing:
            raise InputError(
                f"{store.folder}: is not complete ({len(missing)} of {len(self._files)} files of runs are missing); "
                "trihedron campaign with --resume goes on with it"
            )
        self.schema: dict[str, pl.DataType] = dict(pl.read_parquet_schema(self._files[0]))

    def column(self, name: str) -> pl.Series:
        """A column, all runs in order."""
        return pl.scan_parquet(self._files, glob=False).select(name).collect()[name]

    def numbers(self, name: str) -> NDArray:
        """A column as doubles; NaN where a run has no value."""
        return self.column(name).cast(pl.Float64).fill_null(math.nan).to_numpy()

    def records(self) -> tuple[pl.LazyFrame, int] | None:
        """The rows of the records that were kept, of the first so many runs; None of what has no time, or no rows."""
        files, runs, rows = [], 0, 0
        for partition in range(self.store.campaign.partitions):
            if (path := self.store.records_path(partition)).is_file() and rows < MOST_RECORD_ROWS:
                files.append(path)
                rows += pl.scan_parquet(path, glob=False).select(pl.len()).collect().item()
                runs = self.store.campaign.runs_of(partition)[-1] + 1
        if not rows:
            return None
        table = pl.scan_parquet(files, glob=False)
        return (table, runs) if "time_s" in table.collect_schema() else None


class Failure(Result):
    """Runs that failed with the same message: how many, and the first of them."""

    message: str
    runs: int
    first_run: int


@dataclass(frozen=True)
class Cost:
    """What carrying out a campaign took: the runs that were made, and seconds from beginning to end.

    All workers together worked so long, by the clock and of their processors [s].
    """

    runs: int
    seconds: float
    worked_seconds: float
    cpu_seconds: float

    def __str__(self) -> str:
        text = f"{self.runs} runs in {digits(self.seconds)} s"
        if self.runs:
            worked, computed = digits(self.worked_seconds), digits(self.cpu_seconds)
            text += f"; the workers worked {worked} s, {computed} s of processor time"
        return text


class CampaignResult(Result):
    """What came of a campaign.

    Attributes
    ----------
    title, kind : str
    runs, failed : int
        how many runs there are, how many of them failed
    failures : list of Failure
        the messages, the most frequent first
    computed : list of dict
        each computation as the file asks for it, with its `result`
    folder : Path or None
        where the campaign is kept
    cost : Cost or None
        where it was carried out just now
    """

    schema_: Literal["trihedron.campaign-summary/1"] = Field(default="trihedron.campaign-summary/1", alias="schema")
    title: str
    kind: str
    runs: int
    failed: int
    failures: list[Failure]
    computed: list[dict[str, Any]]
    folder: Path | None = Field(default=None, exclude=True)
    cost: Cost | None = Field(default=None, exclude=True)

    def to_polars(self) -> pl.DataFrame:
        """A row for each run."""
        if self.folder is None:
            raise InputError("the folder of the campaign is not known")
        return pl.read_parquet(self.folder / RUNS / "*.parquet")


def summarise(store: Store) -> CampaignResult:
    """What the campaign's file asks for, and what failed."""
    results = Results(store)
    failed = results.column("failed")
    messages = Counter(failed.drop_nulls().to_list())
    frequent = sorted(messages.items(), key=lambda item: (-item[1], item[0]))[:MOST_MESSAGES]
    return CampaignResult(
        title=store.campaign.title,
        kind=store.campaign.kind,
        runs=store.campaign.runs,
        failed=len(failed) - failed.null_count(),
        failures=[
            Failure(message=message, runs=count, first_run=int((failed == message).arg_max() or 0))
            for message, count in frequent
        ],
        computed=[computed(item, results) for item in store.campaign.compute],
        folder=store.folder,
    )


def computed(item: Computation, results: Results) -> dict[str, Any]:
    """One computation and what comes of it."""
    if item.quantiles is not None:
        found = quantiles(results, item.quantiles, item.at or list(QUANTILES))
    elif item.rate is not None:
        found = rates(results, item)
    elif item.confusion is not None:
        found = confusion(results, item.confusion, str(item.of))
    else:
        found = sensitivity(results, item.sensitivity or [])
    return {**item.as_written(), "result": found}


def quantiles(results: Results, names: Sequence[str], at: Sequence[float]) -> dict[str, Any]:
    """Quantiles, mean and extremes of scalars, over the runs that have them."""
    found = {}
    for name in names:
        values = results.numbers(name)
        values = values[np.isfinite(values)]
        if not len(values):
            found[name] = {"runs": 0}
            continue
        at_parts = np.quantile(values, at).tolist()
        found[name] = {
            "runs": len(values),
            "mean": float(values.mean()),
            "std": float(values.std(ddof=1)) if len(values) > 1 else None,
            "least": float(values.min()),
            "largest": float(values.max()),
            "quantiles": [{"at": p, "value": v} for p, v in zip(at, at_parts, strict=True)],
        }
    return found


def rates(results: Results, item: Computation) -> list[dict[str, Any]]:
    """How often a scalar is one of some values, with Wilson's interval; over all, or over ranges of another scalar."""
    assert item.rate is not None
    column = results.column(item.rate)
    there = column.is_not_null().to_numpy()
    wanted = [str(v).lower() if isinstance(v, bool) else str(v) for v in item.values or ()]
    hits = column.cast(pl.String).is_in(wanted).fill_null(False).to_numpy()
    if item.against is None:
        return [rate(hits[there])]
    against = results.numbers(item.against)
    found = []
    for low, high in pairwise(item.edges or ()):
        own = there & (against >= low) & (against < high)
        found.append({"low": low, "high": high, **rate(hits[own])})
    return found


def rate(hits: NDArray) -> dict[str, Any]:
    """A rate with its interval by Wilson's score."""
    count, cases = int(hits.sum()), len(hits)
    if not cases:
        return {"cases": 0, "count": 0, "rate": None, "interval": None}
    interval = stats.binomtest(count, cases).proportion_ci(CONFIDENCE, method="wilson")
    return {"cases": cases, "count": count, "rate": count / cases, "interval": [interval.low, interval.high]}


def confusion(results: Results, named: str, of: str) -> dict[str, dict[str, int]]:
    """How often each value of one column goes with each value of another: true -> named -> count."""
    table: dict[str, Counter[str]] = {}
    pairs = zip(results.column(of).to_list(), results.column(named).to_list(), strict=True)
    for true, said in pairs:
        if true is not None and said is not None:
            table.setdefault(str(true), Counter())[str(said)] += 1
    return {true: dict(sorted(row.items())) for true, row in sorted(table.items())}


def sensitivity(results: Results, names: Sequence[str]) -> dict[str, Any]:
    """How scalars depend on the parameters: Sobol indices of a Saltelli sampling, else Spearman's rank correlations."""
    campaign = results.store.campaign
    if campaign.sampling.method == "saltelli":
        return {name: sobol_indices(campaign, results.numbers(name)) for name in names}
    numeric = [name for name in campaign.parameters if results.schema[name] == pl.Float64]
    columns = {name: results.numbers(name) for name in numeric}
    return {name: {"method": "rank-correlation", **correlations(columns, results.numbers(name))} for name in names}


def correlations(parameters: Mapping[str, NDArray], values: NDArray) -> dict[str, Any]:
    """Spearman's rank correlation with each parameter, and the p-value of none."""
    found = {}
    for name, column in parameters.items():
        there = np.isfinite(values) & np.isfinite(column)
        x, y = column[there], values[there]
        if len(x) < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
            found[name] = {"correlation": None, "p": None}
        else:
            result: Any = stats.spearmanr(x, y)
            found[name] = {"correlation": float(result.statistic), "p": float(result.pvalue)}
    return {"parameters": found}


def sobol_indices(campaign: Campaign, values: NDArray) -> dict[str, Any]:
    """First-order and total Sobol indices with bootstrapped intervals; rows in which a run failed are left out.

    Source: Saltelli et al., Computer Physics Communications 181 (2010), 259-270, as scipy.stats.sobol_indices has it.
    """
    names, n = list(campaign.distributions), campaign.sampling.points
    rows = values.reshape(len(names) + 2, n)
    whole = np.isfinite(rows).all(axis=0)
    # The estimators are means over rows, of which scipy wants a power of two.
    kept = 1 << max(int(whole.sum()).bit_length() - 1, 0)
    rows = rows[:, whole][:, :kept]
    left_out = {"method": "sobol", "rows": rows.shape[1], "rows_with_failures": int(n - whole.sum())}
    if rows.shape[1] < 2 or np.ptp(rows) == 0.0:
        return {**left_out, "parameters": {name: {"first": None, "total": None} for name in names}}
    first, total = _indices(rows)
    rng = np.random.default_rng(np.random.SeedSequence(campaign.seed))
    again = [_indices(rows[:, rng.integers(0, rows.shape[1], rows.shape[1])]) for _ in range(RESAMPLES)]
    tails = [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)]
    ends = np.quantile(np.array(again), tails, axis=0)
    return {
        **left_out,
        "parameters": {
            name: {
                "first": float(first[k]),
                "first_interval": ends[:, 0, k].tolist(),
                "total": float(total[k]),
                "total_interval": ends[:, 1, k].tolist(),
            }
            for k, name in enumerate(names)
        },
    }


def _indices(rows: NDArray) -> tuple[NDArray, NDArray]:
    """First-order and total indices from the values of the rows of A, B and each A with a column from B."""
    blocks: Any = {"f_A": rows[None, 0], "f_B": rows[None, 1], "f_AB": rows[2:, None]}
    found = stats.sobol_indices(func=blocks, n=rows.shape[1])
    return np.ravel(found.first_order), np.ravel(found.total_order)


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
    """Hold the campaign of a folder, which is judged, against another one.

    An InputError for a folder without a whole campaign, or campaigns of different kinds of runs.
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
