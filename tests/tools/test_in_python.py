"""Python as on the command line: named arguments, tables of any library, pages and pictures."""

import inspect
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import trihedron as th
import user_script
from generator.carried import POSES, strapdown_record, true_motion
from generator.stands import random_bench, simulated
from trihedron.tools import arguments, cli
from trihedron.tools.arguments import in_python
from trihedron.tools.errors import InputError
from trihedron.tools.records import PositionRecord, write_record

SIGMA = 1e-5
LOOSE: Any = th
"""The library without its types."""


@pytest.fixture(scope="module")
def record() -> PositionRecord:
    rng = np.random.default_rng(3)
    return simulated(random_bench(rng), noise=rng.uniform(-SIGMA, SIGMA, (24, 3)))


@pytest.fixture(scope="module")
def calibration(record):
    return th.calibrate(record, noise_bound=SIGMA)


class Pandas:
    """A table like pandas': column names that are an index, columns that convert to NumPy."""

    def __init__(self, columns: dict[str, list[float]]) -> None:
        self.columns, self._column = np.array(list(columns), dtype=object), columns

    def __getitem__(self, name: str) -> np.ndarray:
        return np.array(self._column[name])


def test_a_table_of_any_library_gives_the_same_record(record):
    columns = record.to_polars().to_dict(as_series=False)
    rows = np.array(list(zip(*columns.values(), strict=True)), dtype=[(name, float) for name in columns])
    for source in (columns, Pandas(columns), rows):
        loaded: Any = th.read_record(source)
        assert np.array_equal(loaded.specific_force, record.specific_force)
        assert np.allclose(loaded.alpha, record.alpha, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: LOOSE.calibrate(5), "a record is a path, or a table with columns .*, not int"),
        (lambda r: LOOSE.calibrate({"alpha_deg": [3.0], "beta_deg": [1.0, 2.0]}), "a table in memory cannot be used"),
        (lambda r: LOOSE.calibrate(np.zeros((4, 5))), "a record is a path, or a table with columns .*, not ndarray"),
        (lambda r: LOOSE.calibrate(r, noise_bound="x"), r"calibrate\(\): noise_bound should be a valid number"),
        (lambda r: LOOSE.calibrate(r, noise_bound=-1), "noise_bound -1: must be a fraction of g"),
        (lambda r: LOOSE.calibrate(r, bounds=3), r"calibrate\(\): bounds should be a valid tuple, not 3"),
        (lambda r: LOOSE.calibrate(r, noise_bound=SIGMA, targets=["X4-"]), "targets 'X4-': ends too early"),
        (
            lambda r: LOOSE.calibrate(r, baseline="round"),
            r"calibrate\(\): baseline should be 'asymmetric' or 'symmetric', not 'round'",
        ),
        (
            lambda r: LOOSE.diagnose(r, noise_bound=SIGMA, hypotheses=["f2 +="]),
            "hypotheses 'f2 \\+=': must be written",
        ),
        (lambda r: LOOSE.diagnose(r, rates="averaged"), "rates averaged: is of a strapdown record"),
        (lambda r: LOOSE.simulate(3), "a scenario is a path, or what its file says, not int"),
        (lambda r: LOOSE.check(3), r"check\(\): file should be"),
    ],
)
def test_what_is_wrong_is_said_of_the_argument_and_not_of_an_option(record, call, message):
    with pytest.raises(InputError, match=f"^{message}") as caught:
        call(record)
    assert "--" not in str(caught.value)


def test_numbers_and_arrays_of_numpy_are_numbers_and_sequences(record, calibration):
    again = LOOSE.calibrate(record, noise_bound=np.float64(SIGMA), bounds=np.array([3e-3, 1e-2]))
    assert again == calibration


def test_a_function_keeps_its_own_name_and_words():
    def doubled(number: float, *, keep_out: float = 0.0) -> float:
        """Twice a number."""
        if keep_out:
            raise InputError(f"--keep-out {keep_out:g}: and --other")
        return 2.0 * number

    wrapped: Any = in_python(doubled)
    assert (wrapped.__name__, wrapped.__doc__, wrapped(2)) == ("doubled", "Twice a number.", 4.0)
    with pytest.raises(InputError, match=r"^keep_out 1: and --other$"):
        wrapped(2, keep_out=1)
    with pytest.raises(TypeError, match=r"^doubled\(\): unexpected argument other"):
        wrapped(2, other=1)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: LOOSE.demo(foo=1), r"^demo\(\): unexpected argument foo; known: out, seed, show$"),
        (lambda: LOOSE.calibrate("a", noise="n"), r"^calibrate\(\): unexpected argument noise; did you mean 'noise_r"),
        (
            lambda: LOOSE.hidden(7, effects="cubic"),
            r"^hidden\(\): write the effects one after another, without effects=$",
        ),
        (lambda: LOOSE.attitude(), r"^attitude\(\): missing a required argument: 'record'$"),
    ],
)
def test_refusals_name_the_public_function_and_the_argument_of_an_option(call: Callable[[], Any], text: str) -> None:
    with pytest.raises(TypeError, match=text):
        call()


