"""The computations over a campaign, its page, and its comparison with another one."""

import json
import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from campaign_runs import content
from page_text import html_of
from trihedron.tools import cli
from trihedron.tools.campaign import Results, Store, compare_campaigns, parse_campaign, summarise
from trihedron.tools.campaign.kinds import Output
from trihedron.tools.campaign.runs import Design, scalars_file
from trihedron.tools.campaign.store import Computed, Order, ResultColumns, manifest_of
from trihedron.tools.campaign.summary import rate
from trihedron.tools.errors import InputError
from trihedron.tools.reports import campaign_page

HEAD = 'schema = "trihedron.campaign/1"\n'
OUTPUTS = {
    "largest_error_rad": Output(pl.Float64, "lower"),
    "drift_radps": Output(pl.Float64),
    "verdict": Output(pl.String, good=("consistent",)),
    "inside": Output(pl.Boolean, "higher"),
}


def made(folder: Path, text: str, value, failing=lambda run: False, seed: int = 0) -> Store:
    """Return a campaign's folder with the results of `value(run, parameters, rng)`."""
    written = (HEAD + f"seed = {seed}\n[attitude]\n" + text).encode()
    campaign = parse_campaign(written, folder / "c.toml")
    columns = ResultColumns(dict.fromkeys(campaign.parameters, pl.Float64), OUTPUTS)
    folder.mkdir(exist_ok=True)
    store, design = Store(folder, campaign), Design(campaign)
    for partition in range(campaign.partitions):
        rows = []
        for run in campaign.runs_of(partition):
            values = design.values(run)
            gave = {} if failing(run) else value(run, values, np.random.default_rng(design.seed(run)))
            rows.append({"run": run, "failed": "it broke" if failing(run) else None, **values, **gave})
        store.write(Computed(partition, scalars_file(columns, rows), None, len(rows), 0))
    order = Order("c.toml", (("c.toml", b""),), "code")
    manifest = manifest_of(order, campaign, columns, written)
    (folder / "campaign.json").write_text(json.dumps(manifest), encoding="utf-8")
    return store


ISHIGAMI = """
[sampling]
method = "saltelli"
points = 2048
[parameters]
bias_1_radps = { uniform = [-3.141592653589793, 3.141592653589793] }
bias_2_radps = { uniform = [-3.141592653589793, 3.141592653589793] }
bias_3_radps = { uniform = [-3.141592653589793, 3.141592653589793] }
[[compute]]
sensitivity = ["largest_error_rad"]
"""


@pytest.mark.acceptance
def test_sobol_indices_of_a_function_of_which_they_are_known(tmp_path):
    """Use Ishigami's function, a = 7, b = 0.1: its indices are published (Saltelli et al. 2008, section 4.3)."""

    def ishigami(_, values, rng):
        x1, x2, x3 = values.values()
        return {"largest_error_rad": np.sin(x1) + 7.0 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)}

    summary = summarise(made(tmp_path, ISHIGAMI, ishigami))
    result = summary.computed[0]["result"]["largest_error_rad"]["parameters"]
    expected = {"bias_1_radps": (0.3139, 0.5576), "bias_2_radps": (0.4424, 0.4424), "bias_3_radps": (0.0, 0.2437)}
    for name, (first, total) in expected.items():
        assert result[name]["first"] == pytest.approx(first, abs=0.02)
        assert result[name]["total"] == pytest.approx(total, abs=0.02)
        low, high = result[name]["first_interval"]
        assert low <= first + 0.02
        assert high >= first - 0.02
    again = summarise(Store(tmp_path, parse_campaign((HEAD + "[attitude]\n" + ISHIGAMI).encode(), tmp_path / "c.toml")))
    assert again == summary


def test_rows_with_failed_runs_are_left_out_of_the_indices(tmp_path):
    def linear(_, values, rng):
        return {"largest_error_rad": sum(values.values())}

    summary = summarise(made(tmp_path, ISHIGAMI.replace("2048", "64"), linear, lambda run: run in (3, 70)))
    result = summary.computed[0]["result"]["largest_error_rad"]
    assert result["rows_with_failures"] == 2
    assert result["rows"] == 32
    assert [dict(failure) for failure in summary.failures] == [{"message": "it broke", "runs": 2, "first_run": 3}]
    assert "2 failed" in str(summary)


