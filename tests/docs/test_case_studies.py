"""The measured records: named and unnamed effects; the pages of the case studies agree with the records."""

import os
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from case_studies import BROAD, MPU, XSENS, main
from record_files import measured
from trihedron.tools.diagnosis import Diagnosis, diagnose

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("TRIHEDRON_DATA", ROOT / ".." / "shared" / "data"))


@pytest.mark.parametrize("name", [*(pytest.param(name, marks=pytest.mark.acceptance) for name in MPU[:2]), *MPU[2:]])
def test_no_effect_is_named_in_the_logs_of_the_mpu9150(name):
    result = diagnose(measured(name), rerun=False)
    assert result.verdict == "consistent"
    assert result.causes == ()
    assert "no effect is named" in " ".join(str(result).split())
    assert {entry["effect"] for entry in result.excluded or ()} >= {"gyro-bias-drift", "gyro-g-sensitivity"}


def latency_first(diagnosed: Diagnosis) -> None:
    """Latency helps most over windows of up to 2 s; errors beyond noise and cameras at rest object to any cause."""
    assert (diagnosed.verdict, diagnosed.causes) == ("unexplained", ())
    for length in (diagnosed.lengths or ())[:3]:
        assert length.order is not None
        assert [step.effect for step in length.order.steps][:2] == ["latency", "gyro-scale-misalignment"]
        assert length.order.steps[1].held_out_rms_arcmin < 0.6 * length.order.held_out_rms_arcmin
    bound, helps = diagnosed.not_named or ("", "")
    assert "noise and reference at rest explain" in bound
    assert "latency and gyro-scale-misalignment" in helps
    (lag,) = re.findall(r"the gyros lag by ([0-9.]+) ms", helps)
    assert 1e-3 * float(lag) / diagnosed.evidence.reader.found.sampling.period == pytest.approx(1.2, abs=0.1)
    assert "noise and reference at rest explain" in " ".join(str(diagnosed).split())


@pytest.mark.acceptance
def test_the_first_ninety_seconds_of_broad_03_show_latency_and_scale_and_misalignment():
    record = measured(BROAD)
    arrays = {field.name: getattr(record, field.name) for field in fields(record)}
    rows = record.time_s < 90.0
    begun = {name: v[rows] for name, v in arrays.items() if isinstance(v, np.ndarray) and len(v) == len(rows)}
    latency_first(diagnose(replace(record, **begun), rerun=False))


@pytest.mark.acceptance
def test_latency_comes_first_in_broad_03_then_scale_and_misalignment():
    result = diagnose(measured(BROAD))
    latency_first(result)
    assert result.order_stable is False
    for length in result.lengths or ():
        assert length.order is not None
        assert length.order_as_measured is not None
        # Over the longest windows a low-pass of each gyro predicts left-out parts better than one common latency.
        late = "lag" if length.over == "8 s" else "latency"
        assert [step.effect for step in length.order.steps][:2] == [late, "gyro-scale-misalignment"]
        assert {step.effect for step in length.order_as_measured.steps} >= {"gyro-bias", late}
    assert result.gain is not None
    for gain in (result.gain, *(result.gain.others or ())):
        assert (gain.after**2).sum() < 0.3 * (gain.before**2).sum()


@pytest.mark.acceptance
def test_a_lag_and_scale_factors_remain_in_broad_03_by_what_is_stated_of_the_cameras():
    """Latency or a low-pass, beside wrong or drifting scale factors: these wide bounds determine no more."""
    record = measured(BROAD)
    needed = [
        float(figure)
        for text in diagnose(record, rerun=False).not_named or ()
        for figure in re.findall(r"have to err by ([0-9.]+) arcmin or more at a row", text)
    ]
    assert needed == sorted(needed)
    every, helping = needed
    result = diagnose(record, rerun=False, reference_bound=helping)
    sets = [{cause.effect for cause in finding.causes} for finding in result.findings]
    assert (result.verdict, result.complete) == ("ambiguous", True)
    assert {"latency", "gyro-scale-misalignment"} in sets
    assert all(names & {"latency", "lag"} and names & {"gyro-scale-misalignment", "gyro-scale-drift"} for names in sets)
    assert "as stated" in " ".join(str(result).split())
    less = diagnose(record, rerun=False, reference_bound=0.9 * every)
    assert (less.verdict, less.causes) == ("unexplained", ())
    assert "is stated" in (less.not_named or ("",))[0]


@pytest.mark.acceptance
def test_the_gyros_of_the_xsens_unit_feel_gravity():
    """The effect is found blind; the means at rest, without any move, give the same sizes."""
    result = diagnose(measured(XSENS), rerun=False)
    assert (result.verdict, [cause.effect for cause in result.causes]) == ("explained", ["gyro-g-sensitivity"])
    (at_rest,) = result.evidence.reader.found.gyros.standing
    assert at_rest.terms == ("gravity",)
    sizes = np.array([p.estimate for p in result.causes[0].parameters]).reshape(3, 3)
    ends = np.array(result.causes[0].intervals).reshape(3, 3, 2)
    alone = np.array([of_gyro[1:] for of_gyro in at_rest.coefficients])
    assert ((ends[..., 0] <= alone) & (alone <= ends[..., 1])).all()
    assert np.abs(sizes - alone).max() < 0.2 * np.abs(sizes).max()


@pytest.mark.acceptance
def test_the_pages_are_what_the_records_say(tmp_path):
    if not (DATA / f"{BROAD}.strapdown.csv").exists():
        pytest.skip("the real records are not there; set TRIHEDRON_DATA to their folder")
    assert main([str(DATA), str(tmp_path)]) == 0
    generated = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file())
    assert len(generated) == 14
    for path in generated:
        assert (tmp_path / path).read_bytes() == (ROOT / "docs" / path).read_bytes(), f"{path}: run `make case-studies`"
