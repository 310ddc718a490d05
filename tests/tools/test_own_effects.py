"""A file of the user's own effects: equal to the catalogue if it is correct, one line if it is not."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

import trihedron as th
from trihedron.fmus import host_compiler
from trihedron.models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS
from trihedron.tools import cli
from trihedron.tools.bounded import Work
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import bench_evidence
from trihedron.tools.own_effects import OwnEffects, with_effects_of
from trihedron.tools.own_effects.file import check_effect

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "add-an-effect.md"
(EXAMPLE,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), flags=re.DOTALL)
KNOWN = [effect for effect in CATALOGUE.values() if effect.kernel is not None]


@pytest.fixture(autouse=True)
def catalogue(monkeypatch):
    """Restore the catalogue after each test."""
    before = dict(CATALOGUE)
    yield
    CATALOGUE.clear()
    CATALOGUE.update(before)


def written(folder: Path, text: str = EXAMPLE) -> Path:
    path = folder / "half_scale.py"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.first(20)
@pytest.mark.parametrize("effect", KNOWN, ids=lambda effect: effect.name)
def test_every_effect_of_the_catalogue_passes_what_is_asked_of_others(effect):
    assert check_effect("the catalogue", effect) is effect


def test_it_is_tried_within_the_block_and_not_behind_it(tmp_path):
    before = dict(POSITION_EFFECTS), dict(STRAPDOWN_EFFECTS)
    with with_effects_of(written(tmp_path)) as effects:
        assert effects is not None
        assert "half-scale" in POSITION_EFFECTS
        assert CATALOGUE["half-scale"] is POSITION_EFFECTS["half-scale"]
        with with_effects_of(effects):
            assert "half-scale" in POSITION_EFFECTS
        assert "half-scale" in POSITION_EFFECTS
    assert (dict(POSITION_EFFECTS), dict(STRAPDOWN_EFFECTS)) == before
    with with_effects_of(None) as none:
        assert none is None


@pytest.mark.acceptance
def test_it_is_among_what_a_record_is_tried_with(tmp_path):
    """It mends a record in which it is hidden, at its place and at no other."""
    path = written(tmp_path)
    record = th.hide(3, "half-scale", effects_from=path)
    hidden = record.secret["hidden"]
    with with_effects_of(path):
        evidence = bench_evidence(record.record, noise_bound=1e-5)
        effects = [place for place in evidence.rows.places if place.effect == "half-scale"]
        assert len(effects) == 3
        assert set(effects) <= set(evidence.model.classes.places)
        (right,) = [place for place in effects if place.where == hidden["where"]]
        (fit,) = evidence.model.mended([right], Work())
        assert fit.values()[0][0] == pytest.approx(hidden["parameters"]["coefficient"], rel=0.2)
        assert not any(evidence.model.mended([place], Work()) for place in effects if place != right)


SCENARIO = """
schema = "trihedron.scenario/1"
title = "an effect of a user's own"
run = {step_s = 0.01, stop_s = 0.05}
[fmus.block]
component = "AccelerometerBlock"
effects = [{effect = "half-scale", where = "accelerometer-3", coefficient = 1e-3}]
parameters = {specific_force = [0.0, 0.0, 9.80665]}
[record]
columns = {f3_mps2 = "block.reading[3]"}
"""


@pytest.mark.acceptance
def test_a_scenario_may_name_it_and_runs_nothing_by_itself(tmp_path, monkeypatch, capsys):
    """The file is run only where the user names it; another text is another component."""
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENARIO, encoding="utf-8")
    path = written(tmp_path)
    assert cli.main(["simulate", "s.toml", "--out", "run"]) == 2
    assert "effect 'half-scale' is not one that extends a component" in capsys.readouterr().err
    readings = []
    for text in (EXAMPLE, EXAMPLE.replace("(n[p] - 0.5", "(n[p] - 0.25")):
        path.write_text(text, encoding="utf-8")
        run = th.simulate("s.toml", effects_from=path)
        readings.append(float(run["f3_mps2"][-1]) / 9.80665)
    assert readings == pytest.approx([1.0 + 0.5e-3, 1.0 + 0.75e-3], abs=1e-9)


@pytest.mark.parametrize("flavour", ["python", "native"])
def test_it_is_exported_as_part_of_a_component(flavour, tmp_path):
    if flavour == "native" and host_compiler() is None:
        pytest.skip("no C compiler")
    path, out = written(tmp_path), tmp_path / "out"
    process = th.export(effects=["half-scale accelerometer-3"], effects_from=path, flavour=flavour, out=out)
    assert [fmu.component for fmu in process.fmus] == ["AccelerometerBlock"]


def changed(old: str, new: str) -> str:
    assert old in EXAMPLE
    return EXAMPLE.replace(old, new)


KERNEL = "added[p] = added[p] + coefficient * math.fabs(n[p] - 0.5)"
WRONG = {
    "": "gives neither EFFECT nor EFFECTS",
    "EFFECT = 1": "EFFECT is a int; accelerometer_effect",
    "EFFECTS = []": "EFFECTS is empty",
    "EFFECTS = 'x'": "EFFECTS is a str; it is a tuple of effects",
    "EFFECTS = (1,)": r"EFFECTS\[0\] is a int",
    "def f(:\n": "half_scale.py, line 1: is not Python",
    "x = 1\n1/0\n": "half_scale.py, line 2: ZeroDivisionError: division by zero",
    "import nothing_of_this_name": "line 1: ModuleNotFoundError",
    "raise SystemExit(3)": "line 1: SystemExit: 3",
    "from .definition import Effect": "line 1: ImportError",
    "\x00": "is not Python",
    changed(KERNEL, "added[p] = added[p] + coefficient * abs(n[p] - 0.5)"): "line 9: .*kernel .*abs.*restricted Python",
    changed(KERNEL, "added[p] = added[p] + coefficient * (n[p] - 0.5)**2"): "half_scale.py, line 11: .*Pow",
    changed(KERNEL, "added[p] = added[p] + coefficient * coefficient * math.fabs(n[p] - 0.5)"): "is not linear",
    changed(KERNEL, "added[p] = added[p] + math.fabs(n[p] - 0.5)"): "adds something where its parameters are zero",
    changed(KERNEL, "added[p] = added[p] + coefficient / 0.0"): "kernel raises ZeroDivisionError",
    changed(KERNEL, "added[p] = added[p] + 0.0 * coefficient"): "kernel adds nothing on any row",
    changed("EffectParameter, accelerometer_effect", "EffectParameter, accelerometer_effect, own_input"): "leave away",
    changed(
        '    "the response of', '    lambda place, rows: abs(rows.n[:, place.index] - 0.5),\n    "the response of'
    ): "leave away",
    changed('(n in g)",', '(n in g)",\n    needs=("temperature",),'): "leave away",
    changed('(n in g)",', '(n in g)",\n    columns=lambda place, rows: 1 / 0,'): "columns raises ZeroDivisionError",
    changed(
        '(n in g)",', '(n in g)",\n    columns=lambda place, rows: rows.n[:, :, None],'
    ): "columns says .* have to agree",
    "ROUNDING = 0.5\n" + changed("n[p] - 0.5", "n[p] - ROUNDING"): "uses ROUNDING, which another kernel .* rename it",
    changed("p: int, ", ""): "line 9: effect half-scale: kernel cannot be carried to an FMU: .* uses p",
    changed('"1", "c of', '"parsec", "c of'): "parameter coefficient has the unit 'parsec'",
    changed("1e-2),", "-1e-2),"): "has largest = -0.01; a finite number above 0",
    changed("1e-2),", "float('inf')),"): "has largest = inf",
    changed("1e-2),", "1e-2, smallest=1.0),"): "has smallest = 1.0; a number below 0.01",
    changed('EffectParameter("coefficient"', 'EffectParameter("The Coefficient"'): "have the name 'The Coefficient'",
    changed("{coefficient:+.2e}", "{size:+.2e}"): "sentence raises KeyError",
    EXAMPLE.replace("half_scale", "quadratic"): "quadratic is an effect of the catalogue; take another name",
    EXAMPLE + "\nimport dataclasses\nEFFECT = dataclasses.replace(EFFECT, places=())": "places are not a tuple",
    EXAMPLE + "\nimport dataclasses\nEFFECT = dataclasses.replace(EFFECT, stage='x')": "component and stage are",
    EXAMPLE + "\nimport dataclasses\nEFFECT = dataclasses.replace(EFFECT, name='Half')": "name is not in small letters",
    EXAMPLE + "\nimport dataclasses\nEFFECT = dataclasses.replace(EFFECT, kernel=None)": "kernel is None",
    EXAMPLE + "\nimport dataclasses\nEFFECTS = (EFFECT, dataclasses.replace(EFFECT))": "half-scale stands there twice",
    EXAMPLE
    + "\nfrom dataclasses import replace\nEFFECT = replace(EFFECT, parameters=EFFECT.parameters * 2)": "a name twice",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_what_is_wrong_is_said_in_one_line(text, tmp_path):
    path, before = written(tmp_path, text), dict(CATALOGUE)
    effects = OwnEffects.read(path)
    assert effects is not None
    with pytest.raises(InputError, match=WRONG[text]) as refusal:
        effects.effects()
    output = str(refusal.value)
    assert output.isprintable()
    assert "half_scale.py" in output
    assert dict(CATALOGUE) == before


def test_what_is_no_file_of_effects_is_refused_too(tmp_path, capsys):
    written(tmp_path)
    for name, says in (
        ("half_scal.py", "did you mean 'half_scale.py'"),
        (".", "is a directory; a file of effects is needed"),
        ("x" * 300, "cannot"),
    ):
        command = ["diagnose", "none.csv", "--effects-from", str(tmp_path / name)]
        with pytest.raises(InputError, match=says):
            OwnEffects.read(command[-1])
    (tmp_path / "b.py").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="is not UTF-8 text"):
        OwnEffects.read(tmp_path / "b.py")
    assert cli.main(["export", "--effects-from", str(tmp_path / "half_scal.py")]) == 2
    output = capsys.readouterr().err
    assert output.count("\n") == 1
    assert "no such file; did you mean" in output


def test_an_unknown_way_of_acting_is_checked(tmp_path):
    """The variants of an effect that is not linear must have the correct type."""
    dead = CATALOGUE["dead-zone"]
    with pytest.raises(InputError, match="variants give no list of Variant"):
        check_effect("x.py", replace(dead, variants=lambda *given: [1]))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="variants raises ZeroDivisionError"):
        check_effect("x.py", replace(dead, variants=lambda *given: 1 / 0))  # type: ignore[arg-type]


@pytest.mark.first(1)
@pytest.mark.parametrize("way", ["--answer", "--json", "second name", "record"])
def test_no_output_replaces_the_file_of_effects(way, tmp_path, capsys):
    path = written(tmp_path)
    content, target = path.read_bytes(), path
    if way == "second name":
        target = tmp_path / "other.json"
        target.hardlink_to(path)
    words = ["hidden", str(tmp_path / "record.csv"), "--seed", "3", "--effects-from", str(path)]
    if way == "record":
        words[1] = str(target)
    else:
        words += [way if way.startswith("--") else "--json", str(target)]
    assert cli.main(words) == 2
    assert "trihedron: " in capsys.readouterr().err
    assert path.read_bytes() == content