SWEPT = """
[sampling]
points = 300
[parameters]
bias_1_radps = { uniform = [0, 1] }
bias_2_radps = { uniform = [0, 1] }
[[compute]]
sensitivity = ["largest_error_rad"]
[[compute]]
quantiles = ["largest_error_rad"]
at = [0.5, 0.9]
[[compute]]
rate = "verdict"
is = ["falsified"]
against = "bias_1_radps"
edges = [0, 0.5, 1]
[[compute]]
rate = "inside"
is = [true]
[[compute]]
confusion = "verdict"
of = "verdict"
"""


def swept(run, values, rng):
    size = values["bias_1_radps"]
    return {
        "largest_error_rad": size + 1e-3 * rng.random(),
        "drift_radps": rng.random(),
        "verdict": "falsified" if size > 0.75 else "consistent",
        "inside": bool(rng.random() < 0.9),
    }


def test_quantiles_rates_confusion_and_correlations(tmp_path):
    store = made(tmp_path, SWEPT, swept)
    correlations, quantiles, rates, inside, confusion = (item["result"] for item in summarise(store).computed)
    result = correlations["largest_error_rad"]["parameters"]
    assert result["bias_1_radps"]["correlation"] > 0.99
    assert abs(result["bias_2_radps"]["correlation"]) < 0.2
    values = Results(store).numbers("largest_error_rad")
    by_part = {q["at"]: q["value"] for q in quantiles["largest_error_rad"]["quantiles"]}
    assert by_part == {0.5: np.quantile(values, 0.5), 0.9: np.quantile(values, 0.9)}
    assert rates[0]["count"] == 0
    sizes = Results(store).numbers("bias_1_radps")
    assert rates[1]["count"] == (sizes > 0.75).sum()
    assert rates[1]["cases"] == (sizes >= 0.5).sum()
    assert rates[1]["interval"][0] < rates[1]["rate"] < rates[1]["interval"][1]
    assert inside[0]["cases"] == 300
    assert set(confusion) == {"consistent", "falsified"}


def test_wilsons_interval():
    """Test 0 in 10 and 5 in 10, as published (Wilson 1927)."""
    assert rate(np.zeros(10, dtype=bool))["interval"] == pytest.approx([0.0, 0.27753], abs=1e-5)
    assert rate(np.arange(10) < 5)["interval"] == pytest.approx([0.23659, 0.76341], abs=1e-5)
    assert rate(np.zeros(0, dtype=bool))["rate"] is None


@pytest.mark.acceptance
def test_the_page_has_a_picture_of_each_and_repeats(tmp_path, capsys):
    store = made(tmp_path, SWEPT, swept, lambda run: run == 5)
    assert cli.main(["campaign-report", str(tmp_path)]) == 0
    page_lines = capsys.readouterr().out
    assert "300 runs, 1 failed" in page_lines
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert page.count("<svg ") == 4
    assert "it broke" in page
    assert "<script" not in page
    manifest = json.loads((tmp_path / "campaign.json").read_text(encoding="utf-8"))
    assert html_of(campaign_page, store, manifest) == page


def worse(run, values, rng):
    better = swept(run, values, rng)
    return {**better, "largest_error_rad": 1.05 * float(better["largest_error_rad"])}


def test_the_same_campaign_twice_is_no_change(tmp_path):
    for name in ("a", "b"):
        made(tmp_path / name, SWEPT, swept)
    result = compare_campaigns(tmp_path / "b", tmp_path / "a")
    assert result.paired
    assert {change.verdict for change in result.changes} == {"same"}
    assert len(result.changes) == 5


@pytest.mark.acceptance
def test_a_regression_is_named_and_stops_at_the_gate(tmp_path, capsys):
    made(tmp_path / "old", SWEPT, swept)
    made(tmp_path / "new", SWEPT, worse)
    words = ["campaign-report", str(tmp_path / "new"), "--against", str(tmp_path / "old")]
    assert cli.main([*words, "--json", str(tmp_path / "c.json")]) == 0
    assert "worse    largest_error_rad" in capsys.readouterr().out
    assert cli.main([*words, "--gate"]) == 3
    assert json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))["worse"] == 1
    assert "Beyond chance got 1 worse" in (tmp_path / "new" / "index.html").read_text(encoding="utf-8")
    changes = th.campaign_report(tmp_path / "new", against=tmp_path / "old", report=tmp_path / "c.html")
    assert changes.to_json() == json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    assert "Beyond chance got 1 worse" in (tmp_path / "c.html").read_text(encoding="utf-8")
    assert th.campaign_report(tmp_path / "new").to_json()["runs"] == 300
    reversed_words = ["campaign-report", str(tmp_path / "old"), "--against", str(tmp_path / "new"), "--gate"]
    assert cli.main(reversed_words) == 0
    assert "better   largest_error_rad" in capsys.readouterr().out


