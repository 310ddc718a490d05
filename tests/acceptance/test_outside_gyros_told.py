"""Carried records with laws that are in no same_quantity: nothing wrong is proven, no law is named alone.

`TRIHEDRON_SUITE_SHARE` runs a part of them, `TRIHEDRON_SUITE_SEED` others.
"""

import os
import sys
from pathlib import Path

import pytest

from generator.carried import outside_gyro
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.records import StrapdownRecord, read_record

pytestmark = pytest.mark.acceptance
SHARE = float(os.environ.get("TRIHEDRON_SUITE_SHARE", "1"))
SEED = int(os.environ.get("TRIHEDRON_SUITE_SEED", "7"))
CASES = 24


def test_outside_the_catalogue_of_gyros(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    falsified = right = wrong = alone = predicted = 0
    for index in range(max(1, round(SHARE * CASES))):
        case = outside_gyro(tmp_path / "s.strapdown.csv", SEED, index)
        result = diagnose(read_record(case.path, StrapdownRecord))
        assert isinstance(result, Diagnosis)
        falsified += result.verdict != "consistent"
        alone += result.verdict == "explained" and not result.caution
        if (proven := result.proven) is not None:
            same_quantity = proven.quantity is None or case.quantity in (proven.on, *proven.same)
            wrong += proven.place != case.place or not same_quantity
            right += proven.quantity is not None and proven.place == case.place and same_quantity
        gain = result.extension.gain if result.extension is not None else None
        predicted += gain is not None and gain.held_out_rms_after < 0.5 * gain.held_out_rms_before
        with capsys.disabled():
            where = (proven.place, proven.on, proven.not_excluded) if proven is not None else None
            print(
                f"{index} {case.shape} {case.place} {case.quantity} {case.size:.1f}: {result.verdict} {result.level} "
                f"proven {where}, {[cause.effect for cause in result.causes]}, alone {alone}, wrong {wrong}",
                file=sys.stderr,
                flush=True,
            )
    with capsys.disabled():
        print(
            f"{falsified} falsified, {right} right, {wrong} wrong, {alone} alone, {predicted} held out", file=sys.stderr
        )
    assert wrong == 0
    assert alone == 0
    assert right >= 0.5 * falsified
    assert predicted >= 0.6 * right
