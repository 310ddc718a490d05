"""Suites of hidden noise: one process, two, and none, of drawn sizes, for each of six channels."""

import pytest

from hidden_noise import HiddenNoise, answered, counted, drawn

pytestmark = pytest.mark.acceptance
RECORDS = 20


@pytest.mark.parametrize(("count", "least_right"), [(1, 0.95), (2, 0.9)])
def test_hidden_processes_are_named(count, least_right, tmp_path):
    right = wrong = 0
    for seed in range(RECORDS):
        secret = drawn(1000 * count + seed, count)
        of_one = counted(secret, answered(secret, 7000 * count + seed, tmp_path))
        right += of_one[0]
        wrong += of_one[1]
    print(count, right, wrong, 6 * RECORDS)
    assert right >= least_right * 6 * RECORDS
    assert wrong <= 0.01 * 6 * RECORDS


def test_nothing_is_named_in_clean_records(tmp_path):
    named = 0
    for seed in range(2 * RECORDS):
        named += sum(
            one.verdict != "consistent" for one in answered(HiddenNoise({}, {}), 90_000 + seed, tmp_path).against
        )
    print(named)
    assert named <= 1
