"""The noise of a record as a further question of its diagnosis."""

import json

import numpy as np
import pytest
from fmpy import read_model_description

import trihedron as th
from generator.noise import static_record
from hidden_noise import SCENARIO
from trihedron.tools.cli import main
from trihedron.tools.records import StrapdownRecord, write_record

STEP = 0.05
LONG, SHORT, MOVES = 24_000, 200, 24
GRAVITY = 9.80665


def moved_record(seed: int, walk: float, first: int = LONG) -> StrapdownRecord:
    """Return a long rest of `first` rows, then turns of a quarter about the axes with short rests between.

    Gyros have a random walk [rad/s/√s] in the long rest.
    """
    still = static_record(first, STEP, {"N": 1e-4, "K": walk}, {"N": 1e-3}, seed)
    assert still.rate is not None
    draws = np.random.default_rng(seed)
    turned = np.eye(3)
    rates, forces = [still.rate], [still.specific_force]
    count = 40
    for move in range(MOVES):
        axis = np.eye(3)[move % 3]
        rate = 0.5 * np.pi / (count * STEP)
        for _ in range(count):
            turned = rotated(turned, axis, rate * STEP)
            rates.append(rate * axis[None, :])
            forces.append(GRAVITY * (turned @ [0.0, 0.0, 1.0])[None, :])
        rates.append(np.zeros((SHORT, 3)))
        forces.append(np.tile(GRAVITY * (turned @ [0.0, 0.0, 1.0]), (SHORT, 1)))
    rate, force = np.concatenate(rates), np.concatenate(forces)
    rate[first:] += 1e-4 / STEP**0.5 * draws.standard_normal((len(rate) - first, 3)) + still.rate[-1:].mean()
    force[first:] += 1e-3 / STEP**0.5 * draws.standard_normal((len(rate) - first, 3))
    return StrapdownRecord(time_s=STEP * np.arange(len(rate)), rate=rate, increment=None, specific_force=force)


def rotated(matrix: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """Return a matrix (3, 3) from the world to a block that turns further about one of its axes."""
    cross = np.cross(np.eye(3), axis)
    return (np.eye(3) - np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross) @ matrix


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(SCENARIO.format(step=STEP))
    return path


@pytest.mark.acceptance
def test_a_diagnosis_names_the_noise_that_the_simulation_lacks(scenario, tmp_path, capsys):
    path, out, folder = tmp_path / "run.csv", tmp_path / "diagnosis.json", tmp_path / "extended"
    write_record(moved_record(1, 6e-6), path)
    words = ["diagnose", str(path), "--against", str(scenario), "--json", str(out), "--export", str(folder)]
    assert main(words) == 0
    assert "bench.toml does not simulate the noise of the record" in " ".join(capsys.readouterr().out.split())
    noise = json.loads(out.read_text())["noise"]
    gyros = noise["against"][:3]
    assert sum("K" in one["alternatives"] for one in gyros) >= 2
    assert [one["verdict"] for one in noise["against"][3:]].count("consistent") >= 2
    assert gyros[0]["held_out"]
    # the FMU starts with the processes that the simulation lacked, beside its own
    starts = {}
    for variable in read_model_description(folder / "GyroBlock.fmu").modelVariables:
        starts[variable.name] = variable.start
    for axis, one in enumerate(gyros, start=1):
        assert float(starts[f"angle_random_walk[{axis}]"]) == pytest.approx(1e-4, rel=0.1)
        assert float(starts[f"rate_random_walk[{axis}]"]) == pytest.approx(one["changed"].get("K", 0.0), rel=1e-12)
    assert (folder / "GyroBlock.ssv").exists()
    assert not (folder / "AccelerometerBlock.fmu").exists() or any(one["changed"] for one in noise["against"][3:])


@pytest.mark.acceptance
def test_the_noise_changes_no_verdict(scenario):
    record = moved_record(2, 0.0)
    alone, compared = th.diagnose(record), th.diagnose(record, against=scenario)
    assert (compared.verdict, compared.radius) == (alone.verdict, alone.radius)
    assert alone.noise is None
    assert compared.noise is not None
    assert [one.verdict for one in compared.noise.against].count("consistent") >= 5


@pytest.mark.acceptance
def test_a_record_of_short_rests_is_refused(scenario, tmp_path, capsys):
    path = tmp_path / "run.csv"
    write_record(moved_record(3, 0.0, first=1000), path)
    assert main(["diagnose", str(path), "--against", str(scenario)]) == 2
    assert "record the block at rest for five minutes" in " ".join(capsys.readouterr().err.split())
