"""Exports of calibrations, each read by the program it is for: its corrected readings are those of the correction."""

import csv
import io
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from by_hand import GRAVITY, Instrument, calibration
from generator.stands import random_bench, simulated
from trihedron.tools import cli

SEEDS = (1, 2)
DENSITIES = (2e-3, 4e-5, 1.7e-4, 2e-06)
TARGETS = ("kalibr", "imucal", "ros", "c", "matlab", "csv", "xlsx", "imu_tk", "px4")
OPEN = [{"parameters": ["gamma_21"], "close_by": "a rest with axis 1 and axis 2 up"}]


def motion(seed: int, count: int = 50) -> tuple[np.ndarray, np.ndarray]:
    """Return specific forces [m/s2] and rates [rad/s] (count, 3)."""
    rng = np.random.default_rng([seed, 9])
    return rng.normal(0.0, 8.0, (count, 3)), rng.normal(0.0, 2.0, (count, 3))


class Case:
    """An instrument, its calibration in a file, and its readings."""

    def __init__(self, folder: Path, seed: int, **options: Any) -> None:
        self.instrument = Instrument(seed)
        self.content = calibration(self.instrument, **options)
        self.file = folder / "calibration.json"
        self.file.write_text(json.dumps(self.content), encoding="utf-8")
        self.folder = folder
        self.force, self.rate = motion(seed)
        self.readings = self.instrument.readings(self.force)
        self.rates = self.instrument.rates(self.rate, self.force)

    def export(self, to: str, file: str, **options: Any) -> Path:
        """Export and return the file."""
        th.export_calibration(self.file, to, self.folder / file, **options)  # type: ignore[arg-type]
        return self.folder / file


@pytest.fixture(params=SEEDS)
def case(tmp_path, request) -> Case:
    return Case(tmp_path, request.param)


def test_imucal_gives_the_corrected_readings(case):
    imucal = pytest.importorskip("imucal", reason="imucal is not installed")
    info = imucal.FerrarisCalibrationInfo.from_json_file(case.export("imucal", "imu.json"))
    degrees = 180.0 / np.pi
    force, rate = info.calibrate(case.readings, degrees * case.rates, "m/s^2", "deg/s")
    np.testing.assert_allclose(force, case.force, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rate / degrees, case.rate, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(info.R_a, axis=1), 1.0, rtol=1e-14)
    assert info.K_a[0, 1] == 0.0
    assert "gravity_mps2: 9.81" in info.comment


