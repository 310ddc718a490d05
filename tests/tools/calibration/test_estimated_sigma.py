"""σ from repeats or a standard deviation: clean records are consistent, and the answer names the basis."""

import json

import numpy as np
import pytest

import trihedron as th
from field_files import field_file
from gaussian_records import DEVIATION, clean_record, false_alarms
from trihedron.tools.cli import main
from trihedron.tools.records import write_record


@pytest.mark.first(1)
@pytest.mark.parametrize("repeated", [0, 3])
@pytest.mark.parametrize("count", [12, 24, 48, 100])
def test_gaussian_errors_falsify_no_model(count, repeated):
    assert false_alarms(range(10), count, "Gaussian", repeated) == 0


@pytest.mark.first(1)
@pytest.mark.parametrize("count", [300, 1000])
def test_gaussian_errors_of_many_positions_falsify_no_model(count):
    assert false_alarms(range(3), count, "Gaussian") + false_alarms(range(3), count, "Gaussian", 6) == 0


@pytest.mark.acceptance
def test_heavy_tails_stand_mostly_by_many_repeats():
    assert false_alarms(range(10), 24, "t(5)", 6) <= 2


def test_uniform_errors_are_not_needlessly_widened():
    bound = np.sqrt(3.0) * DEVIATION
    record = clean_record(1, 48, "uniform", 12)
    by_deviation, by_repeats = th.calibrate(record, noise_sd=DEVIATION), th.calibrate(record)
    assert bound < by_deviation.sigma.value < 2.0 * bound
    assert bound < by_repeats.sigma.value < 2.8 * bound


@pytest.mark.parametrize("name", ["rc100_00", "rc100_01", "rc100_02", "rc100_03", "rc100_04", "rc100_05", "rc36_08"])
def test_clean_records_with_repeats_from_the_field_stand(name, tmp_path):
    result = th.calibrate(field_file(f"{name}.csv", tmp_path))
    assert result.verdict == "consistent"
    assert result.sigma.kind == "estimated"
    assert "visits to 6 repeated positions" in result.sigma.basis


@pytest.mark.acceptance
def test_a_standard_deviation_says_which_sigma_it_makes(tmp_path, capsys):
    path = tmp_path / "record.csv"
    write_record(clean_record(2, 48, "Gaussian"), path)
    main(["calibrate", str(path), "--noise-sd", "5e-6", "--json", str(tmp_path / "out.json")])
    assert "σ 1.35e-5 g (2.70 sd, sd = 5e-6 g as given, for 48 positions; estimated)" in capsys.readouterr().out
    sigma = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["sigma"]
    assert sigma["kind"] == "estimated"
    assert sigma["value"] == pytest.approx(2.6995 * 5e-6, rel=1e-4)
    main(["diagnose", str(path), "--noise-sd", "5e-6"])
    assert "σ = 1.35e-5 g (2.70 sd, sd = 5e-6 g as given" in " ".join(capsys.readouterr().out.split())
    assert th.diagnose(path, noise_sd=5e-6).calibration.sigma == th.calibrate(path, noise_sd=5e-6).sigma


@pytest.mark.acceptance
def test_several_records_have_the_sigma_of_all_their_positions():
    record = clean_record(3, 48, "Gaussian")
    records = [record.selected(np.arange(24)), record.selected(np.arange(24, 48))]
    together = th.calibrate_together(*records, noise_sd=5e-6)
    assert together.verdict == "consistent"
    for own in together.of_record.values():
        assert own.sigma.kind == "estimated"
        assert own.sigma.basis.startswith("2.70 sd")
    several = th.diagnose_together(*records, noise_sd=5e-6)
    assert several.verdict == "consistent"


@pytest.mark.parametrize(("command", "positions"), [("calibrate", 8), ("diagnose", 24)])
def test_a_record_that_does_not_tell_its_noise_is_refused_with_both_options(command, positions, tmp_path, capsys):
    path = tmp_path / "record.csv"
    write_record(clean_record(5, positions, "Gaussian"), path)
    assert main([command, str(path)]) == 2
    message = capsys.readouterr().err
    assert "no position is repeated" in message
    for words in ("--noise-sd", "--noise-bound", "static record"):
        assert words in message


@pytest.mark.acceptance
def test_the_residuals_tell_a_noise_that_guarantees_nothing(tmp_path, capsys):
    """The standard deviation over 20 records is the true one; estimates are those of the same σ as a bound."""
    deviations = []
    for seed in range(20):
        record = clean_record(seed, 24, "Gaussian")
        result = th.calibrate(record)
        assert result.verdict == "noise-unknown"
        assert result.sigma.kind == "unknown"
        assert all(parameter.guaranteed_error is None for parameter in result.parameters)
        deviations.append(float(result.sigma.basis.split()[-2]))
        close = th.calibrate(record, noise_bound=result.sigma.value)
        assert [p.estimate for p in result.parameters] == [p.estimate for p in close.parameters]
    assert np.sqrt(np.mean(np.square(deviations))) == pytest.approx(DEVIATION, rel=0.05)
    path = tmp_path / "record.csv"
    write_record(clean_record(5, 24, "Gaussian"), path)
    assert main(["calibrate", str(path)]) == 0
    assert "Nothing is guaranteed." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--noise-sd", "5e-6", "--noise-bound", "1e-5"], "--noise-sd 5e-6: goes without --noise-bound"),
        (["--noise-sd", "0"], "--noise-sd 0: must be a fraction of g"),
        (["--noise-sd", "5e-3"], "--noise-sd 0.005: must be a fraction of g"),
        (["--noise-sd", "nan"], "--noise-sd nan: must be a fraction of g"),
    ],
)
def test_a_standard_deviation_that_cannot_be_is_refused(options, message, tmp_path, capsys):
    path = tmp_path / "record.csv"
    write_record(clean_record(6, 24, "Gaussian"), path)
    for command in ("calibrate", "diagnose"):
        assert main([command, str(path), *options]) == 2
        assert message in capsys.readouterr().err


@pytest.mark.first(1)
@pytest.mark.parametrize(("noise_bound", "hinted"), [(1e-5, False), (2e-5, False), (4e-4, True)])
def test_a_sigma_that_is_far_too_large_is_hinted_at(noise_bound, hinted):
    record = clean_record(8, 36, "uniform")
    for result in (th.calibrate(record, noise_bound=noise_bound), th.diagnose(record, noise_bound=noise_bound)):
        assert result.verdict == "consistent"
        assert any("σ may be too large: no error of this record" in text for text in result.warnings) == hinted