def test_an_unknown_function_leads_python_to_the_nearest() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'calibrat'$") as caught:
        LOOSE.calibrat("positions.csv")
    assert (caught.value.name, caught.value.obj) == ("calibrat", th)
    assert "calibrate" in dir(th)


def test_a_table_record_is_answered_with_the_functions_that_take_it(record) -> None:
    with pytest.raises(InputError, match=r"is a table record; a strapdown record .* `th.calibrate` and "):
        th.attitude(record)


def test_results_are_equal_where_all_that_is_published_is(record, calibration):
    assert calibration == type(calibration).model_validate_json(calibration.json_text())
    assert {calibration: 1}[th.calibrate(record, noise_bound=SIGMA)] == 1
    assert calibration != th.calibrate(record, noise_bound=2 * SIGMA)
    assert calibration != 3


def test_a_target_is_had_by_its_symbol_or_its_name(calibration):
    assert calibration["X16"] is calibration["bias-1"]
    assert calibration["X16"].unit == "g"
    with pytest.raises(InputError, match=r"^X44: no target of this calibration; did you mean 'X4'\?"):
        calibration["X44"]


@pytest.mark.acceptance
def test_the_page_and_its_pictures(record, calibration, tmp_path):
    page = calibration.report(tmp_path / "page.html").read_text(encoding="utf-8")
    catalogue = calibration.figures()
    assert all(isinstance(figure, Figure) for figure in catalogue.values())
    assert len(catalogue) == page.count('class="trihedron-picture"')
    assert calibration.figure("residuals").axes[0].lines
    with pytest.raises(InputError, match=r"^nothing: no picture has this name alone; known: "):
        calibration.figure("nothing")
    again = type(calibration).model_validate_json(calibration.json_text())
    with pytest.raises(InputError, match="needs the record"):
        again.report(tmp_path / "again.html")
    with pytest.raises(TypeError, match="has no page"):
        calibration.parameters[0].report(tmp_path / "parameter.html")
    assert th.check(tmp_path / "page.html").report(tmp_path / "check.html").exists()


@pytest.mark.acceptance
def test_a_notebook_of_a_record_runs_from_its_first_cell_to_its_last(record, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_record(record, Path("monday.csv"))
    written = th.export_notebook("monday.csv", noise_bound=SIGMA)
    cells = json.loads(written.read_text(encoding="utf-8"))["cells"]
    assert [cell["id"] for cell in cells] == [f"cell-{k}" for k in range(len(cells))]
    names: dict[str, Any] = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec(cell["source"], names)
    assert names["calibration"].verdict == names["found"].verdict == "consistent"
    assert {path.name for path in tmp_path.glob("*.html")} == {"calibration.html", "diagnosis.html"}
    with pytest.raises(InputError, match="is there already"):
        th.export_notebook("monday.csv")
    with pytest.raises(InputError, match=r"a notebook is an \.ipynb file"):
        th.export_notebook("monday.csv", out="monday.py")


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "strapdown", [pytest.param(False, marks=pytest.mark.acceptance), True], ids=["positions", "strapdown"]
)
def test_a_generated_notebook_runs_in_a_kernel_and_shows_rounded_tables_and_pictures(
    strapdown, record, tmp_path, monkeypatch
):
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    monkeypatch.chdir(tmp_path)
    write_record(strapdown_record(true_motion(POSES[:6])) if strapdown else record, Path("monday.csv"))
    th.export_notebook("monday.csv", noise_bound=None if strapdown else SIGMA)
    notebook = nbformat.read("monday.ipynb", 4)
    nbclient.NotebookClient(notebook, timeout=280, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output["data"] for cell in notebook.cells for output in cell.get("outputs", ()) if "data" in output]
    tables = [data["text/html"] for data in shown if "text/html" in data]
    assert tables
    assert not [number for table in tables for number in re.findall(r"<td>-?0?\.0*[1-9]\d{9,}", table)]
    assert strapdown or any("image/png" in data for data in shown)


