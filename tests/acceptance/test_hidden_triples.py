"""Three records of one instrument, an effect in all and one of a run alone: both are attributed, and none wrongly.

`TRIHEDRON_TRIPLES` says how many, `TRIHEDRON_TRIPLES_FROM` by which seed; half as many again have no secret.
"""

import os
from collections.abc import Mapping

import pytest

from trihedron.tools.trials import Suite, named_suite, run_suite

pytestmark = pytest.mark.acceptance
COUNT, SEED = int(os.environ.get("TRIHEDRON_TRIPLES", "20")), os.environ.get("TRIHEDRON_TRIPLES_FROM")
RIGHT, WRONG = 0.95, 0.01
LET_GO = 1
"""Of few triples one is no part of a hundred."""


def run(name: str, count: int, capsys: pytest.CaptureFixture[str]) -> Suite:
    suite = named_suite(name)
    process = run_suite(suite.options, count, suite.seed if SEED is None else int(SEED))
    with capsys.disabled():
        print(f"\n{process}")
    return process


def wrong(outcomes: Mapping[str, int]) -> int:
    return outcomes.get("wrong", 0) + outcomes.get("part", 0)


def test_what_is_the_instruments_and_what_a_runs_is_attributed_rightly(capsys):
    process = run("triples", COUNT, capsys)
    assert wrong(process.outcomes) <= WRONG * COUNT
    assert process.outcomes["right"] >= RIGHT * COUNT - LET_GO
    assert [entry.case for entry in process.results if entry.inside is False] == []


def test_of_clean_triples_nothing_is_named(capsys):
    count = max(1, COUNT // 2)
    assert run("clean-triples", count, capsys).outcomes == {"right": count}
