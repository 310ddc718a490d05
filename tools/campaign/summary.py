"""Results over a campaign's runs, and significant changes against another campaign.

Quantiles, rates, confusion, sensitivity: one column is read at a time. In a comparison, runs of the same number,
parameters and file are pairs; otherwise the two campaigns are independent samples. Tests of numbers: Wilcoxon's
signed-rank test of pairs, else Mann and Whitney's. Tests of events (a failed run, an expected text, a flag): McNemar's
exact test of pairs, else Fisher's. Holm's correction limits the probability of any false "better" or "worse" to
`CHANCE` for all scalars together.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import polars as pl
import scipy
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InputError, one_line
from ..quantity import Quantity
from ..result import Result
from ..rounding import digits
from .file import Campaign, Computation
from .store import RUNS, Store, open_result

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
CONFIDENCE = 0.95
RESAMPLES = 200
"""Number of bootstrap samples for the intervals of Sobol indices."""
MOST_MESSAGES = 20
MOST_RECORD_ROWS = 4_000_000
"""Number of rows of records after which no further file is read."""
CHANCE = 0.01
"""Probability that two campaigns that differ by chance alone differ significantly in anything."""
ROUNDING = 1e-9
"""Differences below this part of the scalar's usual size are rounding, not changes."""
FEWEST = 6
"""Smallest number of runs that can show a difference."""
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
                "trihedron campaign with continue with --resume with it"
            )
        try:
            self.schema: dict[str, pl.DataType] = dict(pl.read_parquet_schema(self._files[0]))
        except pl.exceptions.PolarsError as error:
            raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> InputError:
        """Return the refusal of runs that cannot be read."""
        return InputError(
            one_line(f"{self._files[0].parent}: its runs cannot be read ({error}); run the campaign again")
        )

    def column(self, name: str) -> pl.Series:
        """Return a column, all runs in order."""
        try:
            return pl.scan_parquet(self._files, glob=False).select(name).collect()[name]
        except pl.exceptions.PolarsError as error:
            raise self._damaged(error) from error

    def numbers(self, name: str) -> NDArray:
        """Return a column as doubles; NaN if a run has no value."""
        return self.column(name).cast(pl.Float64).fill_null(math.nan).to_numpy()

    def records(self) -> tuple[pl.LazyFrame, int] | None:
        """Return the rows of the kept records of the first runs, and their number; None without a time column or
        rows."""
        files, runs, rows = [], 0, 0
        for partition in range(self.store.campaign.partitions):
            if (path := self.store.records_path(partition)).is_file() and rows < MOST_RECORD_ROWS:
                files.append(path)
                rows += pl.scan_parquet(path, glob=False).select(pl.len()).collect().item()
                runs = self.store.campaign.runs_of(partition)[-1] + 1
        if not rows:
            return None
        table = pl.scan_parquet(files, glob=False)
        if "time_s" not in table.collect_schema():
            return None
        return table, runs


class Failure(Result):
    """Runs that failed with the same message: their number, and the first of them."""

    message: Annotated[str, Quantity("message")]
    runs: Annotated[int, Quantity("runs")]
    first_run: Annotated[int, Quantity("first run")]


@dataclass(frozen=True)
class Cost:
    """Cost of a campaign: the runs that were made, and the total time [s].

    The total times of all workers are wall-clock and processor times [s].
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
    """The result of a campaign.

    Attributes
    ----------
    title, kind : str
        title of the campaign, kind of its runs
    runs, failed : int
        number of runs, number of failed runs
    failures : list of Failure
        the messages, the most frequent first
    computed : list of dict
        each computation as in the file, with its `result`
    folder : Path or None
        folder of the campaign
    cost : Cost or None
        cost, if this process ran it
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
        """Return a row for each run."""
        if self.folder is None:
            raise InputError("the folder of the campaign is not known")
        return pl.read_parquet(self.folder / RUNS / "*.parquet")