@pytest.mark.acceptance
def test_a_script_as_a_user_writes_it_runs(tmp_path):
    assert 0.0 < user_script.bench(tmp_path) < 1e-4
    assert user_script.wrong() == "missing.csv: no such file"


def test_linear_algebra_has_one_thread_in_a_call_and_its_own_again_after_it():
    """Among parallel calls, the last one to end gives it back, in any order."""
    libraries = arguments._libraries()
    assert libraries
    before = [get() for get, _ in libraries]
    try:
        for _, set_to in libraries:
            set_to(2)
        counts = in_python(lambda: [get() for get, _ in libraries])
        assert counts() == [1] * len(libraries)
        first, second = arguments.one_thread(), arguments.one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert [get() for get, _ in libraries] == [1] * len(libraries)
        second.__exit__(None, None, None)
        assert [get() for get, _ in libraries] == [2] * len(libraries)
    finally:
        for (_, set_to), count in zip(libraries, before, strict=True):
            set_to(count)


def test_calls_in_calls_end_where_no_library_can_be_told(monkeypatch: pytest.MonkeyPatch):
    """Test NumPy built with another library than OpenBLAS."""
    monkeypatch.setattr(arguments, "_libraries", list)
    assert in_python(lambda: in_python(lambda: 3)())() == 3


def test_a_calibration_is_asked_by_symbol_and_name(calibration):
    assert "X16" in calibration
    assert "bias-1" in calibration
    assert "X99" not in calibration
    assert calibration.get("X16") == calibration["X16"]
    assert calibration.get("X99") is None
    assert calibration.get("X99", 3) == 3
    assert list(calibration) == [p.symbol for p in calibration.parameters]
    assert {symbol: calibration[symbol].unit for symbol in calibration}["X16"] == "g"


@pytest.mark.acceptance
def test_causes_are_named_where_the_record_is_explained_and_nowhere_else(record):
    clean = th.diagnose(record, noise_bound=SIGMA)
    assert (clean.causes, list(clean), "quadratic" in clean, clean.get("quadratic")) == ((), [], False, None)
    n3 = record.specific_force[:, 2] / record.specific_force[:, 2].max()
    bent = record.specific_force.copy()
    bent[:, 2] += 9.8 * 1e-3 * n3 * n3
    columns = record.to_polars().with_columns(f3_mps2=bent[:, 2])
    explained = th.diagnose(columns, noise_bound=SIGMA)
    assert explained.verdict in ("explained", "ambiguous")
    assert ("quadratic" in explained) == (explained.verdict == "explained")
    assert [cause.effect for cause in explained] == [cause.effect for cause in explained.causes]


@pytest.mark.parametrize(
    "call",
    [
        lambda r: LOOSE.calibrate(r, noise_bound="1e-5"),
        lambda r: LOOSE.diagnose(r, noise_bound="1e-5"),
        lambda r: LOOSE.diagnose(r, noise_bound=True),
        lambda r: LOOSE.calibrate(r, noise_bound=SIGMA, gravity="9.81"),
        lambda r: LOOSE.plan_positions("8"),
    ],
)
def test_a_number_written_as_text_is_refused_in_one_line(call, record):
    with pytest.raises(ValueError, match="should be") as refusal:
        call(record)
    assert isinstance(refusal.value, th.InputError)
    assert "\n" not in str(refusal.value)


def test_a_text_that_is_a_number_is_answered_with_the_number(record):
    with pytest.raises(ValueError, match="write noise_bound=1e-5, without quotation marks"):
        LOOSE.calibrate(record, noise_bound="1e-5")


@pytest.mark.parametrize("value", [np.float32(1e-5), np.float64(1e-5), np.array(1e-5)])
def test_numbers_of_numpy_are_numbers(value, record):
    assert th.calibrate(record, noise_bound=value).verdict == "consistent"


def test_refusals_are_errors_of_pythons_own_kinds(record, calibration, tmp_path):
    for call in (
        lambda: th.calibrate(tmp_path / "absent.csv", noise_bound=SIGMA),
        lambda: th.simulate(tmp_path / "absent.toml"),
        lambda: th.inspect(tmp_path / "absent.csv"),
        lambda: th.check(tmp_path / "absent.toml"),
    ):
        with pytest.raises(FileNotFoundError, match="no such file"):
            call()
        with pytest.raises(th.InputError):
            call()
    (tmp_path / "empty.csv").write_text("")
    for call in (
        lambda: th.calibrate(tmp_path / "empty.csv", noise_bound=SIGMA),
        lambda: th.calibrate(record, noise_bound=-1.0),
        lambda: calibration["X99"],
    ):
        with pytest.raises(ValueError) as refusal:  # noqa: PT011
            call()
        assert isinstance(refusal.value, th.InputError)
        assert not isinstance(refusal.value, OSError)


