"""The record's noise against the simulation's: named, extended, its gain measured."""

import json

import pytest

import trihedron as th
from generator.noise import static_record
from hidden_noise import HiddenNoise, answered, counted, drawn
from trihedron.tools.cli import main
from trihedron.tools.orchestrator import read_scenario
from trihedron.tools.records import write_record


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [1, 2])
def test_one_hidden_process_is_named_with_its_size(seed, tmp_path):
    secret = drawn(seed, 1)
    result = answered(secret, 300 + seed, tmp_path)
    right, wrong = counted(secret, result)
    # a true process is refused in one of 100 channels: another may then stand alone
    assert right >= 5
    assert wrong <= 1
    for one in result.against:
        hidden = secret.gyro if one.channel.startswith("gyro") else secret.accelerometer
        for letter, size in hidden.items():
            if letter in one.changed:
                assert one.changed[letter] == pytest.approx(size, rel=0.5)


@pytest.mark.acceptance
def test_noise_as_simulated_is_consistent(tmp_path):
    result = answered(HiddenNoise({}, {}), 5, tmp_path)
    assert [one.verdict for one in result.against] == ["consistent"] * 6


@pytest.mark.acceptance
def test_the_extended_noise_predicts_the_half_that_was_not_used(tmp_path):
    secret = HiddenNoise({"K": 2e-5}, {})
    result = answered(secret, 7, tmp_path)
    held = [one for channel in result.against[:3] for one in channel.held_out if one.time_s == 10.0]
    assert len(held) == 3
    for one in held:
        assert one.coverage_simulated < 0.8
        assert 0.9 <= one.coverage_extended <= 1.0
        assert one.score > 0.0


@pytest.mark.acceptance
def test_command_extends_the_scenario_and_its_run_has_the_noise(tmp_path, capsys):
    secret = HiddenNoise({"K": 2e-5}, {"B": 6e-4})
    result = answered(secret, 8, tmp_path)
    record, scenario, extended = tmp_path / "static.csv", tmp_path / "simulation.toml", tmp_path / "extended.toml"
    write_record(static_record(90_000, 0.02, {"N": 1e-4, "K": 2e-5}, {"N": 1e-3, "B": 6e-4}, 8), record, decimals=9)
    out = tmp_path / "noise.json"
    words = ["noise", record, "--against", scenario, "--export", extended, "--json", out]
    assert main([str(word) for word in words]) == 0
    assert "Falsified: simulation.toml simulates other noise" in capsys.readouterr().out
    stated = json.loads(out.read_text())["against"]
    assert [one["alternatives"] for one in stated] == [one.alternatives for one in result.against]
    parameters = read_scenario(extended).fmus["gyro"].parameters
    assert parameters["rate_random_walk"] == pytest.approx([2e-5] * 3, rel=0.5)
    th.simulate(extended, out=tmp_path / "run")
    assert main(["noise", str(record), "--export", str(extended)]) == 2
    assert "give --against" in capsys.readouterr().err
    assert main(["noise", str(record), "--against", str(record)]) == 2
    assert main(["noise", str(record), "--against", str(scenario), "--export", str(scenario)]) == 2