def summarise(store: Store) -> CampaignResult:
    """Return the results of the file's computations, and the failures."""
    results = Results(store)
    failed = results.column("failed")
    counted = Counter(failed.drop_nulls().to_list())
    failures = []
    for message, count in sorted(counted.items(), key=lambda pair: (-pair[1], pair[0]))[:MOST_MESSAGES]:
        first_run = int((failed == message).arg_max() or 0)
        failures.append(Failure(message=message, runs=count, first_run=first_run))
    computed = []
    for computation in store.campaign.compute:
        computed.append({**computation.as_written(), "result": computation_result(computation, results)})
    return CampaignResult(
        title=store.campaign.title,
        kind=store.campaign.kind,
        runs=store.campaign.runs,
        failed=counted.total(),
        failures=failures,
        computed=computed,
        folder=store.folder,
    )


def computation_result(computation: Computation, results: Results) -> Any:
    """Return the result of a computation."""
    if computation.quantiles is not None:
        at = computation.at or list(QUANTILES)
        return {name: quantiles(results.numbers(name), at) for name in computation.quantiles}
    if computation.rate is not None:
        return rates(results, computation, computation.rate)
    if computation.confusion is not None:
        return confusion_of_columns(results, computation.confusion, str(computation.of))
    return sensitivity(results, computation.sensitivity or [])


def quantiles(values: NDArray, at: Sequence[float]) -> dict[str, Any]:
    """Return quantiles, mean and extremes of a scalar, over the runs that have it."""
    values = values[np.isfinite(values)]
    if not len(values):
        return {"runs": 0}
    below = np.quantile(values, at).tolist()
    return {
        "runs": len(values),
        "mean": float(values.mean()),
        "std": float(values.std(ddof=1)) if len(values) > 1 else None,
        "least": float(values.min()),
        "largest": float(values.max()),
        "quantiles": [{"at": part, "value": value} for part, value in zip(at, below, strict=True)],
    }


def rates(results: Results, computation: Computation, name: str) -> list[dict[str, Any]]:
    """Return the rates of some values of a scalar, with Wilson's interval; over all, or over ranges of another
    scalar."""
    column = results.column(name)
    has_value = column.is_not_null().to_numpy()
    counted = []
    for value in computation.values or ():
        text = str(value)
        if isinstance(value, bool):
            text = text.lower()
        counted.append(text)
    hits = column.cast(pl.String).is_in(counted).fill_null(False).to_numpy()
    if computation.against is None:
        return [rate(hits[has_value])]
    against = results.numbers(computation.against)
    ranges = []
    for low, high in pairwise(computation.edges or ()):
        within = has_value & (against >= low) & (against < high)
        ranges.append({"low": low, "high": high, **rate(hits[within])})
    return ranges


def rate(hits: NDArray) -> dict[str, Any]:
    """Return a rate with its interval by Wilson's score."""
    count, cases = int(hits.sum()), len(hits)
    if not cases:
        return {"cases": 0, "count": 0, "rate": None, "interval": None}
    interval = scipy.stats.binomtest(count, cases).proportion_ci(CONFIDENCE, method="wilson")
    return {"cases": cases, "count": count, "rate": count / cases, "interval": [interval.low, interval.high]}


def confusion_of_columns(results: Results, name: str, of: str) -> dict[str, dict[str, int]]:
    """Return the counts of each pair of values of two columns: true -> named -> count."""
    table: dict[str, Counter[str]] = {}
    for true, value in zip(results.column(of).to_list(), results.column(name).to_list(), strict=True):
        if true is not None and value is not None:
            table.setdefault(str(true), Counter())[str(value)] += 1
    return {true: dict(sorted(row.items())) for true, row in sorted(table.items())}


