"""`import trihedron as th`: the functions of a notebook; results that show themselves; thin commands."""

import inspect
import json
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

import trihedron as th
from planning_tasks import known_optima
from trihedron.tools import cli, library, measured
from trihedron.tools.document import table_html
from trihedron.tools.result import Result

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.fixture(scope="module")
def run() -> th.Simulation:
    """Return the static calibration, in memory."""
    return th.simulate(SCENARIOS / "static-calibration.toml")


@pytest.fixture(scope="module")
def hidden():
    """Return a record with a hidden quadratic term."""
    return th.hide(7, "quadratic")


@pytest.fixture(scope="module")
def diagnosed(hidden):
    """Return the diagnosis of the hidden record."""
    return th.diagnose(hidden.record, noise_bound=1e-5)


def test_importing_it_imports_nothing():
    """Only the version and the module that shows results are imported at once: everything else is imported on use."""
    output = subprocess.run(
        [sys.executable, "-c", "import sys; before = set(sys.modules); import trihedron; "
         "print(*(set(sys.modules) - before))"],
        capture_output=True, text=True, check=True, timeout=300,
    ).stdout.split()  # fmt: skip
    assert [name for name in output if name.partition(".")[0] not in {"trihedron", *sys.stdlib_module_names}] == []
    assert {name for name in output if name.startswith("trihedron.")} == {"trihedron.tools", "trihedron.version"}


def test_python_and_the_command_line_say_the_same_words_of_a_shared_option(capsys):
    """The words exist once, with the type; a function's own words go before them."""
    documented = " ".join((th.calibrate.__doc__ or "").split())
    assert cli.main(["calibrate", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.replace("│", "").split())
    for words in ("Model value of gravity [m/s²].", "Without it and --noise-sd, the record must give it."):
        assert words in documented
        assert words in text
    assert "mounting : str | " in documented
    assert "A strapdown record gives its own bounds." in " ".join((th.diagnose.__doc__ or "").split())
    for function in (th.calibrate, th.diagnose, th.calibrate_together, th.inspect, th.simulate, th.run_campaign):
        entries = (function.__doc__ or "").splitlines()
        for name, parameter in inspect.signature(function).parameters.items():
            stated = any(name in entry.split(" : ")[0].split(", ") for entry in entries)
            assert stated or parameter.kind is parameter.VAR_POSITIONAL, name


def test_every_name_is_there_and_none_is_that_of_a_module():
    """A function named as a module of the root would be replaced by it as soon as anything imports the module."""
    folder = Path(inspect.getfile(th)).parent
    modules = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()}
    homes = (library, measured)
    members = [(name, it) for home in homes for name, it in vars(home).items() if inspect.isfunction(it)]
    theirs = {home.__name__ for home in homes}
    functions = {name for name, it in members if it.__module__ in theirs and not name.startswith("_")}
    assert {"calibrate", "simulate"} < functions < set(th.__all__)
    for name in th.__all__:
        assert name not in modules
        assert inspect.getdoc(getattr(th, name))
    assert set(th.__all__) <= set(dir(th))
    with pytest.raises(AttributeError, match="'trihedron' has no attribute 'calibrat'"):
        _ = th.calibrat  # type: ignore[attr-defined]


def test_a_run_goes_on_to_calibration_without_files(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = th.calibrate(run, noise_bound=1e-5)
    assert result.verdict == "consistent"
    assert run["alpha_deg"].len() == run.height == len(run.to_polars())
    # The record, its table, the raw table and the file of either give the same numbers.
    th.simulate(SCENARIOS / "static-calibration.toml", out="run")
    for source in (run.positions, run.to_polars(), "run/run.parquet"):
        again = th.calibrate(source, noise_bound=1e-5)
        assert again.to_polars().equals(result.to_polars()), source
    # Angles and readings in decimal digits are not quite the same doubles.
    again = th.calibrate(Path("run/positions.csv"), noise_bound=1e-5)
    assert again.to_polars()["estimate"].to_list() == pytest.approx(result.to_polars()["estimate"].to_list(), abs=1e-12)


def test_records_go_to_tables_and_back(hidden):
    record = hidden.record
    again = th.calibrate(record.to_polars(), noise_bound=1e-5)
    assert again.to_polars().equals(th.calibrate(record, noise_bound=1e-5).to_polars())
    assert record.to_polars().columns[:4] == ["position", "time_s", "alpha_deg", "beta_deg"]


@pytest.mark.acceptance
def test_a_hidden_effect_is_named_and_stays_a_secret_when_printed(hidden, diagnosed):
    assert "quadratic" not in str(hidden) + hidden._repr_html_()
    assert hidden.secret["hidden"]["effect"] == "quadratic"
    assert diagnosed.causes[0].place.effect == "quadratic"
    row = diagnosed.to_polars().row(0, named=True)
    assert row["low"] <= hidden.secret["hidden"]["parameters"]["coefficient"] <= row["high"]


@pytest.mark.acceptance
def test_results_show_themselves(run, hidden, tmp_path):
    calibration = th.calibrate(run, noise_bound=1e-5)
    (tmp_path / "c.json").write_text(calibration.json_text(), encoding="utf-8")
    hidden.record.to_polars().write_csv(tmp_path / "r.csv")
    with known_optima():
        plan = th.plan_positions(12, starts=1, cuts=0, admissible="tables")
    results = [
        run,
        calibration,
        plan,
        th.export("AccelerometerBlock", out=tmp_path),
        th.apply(calibration, tmp_path / "r.csv"),
        th.check(tmp_path / "c.json"),
        th.doctor(),
    ]
    for result in results:
        assert isinstance(result, Result)
        table = result.to_polars()  # type: ignore[attr-defined]
        assert isinstance(table, pl.DataFrame)
        output = str(result)
        assert repr(result) == output
        assert output
        page = result._repr_html_() or ""
        assert page.count("<table>") == page.count("</table>") >= 1
        assert table.columns


@pytest.mark.acceptance
def test_a_part_of_a_result_shows_its_fields(diagnosed):
    cause = diagnosed.causes[0]
    (parameter,) = cause.parameters
    output = repr(parameter)
    assert output == str(parameter)
    assert output.startswith("SizedParameter(name=")
    assert repr(parameter.low) in output
    assert output in repr(cause)
    assert parameter._repr_html_() is None


def test_a_table_of_a_notebook_is_escaped_and_short():
    page = table_html(pl.DataFrame({"<b>": [f"<{k}>" for k in range(100)], "x": [None] * 100}))
    assert "&lt;b&gt;" in page
    assert "<0>" not in page
    assert page.count("<tr>") == 41
    assert "60 rows more" in page


def test_commands_say_what_the_library_gives(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run.positions.to_polars().write_csv("positions.csv")
    result = th.calibrate("positions.csv", noise_bound=1e-5)
    assert cli.main(["calibrate", "positions.csv", "--noise-bound", "1e-5", "--json", "c.json"]) == 0
    assert capsys.readouterr().out.partition("\n\nNext: ")[0] == str(result)
    assert json.loads(Path("c.json").read_text()) == result.to_json()
    assert cli.main(["apply", "c.json", "positions.csv"]) == 0
    assert capsys.readouterr().out.partition("\n\nNext: ")[0] == str(th.apply("c.json", "positions.csv"))
