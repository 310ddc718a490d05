"""A run that is a case of the hidden-effect suite; the same cases as `trihedron hidden` draws."""

import json
from collections.abc import Mapping

import numpy as np
import polars as pl

from ..errors import InputError
from ..trials.draw import BenchOptions, draw_bench_case
from ..trials.measure import measure_bench
from ..trials.outcome import diagnosed, judged
from ..trials.suite import named_suite
from .calibration_runs import record_table
from .design import Value
from .file import Campaign
from .kinds import Output, Result
from .settings import HiddenSetting


class HiddenRuns:
    """Cases of the suite: run i is case i of the seed."""

    def __init__(self, campaign: Campaign, setting: HiddenSetting) -> None:
        self.keep = campaign.keep
        if setting.suite is not None:
            try:
                named = named_suite(setting.suite)
            except InputError as error:
                raise InputError(f"hidden.suite: {str(error).removeprefix('--suite ')}") from error
            self.options, self.seed = named.options, named.seed
        else:
            size = setting.size
            self.options = BenchOptions(setting.mode, tuple(setting.effects), setting.positions, setting.noise, size)
            self.seed = campaign.seed
        self.outputs = {
            "hidden": Output(pl.String),
            "named": Output(pl.String),
            "verdict": Output(pl.String),
            "outcome": Output(pl.String, good=("right", "candidate")),
            "relative_size": Output(pl.Float64),
            "radius": Output(pl.Float64),
            "inside": Output(pl.Boolean, "higher"),
            "size_error": Output(pl.Float64),
            "positions": Output(pl.Int64),
            "redrawn": Output(pl.Int64),
        }

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> Result:
        """Draw, measure and diagnose a case; the campaign's own seeds play no part in it."""
        case = draw_bench_case(self.options, self.seed, number)
        record = measure_bench(case)
        found = diagnosed(case, record)
        outcome = judged(case, found)
        scalars: dict[str, Value | int | None] = {
            "hidden": outcome.hidden_words,
            "named": outcome.named_words,
            "verdict": outcome.verdict,
            "outcome": outcome.outcome,
            "relative_size": case.hidden[0].relative_size if len(case.hidden) == 1 else None,
            "radius": outcome.radius,
            "inside": outcome.inside,
            "size_error": outcome.size_errors[0] if len(outcome.size_errors) == 1 else None,
            "positions": len(case.bench.alpha),
            "redrawn": case.redrawn,
        }
        told = None
        if self.keep.diagnosis:
            told = json.dumps({**outcome.to_json(), "diagnosis": found.to_json()}, ensure_ascii=False, allow_nan=False)
        return Result(scalars, record_table(record) if self.keep.record else None, told)