def sensitivity(results: Results, names: Sequence[str]) -> dict[str, Any]:
    """Return sensitivities to the parameters: Sobol indices of a Saltelli sampling, else Spearman's rank
    correlations."""
    campaign = results.store.campaign
    if campaign.sampling.method == "saltelli":
        return {name: sobol_indices(campaign, results.numbers(name)) for name in names}
    parameters = {}
    for name in campaign.parameters:
        if results.schema[name] == pl.Float64:
            parameters[name] = results.numbers(name)
    return {name: correlations(parameters, results.numbers(name)) for name in names}


def correlations(parameters: Mapping[str, NDArray], values: NDArray) -> dict[str, Any]:
    """Return Spearman's rank correlation with each parameter, and its p-value."""
    by_parameter: dict[str, dict[str, float | None]] = {}
    for name, column in parameters.items():
        finite = np.isfinite(values) & np.isfinite(column)
        x, y = column[finite], values[finite]
        by_parameter[name] = {"correlation": None, "p": None}
        if len(x) >= 3 and np.ptp(x) != 0.0 and np.ptp(y) != 0.0:
            ranked: Any = scipy.stats.spearmanr(x, y)
            by_parameter[name] = {"correlation": float(ranked.statistic), "p": float(ranked.pvalue)}
    return {"method": "rank-correlation", "parameters": by_parameter}


def sobol_indices(campaign: Campaign, values: NDArray) -> dict[str, Any]:
    """Return first-order and total Sobol indices with bootstrapped intervals; rows with a failed run are left out.

    Source: Saltelli et al., Computer Physics Communications 181 (2010), 259-270, as in scipy.stats.sobol_indices.
    """
    names, points = list(campaign.distributions), campaign.sampling.points
    rows = values.reshape(len(names) + 2, points)
    complete = np.isfinite(rows).all(axis=0)
    # The estimators are means over rows; scipy requires a power of two of them.
    count = 1 << max(int(complete.sum()).bit_length() - 1, 0)
    rows = rows[:, complete][:, :count]
    by_parameter: dict[str, dict[str, Any]] = {name: {"first": None, "total": None} for name in names}
    if rows.shape[1] >= 2 and np.ptp(rows) != 0.0:
        indices = _indices(rows)
        rng = np.random.default_rng(np.random.SeedSequence(campaign.seed))
        resampled = [_indices(rows[:, rng.integers(0, rows.shape[1], rows.shape[1])]) for _ in range(RESAMPLES)]
        tails = [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)]
        ends = np.quantile(np.array(resampled), tails, axis=0)
        for k, name in enumerate(names):
            by_parameter[name] = {}
            for kind, word in enumerate(("first", "total")):
                by_parameter[name][word] = float(indices[kind][k])
                by_parameter[name][f"{word}_interval"] = ends[:, kind, k].tolist()
    return {
        "method": "sobol",
        "rows": rows.shape[1],
        "rows_with_failures": int(points - complete.sum()),
        "parameters": by_parameter,
    }


def _indices(rows: NDArray) -> tuple[NDArray, NDArray]:
    """Return first-order and total indices from the values of the rows of A, B and each A with a column from B."""
    blocks: Any = {"f_A": rows[None, 0], "f_B": rows[None, 1], "f_AB": rows[2:, None]}
    indices = scipy.stats.sobol_indices(func=blocks, n=rows.shape[1])
    return np.ravel(indices.first_order), np.ravel(indices.total_order)


class ScalarChange(Result):
    """The change of one scalar.

    Attributes
    ----------
    name : str
        name of the scalar
    what : str
        compared quantity: "median", or a rate of the runs
    before, after : float or None
        its value in the other campaign, and in this one
    p : float or None
        probability of this difference by chance, corrected for the number of scalars; None if it is unknown
    verdict : str
        "better", "worse", "changed" (beyond chance, without a better direction), or "same": no change beyond chance
    runs : int
        number of runs in the comparison
    """

    name: Annotated[str, Quantity("scalar")]
    what: Annotated[str, Quantity("what")]
    before: Annotated[float | None, Quantity("before", "", "nearest", 6)]
    after: Annotated[float | None, Quantity("after", "", "nearest", 6)]
    p: Annotated[float | None, Quantity("p", "", "nearest", 2)]
    verdict: Annotated[Verdict, Quantity("verdict")] = "same"
    runs: Annotated[int, Quantity("runs")]
    direction: int = Field(default=0, exclude=True)
    """+1 if the scalar grew, −1 if it fell."""
    better: str | None = Field(default=None, exclude=True)
    """Better direction: "higher" or "lower"."""


