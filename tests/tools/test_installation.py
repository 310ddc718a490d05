"""`trihedron doctor`: the installed parts, and a run that works."""

import json

from trihedron.tools import cli


def test_doctor_tries_a_run(capsys):
    assert cli.main(["doctor", "--json", "-"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert output["works"] is True
    subjects = {finding["subject"]: finding["state"] for finding in output["findings"]}
    assert "consistent" in subjects["a run"]
    assert {"extra native", "extra docs", "extra cluster", "native FMUs for aarch64-darwin"} <= set(subjects)


def test_doctor_says_what_does_not_work(monkeypatch, capsys):
    monkeypatch.setattr("trihedron.tools.installation.simulate_table", lambda *_, **__: 1 / 0)
    assert cli.main(["doctor"]) == 1
    output = capsys.readouterr()
    assert "NO a run" in " ".join(output.out.split())
    assert "ZeroDivisionError" in output.out
    assert output.err == "trihedron: does not work: a run\n"
