"""Effects found in one record, applied to another: subtracted from its readings, or simulated."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from diagnoses import diagnosed
from generator.positions import of_one_instrument
from trihedron.models.effects import EffectPlace
from trihedron.tools.calibration import calibrate
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import Cause, Diagnosis, Explanation, applied_to, evidence_of
from trihedron.tools.diagnosis.result import OneRecord
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import undetermined
from trihedron.tools.records import PositionRecord, read_record, write_record
from trihedron.tools.trials import Hidden, draw_clean_block

SIGMA = 1e-5
QUADRATIC, ENCODER = EffectPlace("quadratic", "accelerometer-2"), EffectPlace("encoder-harmonic", "outer-axis", 2)
G_SENSITIVITY = EffectPlace("gyro-g-sensitivity", "gyro-block")
TRUE_G = (2e-3, 0.0, 0.0, 0.0, -1e-3, 0.0, 0.0, 0.0, 1.5e-3)


def days(folder: Path, name: str, *effect: Any) -> Path:
    """Write a diagnosis of Monday's record of an instrument, and Tuesday's record beside it."""
    monday, tuesday = of_one_instrument(5, 2, shared=[effect])
    for day, record in (("monday", monday), ("tuesday", tuesday)):
        write_record(record, folder / f"{name}-{day}.csv")
    diagnosis = diagnosed(monday)
    assert diagnosis.verdict == "explained"
    (folder / f"{name}.json").write_text(diagnosis.json_text(), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return two records of an instrument with a quadratic term, and the diagnosis of the first."""
    return days(tmp_path_factory.mktemp("block"), "block", QUADRATIC, (4e-4,))


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> Path:
    """Return the same with an encoder's harmonic."""
    return days(tmp_path_factory.mktemp("table"), "table", ENCODER, (3e-4, 0.4))


@pytest.mark.acceptance
def test_what_a_block_adds_is_taken_out_of_another_days_readings(folder, capsys):
    """The remainder is the part of its size that the first record leaves open."""
    out, json_file = folder / "corrected.csv", folder / "applied.json"
    command = ["apply", str(folder / "block.json"), str(folder / "block-tuesday.csv"), "--out", str(out)]
    assert main([*command, "--json", str(json_file)]) == 0
    assert "quadratic accelerometer-2: taken out of the readings" in capsys.readouterr().out
    radii = []
    for path in (folder / "block-tuesday.csv", out):
        record = read_record(path)
        assert isinstance(record, PositionRecord)
        radii.append(calibrate(record, noise_bound=SIGMA).radius)
    assert radii[0] > 3.0
    assert radii[1] < 0.3 * radii[0]
    content = json.loads(json_file.read_text(encoding="utf-8"))
    assert content["effects"] == [{"effect": "quadratic accelerometer-2", "how": "corrected"}]
    assert content["unit"] == "g"
    assert content["rms_with"] < SIGMA < content["rms_without"]


@pytest.mark.acceptance
def test_what_a_table_does_is_simulated_since_readings_cannot_be_without_it(table, capsys):
    applied: Any = th.apply(table / "table.json", table / "table-tuesday.csv")
    assert [(change.effect, change.how) for change in applied.effects] == [(ENCODER.title, "simulated")]
    assert applied.record is None
    assert applied.rms_with < SIGMA < applied.rms_without
    command = ["apply", str(table / "table.json"), str(table / "table-tuesday.csv"), "--out", str(table / "no.csv")]
    assert main(command) == 2
    assert "the diagnosis names nothing that a correction could remove" in capsys.readouterr().err
    assert not (table / "no.csv").exists()


@pytest.mark.acceptance
def test_of_several_records_another_one_has_what_is_the_instruments_and_one_of_them_its_own_too(folder):
    alone = Diagnosis.model_validate_json((folder / "block.json").read_text(encoding="utf-8"))
    (cause,) = alone.causes
    sizes = tuple(size.model_copy(update={"unit": "1/g2"}) for size in cause.parameters)
    extra = Cause(effect="cubic", where="accelerometer-1", record="monday", equivalents=(), parameters=sizes)
    digest = read_record(folder / "block-monday.csv").sha256
    records = (OneRecord(record="monday", sha256=digest, left_out=None, diagnosis=alone),)
    file, monday, tuesday = folder / "several.json", folder / "block-monday.csv", folder / "block-tuesday.csv"

    def together(*causes: Cause) -> Diagnosis:
        return alone.model_copy(update={"records": records, "causes": causes})

    file.write_text(together(cause, extra).json_text(), encoding="utf-8")
    of_one, of_all = th.apply(folder / "block.json", tuesday), th.apply(file, tuesday)
    assert of_all == of_one
    of_its_own: Any = th.apply(file, monday)
    assert [change.effect for change in of_its_own.effects] == [
        QUADRATIC.title,
        "cubic accelerometer-1",
    ]
    with pytest.raises(InputError, match="names nothing that is the instrument's"):
        th.apply(together(extra), tuesday)


def test_what_names_nothing_or_is_not_as_its_schema_says_is_refused(folder, capsys):
    good = json.loads((folder / "block.json").read_text(encoding="utf-8"))
    for name, change, why in (
        ("unnamed", {"verdict": "unexplained", "causes": []}, "the diagnosis is unexplained: it names nothing"),
        ("broken", {"calibration": 3}, "calibration: "),
    ):
        (folder / f"{name}.json").write_text(json.dumps(good | change), encoding="utf-8")
        assert main(["apply", str(folder / f"{name}.json"), str(folder / "block-tuesday.csv")]) == 2
        message = capsys.readouterr().err
        assert why in message
        assert message.count("\n") == 1


@pytest.mark.acceptance
def test_what_gyros_add_is_taken_out_of_the_increments_of_another_day():
    """The increments come near to those of the same block without the effect, moved and disturbed in the same way."""
    block = replace(draw_clean_block(77, 1, "truth").instrument, temperature=None)
    second, clean = (block.measured(7, 1, hidden) for hidden in ([Hidden(G_SENSITIVITY, TRUE_G)], []))
    cause = Cause.found(G_SENSITIVITY, (), TRUE_G, [(size - 1e-5, size + 1e-5) for size in TRUE_G])
    explanations = (Explanation.of_causes((cause,)),)
    diagnosis = Diagnosis(
        verdict="explained",
        baseline_model="nominal",
        calibration=undetermined(""),
        explanations=explanations,
        causes=(cause,),
    )
    applied: Any = applied_to(diagnosis, second, evidence_of(second))
    assert [change.how for change in applied.effects] == ["corrected"]
    with pytest.raises(th.InputError, match="of a strapdown record noise_bound"):
        th.apply(diagnosis, second, noise_bound=1e-5)

    def increments(record) -> np.ndarray:
        rates = 0.5 * (record.rate[1:] + record.rate[:-1]) if record.rate is not None else None
        return record.increment[1:] if rates is None else rates * np.diff(record.time_s)[:, None]

    wrong, remaining = (np.abs(increments(change) - increments(clean)).mean() for change in (second, applied.record))
    assert remaining < 0.05 * wrong
    assert applied.rms_with < 0.25 * applied.rms_without