@pytest.mark.acceptance
def test_python_dash_m_runs_the_command_line():
    words = [sys.executable, "-m", "trihedron"]
    run = subprocess.run([*words, "--version"], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout.strip()) == (0, th.__version__)
    run = subprocess.run([*words, "check", "absent.csv"], capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert run.stderr.startswith("trihedron: absent.csv: no such file")


TERMINAL_ALONE = ("completion",)
"""Commands without a function of their name."""


def test_every_command_has_its_function_of_the_same_name():
    names = {"import": "import_record"}
    for name in cli.app:
        if name.startswith("-") or name in TERMINAL_ALONE:
            continue
        inner = [part for part in cli.app[name] if not part.startswith("-")]
        for part in inner or [""]:
            command = f"{name}-{part}".strip("-")
            assert callable(getattr(th, names.get(command, command.replace("-", "_")))), command


def test_public_functions_say_what_they_return():
    for name in th.__all__:
        thing = getattr(th, name)
        if inspect.isfunction(thing):
            assert "\nReturns\n-------\n" in (inspect.getdoc(thing) or ""), name


def test_an_unknown_argument_is_answered_with_the_nearest_and_the_function(record):
    with pytest.raises(
        TypeError, match=r"^calibrate\(\): unexpected argument noise_bond; did you mean 'noise_bound'\?$"
    ):
        LOOSE.calibrate(record, noise_bond=SIGMA)
    with pytest.raises(TypeError, match=r"^calibrate\(\): missing a required argument: 'record'$"):
        LOOSE.calibrate()


def test_a_result_lists_its_own_names_and_not_those_of_its_library(calibration):
    names = dir(calibration)
    assert {"verdict", "parameters", "figure", "report", "to_json", "to_polars"} <= set(names)
    assert [name for name in names if name.startswith("model_") or name in ("copy", "dict", "json", "schema")] == []
    assert all(hasattr(calibration, name) for name in names)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "call",
    [
        lambda: th.calibrate("a\0b.csv"),
        lambda: th.check("a\0b.csv"),
        lambda: th.run_campaign("a\0b.toml"),
        lambda: LOOSE.calibrate_together(["a.csv", "b\0.csv"]),
    ],
)
def test_a_path_with_the_character_nul_is_refused(call, record, calibration):
    with pytest.raises(InputError, match="character NUL"):
        call()
    with pytest.raises(InputError, match="character NUL"):
        calibration.report("a\0b.html")
    assert cli.main(["calibrate", "a\0b.csv"]) == 2


def test_a_message_about_a_name_without_end_is_limited(tmp_path, capsys):
    """At a terminal each line, in Python the whole; a command that would be cut short is left out."""
    long = "x" * 40_000
    (tmp_path / "a.csv").write_text(f"{long},{long}y,{long}z\n" + "1,2,3\n2,2,3\n" * 40, encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        th.import_record(tmp_path / "a.csv", out=tmp_path / "o.csv")
    assert len(str(refusal.value)) <= 8000
    assert cli.main(["import", str(tmp_path / "a.csv"), "--out", str(tmp_path / "o.csv")]) == 2
    assert max(map(len, capsys.readouterr().err.splitlines())) < 900


def test_two_files_without_gyros_are_refused_and_no_time_is_proposed_for_a_gyro(tmp_path):
    for name in ("a.csv", "b.csv"):
        rows = "".join(f"{0.01 * k:.2f},0.01,0.02,{9.81 + 0.001 * (k % 3):.3f},{k // 20}\n" for k in range(200))
        (tmp_path / name).write_text("Time,AccX,AccY,AccZ,position\n" + rows, encoding="utf-8")
    with pytest.raises(InputError, match="none of its columns can be gyros"):
        th.import_record(tmp_path / "a.csv", tmp_path / "b.csv", out=tmp_path / "o.csv")


def test_advice_names_functions_and_arguments(tmp_path, monkeypatch):
    """A command with its file is a call; `progress` is suggested as any argument; several values are checked, too."""
    monkeypatch.chdir(tmp_path)
    th.new("scenario", "bench.toml")
    with pytest.raises(InputError, match=r"did you mean `th\.simulate\('bench\.toml'\)`"):
        th.calibrate("bench.toml")
    with pytest.raises(TypeError, match="did you mean 'progress'"):
        LOOSE.noise("bench.toml", progres=True)
    with pytest.raises(InputError, match=r"plan\(\): targets should be a valid string"):
        LOOSE.plan(("X4",))
