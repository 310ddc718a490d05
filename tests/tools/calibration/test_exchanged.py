"""Exchanged and reversed channels, senses and units of angles: reported with the correcting options, never applied."""

import re
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest

from generator import G as GRAVITY
from generator.channels import WRONG, right_record, wrong_record
from generator.runs import PROGRAMME, Bench
from generator.stands import random_bench, simulated
from trihedron.tools.calibration import PRESETS, Positions, calibrate, channels_advice, mountings_for, parametrise
from trihedron.tools.check import check
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.errors import InputError
from trihedron.tools.records import Channels, PositionRecord, read_record, write_record

SIGMA = 1e-5


def advised(record: PositionRecord, mounting: str = "identity") -> str:
    matrices = mountings_for(record, mounting)
    at = Positions(record.alpha, record.beta, np.zeros(len(record), dtype=int))
    return channels_advice(record, record.specific_force / GRAVITY, parametrise(matrices), at)


def options_in(line: str) -> list[str]:
    """Return the values of --channels in a line, in order, without those beside a mounting."""
    line = re.sub(r"--mounting[^;]*", "", line)
    return [quoted or plain for quoted, plain in re.findall(r'--channels (?:"([^"]*)"|([^\s;)]+))', line)]


@pytest.fixture(scope="module")
def clean() -> PositionRecord:
    rng = np.random.default_rng(1)
    return simulated(random_bench(rng), noise=rng.uniform(-SIGMA, SIGMA, (24, 3)))


@pytest.mark.parametrize("hidden", [False, True])
def test_every_signed_permutation_is_said_with_the_order_that_mends_it(hidden):
    for way in range(len(WRONG)):
        record, matrix = wrong_record(way, 0, hidden=hidden)
        listed = [Channels.given([text]) for text in options_in(advised(record))]
        plain = [channels for channels in listed if channels.alpha == channels.beta == 1 and not channels.radians]
        assert len(plain) == 1, WRONG[way]
        np.testing.assert_array_equal(plain[0].of_accelerometers, matrix)


@pytest.mark.first(1)
@pytest.mark.parametrize("part", [0.0, 0.1, 0.25, 0.5, 0.9])
def test_channels_that_change_during_a_run_are_advised_nothing(part):
    """Channels exchanged from a row on, with at least two telling rows on each side, are an effect, not a way of
    reading."""
    changes = 0
    for way, seed in product(range(len(WRONG)), range(0, 4, 2)):
        record, matrix = wrong_record(way, seed, hidden=False)
        right, wrong, count = record.specific_force @ matrix.T, record.specific_force, len(record)
        cut = round(part * count) if part else 2
        tells = np.square((right - wrong) / GRAVITY).sum(axis=1) > 0.25
        if min(tells[:cut].sum(), tells[cut:].sum()) < 2:
            continue
        changes += 1
        later = (np.arange(count) >= cut)[:, None]
        assert not advised(replace(record, specific_force=np.where(later, wrong, right))), WRONG[way]
    assert changes >= 5


def test_right_records_are_advised_nothing():
    assert [seed for seed in range(60) if advised(right_record(seed))] == []