def test_more_failures_and_worse_verdicts_are_regressions(tmp_path):
    def falsified(run, values, rng):
        return {**swept(run, values, rng), "verdict": "falsified"}

    made(tmp_path / "old", SWEPT, swept)
    made(tmp_path / "new", SWEPT, falsified, lambda run: run % 20 == 0)
    verdicts = {change.name: change.verdict for change in compare_campaigns(tmp_path / "new", tmp_path / "old").changes}
    assert verdicts["failed"] == verdicts["verdict"] == "worse"
    assert verdicts["inside"] == "same"


@pytest.mark.acceptance
def test_other_draws_are_two_samples_and_chance_alone_is_not_called_a_change(tmp_path):
    """Compare campaigns that differ by their seeds alone, ten times; each may report a change in 1 %."""
    called = 0
    for number in range(10):
        for name, seed in (("a", 2 * number), ("b", 2 * number + 1)):
            made(tmp_path / name, SWEPT.replace("points = 300", "points = 60"), swept, seed=seed)
        result = compare_campaigns(tmp_path / "b", tmp_path / "a")
        assert not result.paired
        called += any(change.verdict != "same" for change in result.changes)
    # More than 2 of 10 at 1 % has a probability of 1e-4.
    assert called <= 2


@pytest.mark.parametrize(
    ("prepare", "words", "message"),
    [
        (lambda folder: (folder / "campaign.json").unlink(), (), "holds no campaign"),
        (lambda folder: (folder / "campaign.json").write_text("{"), (), "is not JSON"),
        (lambda folder: (folder / "campaign.json").write_text("[]"), (), "is not the manifest of a campaign"),
        (lambda folder: next((folder / "runs").glob("*2.parquet")).unlink(), (), "(1 of 7 files of runs are missing)"),
        (lambda folder: None, ("--gate",), "--gate: goes with --against"),
    ],
)
def test_what_cannot_be_reported_is_refused_and_left_alone(tmp_path, prepare, words, message, capsys):
    made(tmp_path, SWEPT, swept)
    prepare(tmp_path)
    before = content(tmp_path)
    assert cli.main(["campaign-report", str(tmp_path), *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert content(tmp_path) == before


@pytest.mark.skipif(os.name == "nt", reason="pipes and links of POSIX")
@pytest.mark.parametrize(
    ("name", "make", "message"),
    [
        ("campaign.json", lambda path: os.mkfifo(path), "campaign.json: is not a regular file"),
        ("runs/part-00002.parquet", lambda path: os.mkfifo(path), "(1 of 7 files of runs are missing)"),
        ("runs/part-00002.parquet", lambda path: path.symlink_to("gone"), "(1 of 7 files of runs are missing)"),
        ("runs/part-00002.parquet", lambda path: path.symlink_to(path), "(1 of 7 files of runs are missing)"),
    ],
)
def test_pipes_and_links_to_nothing_are_no_results(name, make, message, tmp_path, capsys):
    made(tmp_path, SWEPT, swept)
    (tmp_path / name).unlink()
    make(tmp_path / name)
    assert cli.main(["campaign-report", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err


def test_campaigns_of_different_kinds_are_not_compared(tmp_path):
    made(tmp_path / "a", SWEPT, swept)
    made(tmp_path / "b", SWEPT, swept)
    manifest = json.loads((tmp_path / "b" / "campaign.json").read_text(encoding="utf-8"))
    manifest["campaign_file"] = HEAD + "[calibration]\n"
    (tmp_path / "b" / "campaign.json").write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(InputError, match="its runs are of the kind calibration"):
        compare_campaigns(tmp_path / "a", tmp_path / "b")


def test_damaged_results_are_refused_in_one_line(tmp_path, capsys):
    store = made(tmp_path / "a", SWEPT, swept)
    file = store.scalars_path(0)
    content_before = file.read_bytes()
    file.write_bytes(content_before[: len(content_before) // 2])
    assert cli.main(["campaign-report", str(tmp_path / "a")]) == 2
    assert "cannot be read" in capsys.readouterr().err
    file.write_bytes(content_before)
    manifest = json.loads((tmp_path / "a" / "campaign.json").read_text())
    (tmp_path / "a" / "campaign.json").write_text(json.dumps({**manifest, "outputs": {"drift_radps": 3}}))
    assert cli.main(["campaign-report", str(tmp_path / "a")]) == 2
    assert "outputs: is not an object of objects" in capsys.readouterr().err
