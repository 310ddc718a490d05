"""Strapdown records that are wrong, poor or broken: refused in one line, or a verdict without a wrong name."""

from dataclasses import fields, replace

import numpy as np
import pytest

import trihedron as th
from generator.carried import strapdown_record
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.errors import InputError
from trihedron.tools.records import StrapdownRecord
from trihedron.tools.trials import draw_clean_block


@pytest.fixture(scope="module")
def clean() -> StrapdownRecord:
    """Return a record of moves between rests, rates, without truth."""
    return strapdown_record(seed=1)


@pytest.fixture(scope="module")
def filmed() -> StrapdownRecord:
    """Return a record with true attitude."""
    return draw_clean_block(3, 1, "truth").measured()


def some_rows(record: StrapdownRecord, rows: np.ndarray) -> StrapdownRecord:
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    columns = {name: v for name, v in values.items() if isinstance(v, np.ndarray) and len(v) == len(record)}
    return replace(record, **{name: v[rows] for name, v in columns.items()})


def with_gyros(record: StrapdownRecord, change) -> StrapdownRecord:
    name = "rate" if record.rate is not None else "increment"
    return replace(record, **{name: change(np.array(getattr(record, name)))})


WRONG = {
    "swapped": (lambda w: w[:, [1, 0, 2]], "is read by gyro 2"),
    "sign": (lambda w: w * [1.0, -1.0, 1.0], "gyro 2 has the wrong sign"),
    "degrees": (np.degrees, "degrees per second"),
    "dead": (lambda w: w * [1.0, 0.0, 1.0], "dead|miss gravity"),
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("kind", ["clean", "filmed"])
def test_gyros_that_cannot_be_right_are_refused_in_one_line(name, kind, request):
    change, says = WRONG[name]
    with pytest.raises(InputError, match=says) as error:
        th.diagnose(with_gyros(request.getfixturevalue(kind), change))
    assert "\n" not in str(error.value)


@pytest.mark.acceptance
def test_a_truth_that_is_not_body_to_reference_is_refused(filmed):
    with pytest.raises(InputError, match=r"true attitude"):
        th.diagnose(replace(filmed, attitude=filmed.attitude * [1.0, -1.0, -1.0, -1.0]))


@pytest.mark.acceptance
def test_a_record_without_poses_or_rests_says_which_to_add():
    rng = np.random.default_rng(0)
    time, noise = 0.01 * np.arange(6000), rng.standard_normal((6000, 3))
    resting = StrapdownRecord(time, 1e-3 * noise, None, np.array([0.0, 0.0, 9.81]) + 0.03 * noise[::-1])
    rate = np.stack([np.sin(time), np.sin(1.3 * time + 1.0), np.sin(0.7 * time + 2.0)], axis=1)
    force = 9.8 * np.stack([np.sin(0.3 * time), np.cos(0.3 * time), 0.0 * time], axis=1)
    for record, says in (
        (resting, "a rest with"),
        (replace(resting, attitude=np.tile([1.0, 0.0, 0.0, 0.0], (6000, 1))), "hardly turns"),
        (StrapdownRecord(time, rate, None, force + 0.03 * noise), "no rests"),
    ):
        result = diagnose(record)
        assert result.verdict == "insufficient"
        assert any(says in str(text) for text in result.missing or ())


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["clean", "filmed"])
def test_missing_rows_name_nothing(kind, request):
    record = request.getfixturevalue(kind)
    count = len(record)
    scattered = np.sort(np.random.default_rng(0).permutation(count)[: int(0.7 * count)])
    result = diagnose(some_rows(record, scattered), rerun=False)
    assert result.verdict == "insufficient"
    assert any("rows missing" in text for text in result.warnings)
    begins = ((np.arange(6) + 0.5) / 6 * count).astype(int)
    holes = (np.arange(count)[:, None] >= begins) & (np.arange(count)[:, None] < begins + count // 20)
    result = diagnose(some_rows(record, np.flatnonzero(~holes.any(axis=1))), rerun=False)
    assert result.verdict in ("consistent", "insufficient")
    assert result.causes == ()


@pytest.mark.acceptance
@pytest.mark.parametrize("kind", ["clean", "filmed"])
def test_a_clipped_move_names_nothing(kind, request):
    record = request.getfixturevalue(kind)
    limit = 0.3 * np.abs(record.rate if record.rate is not None else record.increment).max()
    result = diagnose(with_gyros(record, lambda w: np.clip(w, -limit, limit)), rerun=False)
    assert result.verdict in ("consistent", "insufficient", "unexplained")
    assert result.causes == ()
    assert any("saturated" in text for text in result.warnings)


@pytest.mark.acceptance
def test_accelerometers_in_coarse_steps_name_nothing(clean):
    """Steps count in the bounds, and are reported."""
    g = 9.80665
    stepped = np.array(clean.specific_force)
    stepped[:, 1] = 0.02 * g * np.round(stepped[:, 1] / (0.02 * g))
    result = diagnose(replace(clean, specific_force=stepped), rerun=False)
    assert result.verdict == "consistent"
    assert any("f2 reads in steps of 0.02" in text for text in result.warnings)


HEADER = "time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2\n"


@pytest.mark.parametrize(
    ("rows", "options", "says"),
    [
        ([f"{0.01 * k},0.1,0,0.{k},0,0,9.8{k}\n" for k in range(40)], ["--noise-bound", "1e-5"], "noise_bound"),
        ([f"{0.01 * k},0.1,0,0.{k},0,0,9.8{k}\n" for k in range(40)], ["--baseline", "symmetric"], "symmetric"),
        *(
            ([f"{0.01 * k},0.1,0,0.{k},0,0,9.8{k}\n" for k in range(40)], ["--gravity", size], f"--gravity {size}")
            for size in ("nan", "inf", "0.5", "-9.8")
        ),
    ],
)
def test_the_command_answers_in_one_line_and_writes_nothing(rows, options, says, tmp_path, capsys):
    path, out = tmp_path / "record.csv", tmp_path / "out.json"
    path.write_text(HEADER + "".join(rows))
    assert main(["diagnose", str(path), "--json", str(out), *options]) == 2
    printed = capsys.readouterr().err.strip()
    assert "\n" not in printed
    assert says in printed
    assert not out.exists()