WAYS = {
    "alpha": (lambda r: replace(r, alpha=-r.alpha), "alpha=-1"),
    "beta": (lambda r: replace(r, beta=2.0 * np.pi - r.beta), "beta=-1"),
    "both": (lambda r: replace(r, alpha=-r.alpha, beta=-r.beta), "1,-2,3"),
    "radians": (lambda r: replace(r, alpha=np.radians(r.alpha), beta=np.radians(r.beta)), "angles=rad"),
    "exchanged": (lambda r: replace(r, specific_force=r.specific_force[:, [1, 0, 2]]), "2,1,3"),
    "cyclic": (lambda r: replace(r, specific_force=r.specific_force[:, [1, 2, 0]]), "3,1,2"),
    "reversed": (lambda r: replace(r, specific_force=r.specific_force * [1.0, 1.0, -1.0]), "1,2,-3"),
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", WAYS)
def test_all_that_is_listed_mends_the_record_and_nothing_is_applied_silently(clean, name):
    spoil, first = WAYS[name]
    spoilt = spoil(clean)
    with pytest.raises(InputError) as refused:
        calibrate(spoilt, noise_bound=SIGMA)
    message = str(refused.value)
    assert "\n" not in message
    listed = options_in(message)
    assert listed[0] == first
    assert len(listed) == 4
    right = calibrate(clean, noise_bound=SIGMA)
    for option in listed:
        mended = spoilt.read_with(Channels.given([option]))
        assert any(f"--channels {option}" in line.replace('"', "") for line in mended.warnings)
        result = calibrate(mended, noise_bound=SIGMA)
        assert result.verdict == "consistent"
        # The record is the same to rounding, so all of it fits as well.
        assert result.radius == pytest.approx(right.radius, rel=1e-6)


def test_a_mounting_that_is_the_same_is_said_and_mends_it(clean):
    spoilt = replace(clean, alpha=-clean.alpha)
    matrix = re.search(r"matrix = (\[\[.*?\]\])(?!\s*with)", advised(spoilt))
    assert matrix is not None
    rows = [[float(x) for x in row.split(",")] for row in re.findall(r"\[([^\[\]]+)\]", matrix[1])]
    assert calibrate(spoilt, noise_bound=SIGMA, mounting={"own": rows}).verdict == "consistent"
    # In that mounting there is nothing to report.
    at = Positions(spoilt.alpha, spoilt.beta, np.zeros(24, dtype=int))
    assert not channels_advice(spoilt, spoilt.specific_force / GRAVITY, parametrise({"own": rows}), at)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_mounting_that_is_given_counts(preset):
    rng = np.random.default_rng(5)
    record = simulated(random_bench(rng), noise=rng.uniform(-SIGMA, SIGMA, (24, 3)), mounting=PRESETS[preset])
    assert not advised(record, preset)
    exchanged = replace(record, specific_force=record.specific_force[:, [2, 1, 0]])
    assert "3,2,1" in options_in(advised(exchanged, preset))


@pytest.mark.first(1)
@pytest.mark.parametrize("effect", ["none", "quadratic accelerometer-2"])
def test_a_diagnosis_says_it_before_any_verdict(clean, effect, tmp_path, capsys):
    force = clean.specific_force.copy()
    if effect != "none":
        force[:, 1] += 20.0 * SIGMA * GRAVITY * (force[:, 1] / GRAVITY) ** 2
    path = tmp_path / "measured.csv"
    write_record(replace(clean, specific_force=force, alpha=-clean.alpha), path)
    assert main(["diagnose", str(path), "--noise-bound", "1e-5"]) == 2
    message = capsys.readouterr().err.strip()
    assert message.count("\n") == 0
    assert "--channels alpha=-1" in message
    assert "alpha=-1" in check(path).warnings[-1]
    mended = read_record(path, PositionRecord, channels=["alpha=-1"])
    result = diagnose(mended, noise_bound=SIGMA, rerun=False)
    assert result.verdict == ("consistent" if effect == "none" else "explained")
    assert any("--channels alpha=-1" in line for line in result.warnings)
    assert not any("--channels" in line for line in check(path, ["alpha=-1"]).warnings if "g rms" in line)


def test_a_person_who_says_that_the_file_stands_as_it_is_has_the_verdict(clean):
    exchanged = replace(clean, specific_force=clean.specific_force[:, [1, 0, 2]])
    confirmed = exchanged.read_with(Channels.given(["1,2,3"]))
    assert calibrate(confirmed, noise_bound=SIGMA).verdict == "falsified"


def test_channels_that_were_said_wrongly_are_said_anew_for_the_file(clean):
    wrongly = clean.read_with(Channels.given(["2,1,3"]))
    message = advised(wrongly)
    # The correct option restores the file, not another exchange.
    assert "no --channels" in message


@pytest.mark.acceptance
def test_a_raw_record_is_read_so_before_its_rests_are_averaged(tmp_path):
    raw, _ = Bench(white=5e-6).run(PROGRAMME)
    mirrored = replace(raw, alpha=-raw.alpha, specific_force=raw.specific_force[:, [0, 2, 1]])
    write_record(mirrored, tmp_path / "raw.csv", decimals=9)
    plain = read_record(write_and(raw, tmp_path / "plain.csv"), PositionRecord)
    again = read_record(tmp_path / "raw.csv", PositionRecord, channels=["alpha=-1 1,3,2"])
    assert isinstance(again, PositionRecord)
    np.testing.assert_allclose(again.specific_force, plain.specific_force, atol=1e-9)
    np.testing.assert_allclose(again.alpha, plain.alpha, atol=1e-12)
    for column in ("approach_alpha", "approach_beta"):
        np.testing.assert_array_equal(getattr(again, column), getattr(plain, column))
    # A position record made from rests is read with its rests.
    averaged = read_record(mirrored, PositionRecord).read_with(Channels.given(["alpha=-1", "1,3,2"]))
    np.testing.assert_allclose(averaged.specific_force, read_record(raw, PositionRecord).specific_force, atol=1e-12)
    np.testing.assert_array_equal(averaged.approach_alpha, plain.approach_alpha)
    assert averaged.raw is not None
    np.testing.assert_allclose(averaged.raw.alpha, raw.alpha)


def write_and(record, path):
    write_record(record, path, decimals=9)
    return path


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("2,2,3", "is not known"),
        ("2,1", "is not known"),
        ("f=4,1,2", "is not known"),
        ("alpha=2", "is not known"),
        ("w=1,3,2", "has no gyros"),
        ("w=deg", "has no gyros"),
        ("2,1,3 3,1,2", "said twice"),
    ],
)
def test_channels_that_are_none_are_refused_in_one_line(clean, tmp_path, capsys, option, message):
    path = write_and(clean, tmp_path / "measured.csv")
    assert main(["calibrate", str(path), "--noise-bound", "1e-5", "--channels", option]) == 2
    line = capsys.readouterr().err
    assert message in line
    assert line.count("\n") == 1


def test_channels_after_channels_are_those_of_the_file():
    first, second = Channels.given(["2,-1,3", "alpha=-1"]), Channels.given(["3,1,-2", "w=2,1,3"])
    combined = second.after(first)
    np.testing.assert_array_equal(combined.of_accelerometers, second.of_accelerometers @ first.of_accelerometers)
    assert combined.alpha == -1
    assert Channels.given(combined.options) == combined
    for before, after in pairwise(["1,2,3", "-3,2,1", "2,3,-1"]):
        pair = Channels.given([after]).after(Channels.given([before]))
        assert Channels.given([",".join(map(str, pair.accelerometers))]) == pair