def test_imucal_leaves_gyros_that_are_not_calibrated(tmp_path):
    imucal = pytest.importorskip("imucal", reason="imucal is not installed")
    case = Case(tmp_path, 3, gyros=False)
    exported = th.export_calibration(case.file, "imucal", tmp_path / "imu.json")
    info = imucal.FerrarisCalibrationInfo.from_json_file(tmp_path / "imu.json")
    force, rate = info.calibrate(case.readings, case.rates, "m/s^2", "deg/s")
    np.testing.assert_allclose(force, case.force, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(rate, case.rates)
    assert "gyros" in " ".join(exported.lost)


def test_kalibr_reads_the_densities_and_its_equation_gives_the_readings(case):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    path = case.export("kalibr", "imu.yaml", densities=DENSITIES, rate=200.0, topic="/imu/data")
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    keys = ("accelerometer_noise_density", "accelerometer_random_walk", "gyroscope_noise_density")
    assert tuple(content[key] for key in (*keys, "gyroscope_random_walk")) == DENSITIES
    assert (content["rostopic"], content["update_rate"]) == ("/imu/data", 200.0)
    matrix = np.array(content["accelerometers"]["M"])
    assert np.all(np.triu(matrix, 1) == 0.0)
    np.testing.assert_allclose(case.force @ matrix.T + GRAVITY * case.instrument.bias, case.readings, atol=1e-12)
    gyros = {name: np.array(values) for name, values in content["gyroscopes"].items()}
    turned = gyros["C_gyro_i"]
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(turned) == pytest.approx(1.0)
    assert np.allclose(np.triu(gyros["M"], 1), 0.0, atol=1e-15)
    rates = case.rate @ (gyros["M"] @ turned).T + case.force @ (gyros["A"] @ turned).T + case.instrument.gyro_bias
    np.testing.assert_allclose(rates, case.rates, rtol=0, atol=1e-12)


@pytest.mark.acceptance
def test_kalibr_takes_the_noise_of_a_result(case):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    rng = np.random.default_rng(4)
    count, sizes = 30_000, {"w": 1e-3, "f": 2e-2}
    table = {"time_s": 0.01 * np.arange(count)}
    for sensor, unit in (("w", "radps"), ("f", "mps2")):
        for axis in (1, 2, 3):
            table[f"{sensor}{axis}_{unit}"] = sizes[sensor] * rng.normal(size=count)
    table["f3_mps2"] += GRAVITY
    noise = case.folder / "noise.json"
    noise.write_text(th.noise(table).json_text(), encoding="utf-8")
    path = case.export("kalibr", "imu.yaml", noise=noise)
    text = path.read_text(encoding="utf-8")
    written = yaml.safe_load(text)
    assert written["accelerometer_noise_density"] == pytest.approx(2e-2 * 0.1, rel=0.05)
    assert written["gyroscope_noise_density"] == pytest.approx(1e-3 * 0.1, rel=0.05)
    assert written["update_rate"] == pytest.approx(100.0)
    assert 0.0 < written["gyroscope_random_walk"] < 1e-4
    assert "gyroscope_random_walk: upper end, not detected" in text


def test_a_parameter_file_of_ros_has_its_bias_after_the_matrix(case):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    content = yaml.safe_load(case.export("ros", "imu.yaml").read_text(encoding="utf-8"))
    numbers = {name: np.array(values) for name, values in content["/**"]["ros__parameters"].items()}
    assert all(values.dtype == np.float64 for values in numbers.values())
    force = case.readings @ numbers["SM"].reshape(3, 3).T - numbers["bias"]
    np.testing.assert_allclose(force, case.force, rtol=0, atol=1e-12)
    rate = case.rates @ numbers["gyro_SM"].reshape(3, 3).T - numbers["gyro_bias"]
    rate = rate - force @ numbers["gyro_acceleration"].reshape(3, 3).T
    np.testing.assert_allclose(rate, case.rate, rtol=0, atol=1e-12)
    assert numbers["gravity"] == GRAVITY


PROGRAM = """
#include <stdio.h>
#include "imu.h"
int main(void)
{
    double reading[3], rates[3], force[3], rate[3];
    while (scanf("%lf %lf %lf %lf %lf %lf", reading, reading + 1, reading + 2, rates, rates + 1, rates + 2) == 6) {
        board_force(reading, force);
        RATE
        printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", force[0], force[1], force[2], rate[0], rate[1], rate[2]);
    }
    return 0;
}
"""


def compiled_and_run(folder: Path, readings: np.ndarray, rates: np.ndarray, *, gyros: bool) -> np.ndarray:
    """Return the corrected readings (N, 6) of a program with the header imu.h."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    call = "board_rate(rates, force, rate);" if gyros else "rate[0] = rate[1] = rate[2] = 0.0;"
    (folder / "main.c").write_text(PROGRAM.replace("RATE", call), encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wno-unused-variable", "-pedantic", "-Werror", "-O2"]
    subprocess.run([compiler, *flags, "main.c", "-o", "correct"], cwd=folder, check=True)
    rows = "\n".join(" ".join(repr(float(value)) for value in row) for row in np.hstack([readings, rates]))
    result = subprocess.run([folder / "correct"], input=rows, text=True, capture_output=True, check=True)
    return np.array([[float(word) for word in line.split()] for line in result.stdout.splitlines()])


def test_a_c_header_compiles_without_warnings_and_corrects(case):
    case.export("c", "imu.h", name="board")
    out = compiled_and_run(case.folder, case.readings, case.rates, gyros=True)
    np.testing.assert_allclose(out[:, :3], case.force, rtol=0, atol=1e-12)
    np.testing.assert_allclose(out[:, 3:], case.rate, rtol=0, atol=1e-12)


def bench_calibration(folder: Path) -> Path:
    """Calibrate a bench with two scale factors for each accelerometer."""
    bench = random_bench(np.random.default_rng(4))
    noise = np.random.default_rng(5).uniform(-1e-5, 1e-5, (24, 3))
    path = folder / "bench.json"
    path.write_text(th.calibrate(simulated(bench, noise=noise), noise_bound=1e-5).json_text(), encoding="utf-8")
    return path


def test_a_c_header_has_both_scale_factors_of_a_bench(tmp_path):
    path = bench_calibration(tmp_path)
    th.export_calibration(path, "c", tmp_path / "imu.h", name="board")
    readings = motion(5)[0]
    out = compiled_and_run(tmp_path, readings, np.zeros_like(readings), gyros=False)
    np.testing.assert_allclose(out[:, :3], th.correction(path)(readings), rtol=0, atol=1e-13)


def test_one_matrix_for_two_scale_factors_is_said_to_lose_their_difference(tmp_path):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    path = bench_calibration(tmp_path)
    exported = th.export_calibration(path, "ros", tmp_path / "imu.yaml")
    (lost,) = [line for line in exported.lost if "both scale factors" in line]
    correction = th.correction(path)
    half = 0.5 * np.abs(correction.plus - correction.minus).max()
    assert float(lost.split("up to ")[1].split()[0]) == pytest.approx(1e3 * half, rel=0.1)
    content = yaml.safe_load((tmp_path / "imu.yaml").read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    force = motion(6)[0]
    gravity = correction.gravity
    readings = gravity * (force / gravity @ correction.gamma.T + correction.bias)
    readings += force * np.where(force > 0.0, correction.plus, correction.minus)
    error = readings @ np.reshape(content["SM"], (3, 3)).T - content["bias"] - force
    assert 0.0 < np.abs(error).max() <= 1.02 * half * np.abs(force).max()


def test_a_mat_file_is_read_by_scipy(case):
    scipy_io = pytest.importorskip("scipy.io")
    imu = scipy_io.loadmat(case.export("matlab", "imu.mat", name="board"), simplify_cells=True)["board"]
    np.testing.assert_allclose((case.readings - imu["b"]) @ imu["A_inverse"].T, case.force, rtol=0, atol=1e-12)
    rates = (case.rates - case.force @ imu["D"].T - imu["c"]) @ imu["G_inverse"].T
    np.testing.assert_allclose(rates, case.rate, rtol=0, atol=1e-12)
    assert imu["gravity"] == GRAVITY
    np.testing.assert_allclose(imu["A_standard_error"], 1e-4 * np.tri(3))
    assert "not_determined" in imu["about"]


def arrays_of(rows: list[tuple[str, Any, Any, Any]]) -> dict[str, np.ndarray]:
    """Return arrays of a table of name, row, column and value."""
    arrays: dict[str, dict[tuple[int, ...], float]] = {}
    for name, row, column, value in rows:
        place = (int(row) - 1,) if column in (None, "") else (int(row) - 1, int(column) - 1)
        arrays.setdefault(name, {})[place] = float(value)
    result = {}
    for name, values in arrays.items():
        result[name] = np.zeros(np.max(list(values), axis=0) + 1)
        for place, value in values.items():
            result[name][place] = value
    return result


def check_arrays(arrays: dict[str, np.ndarray], case: Case) -> None:
    force = np.linalg.solve(arrays["A"], (case.readings - arrays["b"]).T).T
    np.testing.assert_allclose(force, case.force, rtol=0, atol=1e-12)
    rate = np.linalg.solve(arrays["G"], (case.rates - force @ arrays["D"].T - arrays["c"]).T).T
    np.testing.assert_allclose(rate, case.rate, rtol=0, atol=1e-12)
    np.testing.assert_allclose(arrays["b_standard_error"], GRAVITY * 1e-4)


def test_a_csv_table_holds_every_number(case):
    path = case.export("csv", "imu.csv")
    lines = path.read_text(encoding="utf-8").splitlines()
    table = csv.DictReader(line for line in lines if not line.startswith("#"))
    check_arrays(arrays_of([(row["name"], row["row"], row["column"], row["value"]) for row in table]), case)
    assert "# gravity_mps2: 9.81" in lines


def test_a_workbook_is_read_by_openpyxl(case):
    openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed")
    book = openpyxl.load_workbook(case.export("xlsx", "imu.xlsx"))
    rows = list(book["table"].iter_rows(min_row=2, values_only=True))
    check_arrays(arrays_of([(row[0], row[1], row[2], row[3]) for row in rows]), case)
    matrix = [list(row) for row in book["matrices"].iter_rows(min_row=5, max_row=7, max_col=3, values_only=True)]
    np.testing.assert_array_equal(matrix, arrays_of([(row[0], row[1], row[2], row[3]) for row in rows])["A"])
    about = {row[0]: row[1] for row in book["about"].iter_rows(values_only=True)}
    assert about["gravity_mps2"] == "9.81"


def triad(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return T, K and B as imu_tk reads them: 21 numbers, separated by spaces; the rest is not read."""
    numbers = [float(word) for word in path.read_text(encoding="utf-8").split()[:21]]
    return np.reshape(numbers[:9], (3, 3)), np.reshape(numbers[9:18], (3, 3)), np.array(numbers[18:])


def test_imu_tk_reads_two_triads_in_the_same_turned_axes(tmp_path):
    case = Case(tmp_path, 5, sensitivity=False)
    case.rates = case.rate @ case.instrument.gyro_matrix.T + case.instrument.gyro_bias
    exported = th.export_calibration(case.file, "imu_tk", tmp_path / "imu.calib")
    assert [Path(name).name for name in exported.files] == ["imu.calib", "imu-gyros.calib"]
    t, k, b = triad(tmp_path / "imu.calib")
    np.testing.assert_array_equal(np.tril(t, -1), np.zeros((3, 3)))
    np.testing.assert_allclose(np.diag(t), 1.0)
    force = (case.readings - b) @ (t @ k).T
    turned = np.linalg.lstsq(case.force, force, rcond=None)[0].T
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(force, case.force @ turned.T, atol=1e-11)
    t, k, b = triad(tmp_path / "imu-gyros.calib")
    np.testing.assert_allclose((case.rates - b) @ (t @ k).T, case.rate @ turned.T, atol=1e-11)
    angle = np.arccos(0.5 * (np.trace(turned) - 1.0))
    assert f"turned by {1e3 * angle:.3g} mrad" in " ".join(exported.lost)


def test_px4_loses_what_it_says(tmp_path):
    case = Case(tmp_path, 6)
    exported = th.export_calibration(case.file, "px4", tmp_path / "imu.params")
    values = {}
    for line in (tmp_path / "imu.params").read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            vehicle, component, name, value, kind = line.split("\t")
            assert (vehicle, component, kind) == ("1", "1", "9")
            values[name] = float(value)
    offset = np.array([values[f"CAL_ACC0_{axis}OFF"] for axis in "XYZ"])
    scale = np.array([values[f"CAL_ACC0_{axis}SCALE"] for axis in "XYZ"])
    rng = np.random.default_rng(7)
    up = rng.normal(size=(200_000, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    error = (case.instrument.readings(GRAVITY * up) - offset) * scale / GRAVITY - up
    (lost,) = [line for line in exported.lost if line.startswith("misalignments of the accelerometers")]
    rms = np.sqrt(np.mean(np.sum(error**2, axis=1)))
    assert float(lost.split(": ")[1].split()[0]) == pytest.approx(1e3 * rms, rel=0.05)
    # no other six parameters leave less
    for p in range(3):
        for change in (-1e-3, 1e-3):
            other = scale.copy()
            other[p] += change
            worse = (case.instrument.readings(GRAVITY * up) - offset) * other / GRAVITY - up
            assert np.mean(worse**2) > np.mean(error**2)
    gyros = [values[f"CAL_GYRO0_{axis}OFF"] for axis in "XYZ"]
    np.testing.assert_allclose(gyros, case.instrument.gyro_bias)
    assert any("gyros: up to" in line for line in exported.lost)


@pytest.mark.parametrize("to", TARGETS)
def test_every_export_says_its_conditions_and_is_the_same_again(tmp_path, to):
    case = Case(tmp_path, 2, verdict="insufficient", open=OPEN)
    options = {"densities": DENSITIES, "rate": 100.0} if to == "kalibr" else {}
    first = case.export(to, "first", **options).read_bytes()
    assert case.export(to, "second", **options).read_bytes() == first
    exported = th.export_calibration(case.file, to, tmp_path / "third", **options)
    assert exported.gravity == GRAVITY
    assert exported.verdict == "insufficient"
    assert exported.open == ["gamma_21 (closed by a rest with axis 1 and axis 2 up)"]
    shown = str(exported)
    assert "not determined: gamma_21" in shown
    if to == "xlsx":
        openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed")
        book = openpyxl.load_workbook(io.BytesIO(first))
        text = " ".join(str(cell) for row in book["about"].iter_rows(values_only=True) for cell in row)
    elif to == "matlab":
        scipy_io = pytest.importorskip("scipy.io")
        text = str(scipy_io.loadmat(tmp_path / "third", appendmat=False, simplify_cells=True)["imu"]["about"])
    else:
        text = first.decode("utf-8")
    for words in ("9.81", "m/s2 and rad/s", "forward", "gamma_21", "insufficient", "0.42 mg"):
        assert words in text, words


def test_a_calibration_with_gyros_that_were_not_calibrated_exports_everywhere(tmp_path):
    case = Case(tmp_path, 8, gyros=False)
    for to in TARGETS:
        options = {"densities": DENSITIES, "rate": 100.0} if to == "kalibr" else {}
        case.export(to, f"imu.{to}", **options)
    assert not list(tmp_path.glob("*-gyros*"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "kalibr"], "needs the noise: give --noise NOISE.json .* --rate HZ with --densities"),
        (["--to", "kalibr", "--densities", "1e-3", "1e-4", "1e-5", "1e-6"], "--rate HZ"),
        (["--to", "kalibr", "--densities", "0", "1e-4", "1e-5", "1e-6", "--rate", "100"], "above 0"),
        (["--to", "imucal", "--rate", "100"], "--to imucal: holds no noise"),
        (["--to", "c", "--name", "2bad-name"], "--name 2bad-name: must be a name of C"),
        (["--to", "rosbag"], "rosbag"),
        (["--to", "kalibr", "--noise", "other.json"], "is not a result of `trihedron noise`"),
    ],
)
def test_what_is_missing_is_said(tmp_path, capsys, monkeypatch, words, message):
    Case(tmp_path, 1)
    shutil.copy(tmp_path / "calibration.json", tmp_path / "other.json")
    monkeypatch.chdir(tmp_path)
    assert cli.main(["export-calibration", "calibration.json", *words, "--out", "out.x"]) == 2
    printed = capsys.readouterr().err
    assert re.search(message, printed), printed
    assert len(printed.splitlines()) == 1
    assert not (tmp_path / "out.x").exists()


def test_no_input_is_overwritten(tmp_path):
    case = Case(tmp_path, 1)
    before = case.file.read_bytes()
    with pytest.raises(th.InputError, match=r"would replace it|is the calibration too"):
        th.export_calibration(case.file, "imucal", case.file)
    assert case.file.read_bytes() == before
    assert cli.main(["export-calibration", str(case.file), "--to", "csv", "--out", str(case.file)]) == 2
    assert case.file.read_bytes() == before


def test_a_calibration_without_an_estimate_is_refused(tmp_path):
    case = Case(tmp_path, 1)
    case.content["parameters"][0]["estimate"] = None
    case.file.write_text(json.dumps(case.content), encoding="utf-8")
    with pytest.raises(th.InputError, match="lacks 'X4'"):
        case.export("csv", "imu.csv")
    assert not (tmp_path / "imu.csv").exists()


def test_names_that_a_record_may_have_do_not_break_a_file(tmp_path):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    case = Case(tmp_path, 1)
    case.content["provenance"]["record"] = "a */ b\nSM: [1]\u2028bias: [2] \\"
    case.file.write_text(json.dumps(case.content), encoding="utf-8")
    content = yaml.safe_load(case.export("ros", "imu.yaml").read_text(encoding="utf-8"))
    assert list(content) == ["/**"]
    case.export("c", "imu.h", name="board")
    out = compiled_and_run(tmp_path, case.readings, case.rates, gyros=True)
    np.testing.assert_allclose(out[:, :3], case.force, rtol=0, atol=1e-12)


PAGE = Path(__file__).resolve().parents[3] / "docs" / "export-a-calibration.md"


def test_the_numbers_of_the_page_are_those_of_the_files(tmp_path):
    """The page's instrument, exported: each number in its table of examples is in the file of that target."""
    case = Case(tmp_path, 1, sensitivity=False)
    instrument = case.instrument
    instrument.matrix = np.array([[1.01, 0.0, 0.0], [0.02, 0.99, 0.0], [-0.01, 0.03, 1.005]])
    instrument.bias = np.array([0.1, -0.2, 0.3]) / GRAVITY
    case.content = calibration(instrument, gyros=False)
    case.file.write_text(json.dumps(case.content), encoding="utf-8")
    text = PAGE.read_text(encoding="utf-8")
    corrected = ", ".join(f"{value:.4f}" for value in th.correction(case.file)([1.0, 2.0, 10.0]))
    assert f"f = ({corrected}) m/s²" in text
    rows = re.findall(r"^\| `(\w+)` \| `([^|]*)` \|$", text, flags=re.MULTILINE)
    assert {target for target, _ in rows} == {"kalibr", "imucal", "ros", "imu_tk", "px4"}
    for target, shown in rows:
        options = {"densities": DENSITIES, "rate": 100.0} if target == "kalibr" else {}
        file = case.export(target, f"imu.{target}", **options).read_text(encoding="utf-8")
        written = {round(float(word), 4) for word in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", file)}
        for word in re.findall(r"-?\d+\.\d+", shown):
            assert float(word) in written, (target, word)