class Comparison(Result):
    """All changes.

    Attributes
    ----------
    paired : bool
        True if runs of the same number were compared
    chance : float
        probability that two campaigns that differ by chance alone differ significantly in anything
    better, worse : int
        number of better and of worse scalars
    changes : list of ScalarChange
        change of each scalar
    """

    schema_: Literal["trihedron.campaign-comparison/1"] = Field(
        default="trihedron.campaign-comparison/1", alias="schema"
    )
    paired: bool
    chance: float
    better: int
    worse: int
    changes: list[ScalarChange]

    def of(self, verdict: Verdict) -> list[ScalarChange]:
        """Return the changes of one verdict."""
        return [change for change in self.changes if change.verdict == verdict]


def compare_campaigns(folder: Path, other: Path) -> Comparison:
    """Compare the campaign of a folder, which is judged, with another one.

    Raises InputError for a folder without a whole campaign, and for campaigns of different kinds of runs.
    """
    (store, manifest), (store_before, _) = open_result(folder), open_result(other)
    kind, kind_before = store.campaign.kind, store_before.campaign.kind
    if kind != kind_before:
        raise InputError(f"--against {other}: its runs are of the kind {kind_before}, those of {folder} {kind}")
    now, before = Results(store), Results(store_before)
    pairs = _same_runs(now, before)
    what = "part of the runs that failed"
    tests = [_happens("failed", what, _failed(before), _failed(now), pairs, "lower")]
    for name, output in manifest.get("outputs", {}).items():
        if name not in now.schema or name not in before.schema or now.schema[name] != before.schema[name]:
            continue
        better, good = output.get("better"), output.get("good") or []
        if now.schema[name].is_numeric():
            tests.append(_numbers(name, before.numbers(name), now.numbers(name), pairs, better))
        elif now.schema[name] == pl.Boolean:
            what = "part of the runs in which it is true"
            tests.append(_happens(name, what, before.numbers(name), now.numbers(name), pairs, better))
        elif good:
            what = f"part of the runs in which it is {' or '.join(good)}"
            tests.append(_happens(name, what, _is(before, name, good), _is(now, name, good), pairs, "higher"))
    changes = _corrected(tests)
    verdicts = Counter(change.verdict for change in changes)
    return Comparison(paired=pairs, chance=CHANCE, better=verdicts["better"], worse=verdicts["worse"], changes=changes)


def _same_runs(now: Results, before: Results) -> bool:
    """Return True if run k of both has the same parameters and the same random errors."""
    a, b = now.store.campaign, before.store.campaign
    if (a.runs, a.seed, list(a.parameters)) != (b.runs, b.seed, list(b.parameters)):
        return False
    if (a.sampling.method == "saltelli") != (b.sampling.method == "saltelli"):
        return False
    return all(now.column(name).equals(before.column(name), null_equal=True) for name in a.parameters)


def _failed(results: Results) -> NDArray:
    return results.column("failed").is_not_null().to_numpy().astype(float)


def _is(results: Results, name: str, good: Sequence[str]) -> NDArray:
    """Return 1 for an expected text, 0 for another one, NaN for none."""
    return results.column(name).is_in(list(good)).cast(pl.Float64).fill_null(math.nan).to_numpy()


