"""Mutated .fmu and .ssp files: one clear line each, no leftovers, nothing written elsewhere."""

import random
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest

import trihedron as th
from archive_mutations import OF_ANY, OF_FMUS, OF_SSPS, Members, Mutation, countless, packed
from foreign_fmus import build_foreign
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Scenario
from trihedron.tools.ssp import write_ssp

DESCRIPTIONS = {"fmu": "modelDescription.xml", "ssp": "SystemStructure.ssd"}
KINDS: list[tuple[str, Mutation]] = [
    *(("fmu", mutation) for mutation in (*OF_ANY, *OF_FMUS)),
    *(("ssp", mutation) for mutation in (*OF_ANY, *OF_SSPS)),
]
MANY = 500

Bases = dict[str, Members]


@pytest.fixture(scope="module")
def bases(tmp_path_factory: pytest.TempPathFactory) -> Bases:
    """Return the members of a good .fmu and of a good .ssp of two, the platform's binaries only."""
    folder = tmp_path_factory.mktemp("good")
    for script in ("foreign_gain", "foreign_clock"):
        archive_bytes = build_foreign(script, folder)
        with zipfile.ZipFile(archive_bytes) as archive:
            members = {
                name: archive.read(name)
                for name in archive.namelist()
                if not name.startswith("binaries/") or f"/{fmpy.platform}/" in name
            }
        archive_bytes.write_bytes(packed(members))
    scenario = Scenario.model_validate(
        {
            "run": {"step_s": 0.1, "stop_s": 1.0},
            "fmus": {
                "gain": {"fmu": "Gain.fmu", "parameters": {"gain": 2.0, "times": 3}},
                "clock": {"fmu": "Clock.fmu"},
                "table": {"component": "TurntableMotion", "parameters": {"kappa": 1e-3}},
            },
            "connections": [{"from": "clock.ended", "to": "gain.u[1]"}],
            "base_folder": folder,
        }
    )
    archives: Bases = {}
    for kind, path in (("fmu", folder / "Gain.fmu"), ("ssp", write_ssp(scenario, folder / "good.ssp"))):
        with zipfile.ZipFile(path) as archive:
            archives[kind] = {name: archive.read(name) for name in archive.namelist()}
    return archives


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, bytes], str]:
    """Run an archive that must be refused; return the line with the reason."""
    temporary, work = tmp_path / "temporary", tmp_path / "work"
    temporary.mkdir()
    work.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.chdir(work)

    def run(kind: str, content: bytes) -> str:
        archive = work / f"mutated.{kind}"
        archive.write_bytes(content)
        start = archive
        if kind == "fmu":
            start = work / "scenario.toml"
            fmu = '[fmus.a]\nfmu = "mutated.fmu"\n'
            start.write_text(f'schema = "trihedron.scenario/1"\n[run]\nstep_s = 0.1\nstop_s = 1.0\n{fmu}')
        before = everything(tmp_path)
        with pytest.raises(InputError) as error:
            th.simulate(start, out=work / "out")
        assert everything(tmp_path) == before
        message = str(error.value)
        assert "\n" not in message
        assert len(message) < 1000
        assert archive.name in message
        return message

    return run


def everything(folder: Path) -> list[str]:
    return sorted(str(path) for path in folder.rglob("*"))


def escaped() -> list[Path]:
    return list(Path("/tmp").glob("escaped*"))


@pytest.mark.acceptance
def test_what_is_mutated_is_good(bases, tmp_path):
    for kind in ("fmu", "ssp"):
        (tmp_path / f"good.{kind}").write_bytes(packed(bases[kind]))
    (tmp_path / "good.toml").write_text(
        'schema = "trihedron.scenario/1"\n[run]\nstep_s = 0.1\nstop_s = 1.0\n[fmus.a]\nfmu = "good.fmu"\n'
    )
    for name in ("good.toml", "good.ssp"):
        assert th.simulate(tmp_path / name, out=tmp_path / "out").files


@pytest.mark.parametrize(("kind", "mutation"), KINDS, ids=lambda value: getattr(value, "__name__", value))
def test_each_kind_of_damage_is_refused(bases, refused, kind, mutation):
    for seed in range(2):
        refused(kind, mutation(bases[kind], DESCRIPTIONS[kind], random.Random(seed)))
    assert escaped() == []


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["fmu", "ssp"])
def test_countless_members_are_refused(bases, refused, kind):
    assert "20000 files" in refused(kind, countless(bases[kind], DESCRIPTIONS[kind], random.Random(0)))


@pytest.mark.acceptance
def test_five_hundred_mutations_are_refused(bases, refused):
    message, ran = set(), []
    for seed in range(MANY):
        kind, mutation = KINDS[seed % len(KINDS)]
        try:
            message.add(refused(kind, mutation(bases[kind], DESCRIPTIONS[kind], random.Random(1000 + seed))))
        except pytest.fail.Exception:
            ran.append((kind, mutation.__name__, 1000 + seed))
    assert not ran, ran
    assert escaped() == []
    print(f"{MANY} mutated archives refused, {len(message)} different lines")