def _finite(before: NDArray, now: NDArray, *, pairs: bool) -> tuple[NDArray, NDArray]:
    """Return the finite values; of pairs those with two finite values."""
    finite, finite_now = np.isfinite(before), np.isfinite(now)
    if pairs:
        finite = finite_now = finite_now & finite
    return before[finite], now[finite_now]


def _happens(name: str, what: str, before: NDArray, now: NDArray, pairs: bool, better: str | None) -> ScalarChange:
    """Compare how often an event occurs; arrays of 0, 1 and NaN."""
    before, now = _finite(before, now, pairs=pairs)
    part_before, part = _number(before, np.mean), _number(now, np.mean)
    if pairs:
        up, down = int(((now == 1.0) & (before == 0.0)).sum()), int(((now == 0.0) & (before == 1.0)).sum())
        p = float(scipy.stats.binomtest(up, up + down).pvalue) if up + down else 1.0
        direction = int(np.sign(up - down))
    else:
        table = [[now.sum(), len(now) - now.sum()], [before.sum(), len(before) - before.sum()]]
        p = float(np.asarray(scipy.stats.fisher_exact(np.array(table, dtype=int))[1]))
        direction = 0
        if part is not None and part_before is not None:
            direction = int(np.sign(part - part_before))
    return ScalarChange(
        name=name,
        what=what,
        before=part_before,
        after=part,
        p=p if min(len(before), len(now)) >= FEWEST else None,
        runs=len(now),
        direction=direction,
        better=better,
    )


def _numbers(name: str, before: NDArray, now: NDArray, pairs: bool, better: str | None) -> ScalarChange:
    """Compare the values of a scalar."""
    before, now = _finite(before, now, pairs=pairs)
    p, direction = None, 0
    if pairs:
        change = now - before
        change[np.abs(change) <= ROUNDING * _scale(before, now)] = 0.0
        moved = change[change != 0.0]
        if len(moved):
            direction = int(np.sign(np.median(moved))) or int(np.sign(moved.mean()))
        if len(change) >= FEWEST:
            p = 1.0
        if len(moved) >= FEWEST:
            ranked: Any = scipy.stats.wilcoxon(moved)
            p = float(ranked.pvalue)
    elif min(len(before), len(now)) >= FEWEST:
        ranked = scipy.stats.mannwhitneyu(now, before, method="asymptotic")
        p = 1.0 if np.ptp(np.concatenate((now, before))) == 0.0 else float(ranked.pvalue)
        direction = int(np.sign(ranked.statistic - 0.5 * len(now) * len(before)))
    return ScalarChange(
        name=name,
        what="median",
        before=_number(before, np.median),
        after=_number(now, np.median),
        p=p,
        runs=len(now),
        direction=direction,
        better=better,
    )


def _scale(before: NDArray, now: NDArray) -> float:
    sizes = np.abs(np.concatenate((before, now)))
    sizes = sizes[sizes > 0.0]
    if not len(sizes):
        return 0.0
    return float(np.median(sizes))


def _number(values: NDArray, statistic: Callable[[NDArray], Any]) -> float | None:
    if not len(values):
        return None
    return float(statistic(values))


def _corrected(tests: Sequence[ScalarChange]) -> list[ScalarChange]:
    """Apply Holm's correction over all testable scalars, and return each with its verdict."""
    tested = []
    for k, test in enumerate(tests):
        if test.p is not None:
            tested.append(k)
    tested.sort(key=lambda k: (tests[k].p, k))
    changes, largest = list(tests), 0.0
    for rank, k in enumerate(tested):
        test = tests[k]
        largest = max(largest, min(1.0, (test.p or 0.0) * (len(tested) - rank)))
        verdict: Verdict = "same"
        if largest <= CHANCE and test.direction:
            verdict = "changed"
            if test.better is not None:
                verdict = "worse"
                if (test.better == "higher") == (test.direction > 0):
                    verdict = "better"
        changes[k] = test.model_copy(update={"p": largest, "verdict": verdict})
    return changes
