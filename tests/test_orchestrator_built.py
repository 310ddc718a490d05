"""FMUs of components in runs: native where something compiles, kept by content, never believed when damaged."""

from pathlib import Path

import pytest

from trihedron.fmus.native.compile import host_compiler
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import load, loops, simulate
from trihedron.tools.orchestrator.scenario import Scenario


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own."""
    monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def run(flavour: str | None = None):
    data = {
        "run": {"stop_s": 1.0, "step_s": 0.1},
        "fmus": {"c": {"component": "AccelerometerCompensation", "flavour": flavour}},
        "stimuli": [{"to": "c.reading", "constant": [0.1, 0.2, 9.7]}],
    }
    return simulate(Scenario.model_validate(data))


def test_both_flavours_give_the_same_bits() -> None:
    if host_compiler() is None:
        pytest.skip("needs a C compiler")
    python, native, usual = run("python"), run("native"), run()
    assert python.table.equals(native.table)
    hashes = [r.provenance["fmus"]["c"]["sha256"] for r in (python, native, usual)]
    assert hashes[0] != hashes[1] == hashes[2]


def test_without_a_compiler_components_run_as_python(monkeypatch: pytest.MonkeyPatch) -> None:
    python = run("python").provenance["fmus"]["c"]["sha256"]
    monkeypatch.setattr(load, "usual_flavour", lambda: "python")
    assert run().provenance["fmus"]["c"]["sha256"] == python


def test_a_kept_fmu_is_used_again_unless_it_is_damaged(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = run("python")
    (kept,) = cache.glob("fmus/*/*.fmu")
    content = kept.read_bytes()
    kept.write_bytes(content[:-100] + bytes(100))
    assert run("python").table.equals(first.table)
    assert kept.read_bytes() == content

    def no_build(*_: object, **__: object) -> None:
        raise AssertionError("built again")

    monkeypatch.setattr(load, "build", no_build)
    assert run("python").table.equals(first.table)


def test_damaged_machine_code_is_made_again(cache: Path) -> None:
    loops.compiled_march.cache_clear()
    loops.compiled_march()
    (kept,) = cache.glob("loops/*.o")
    content = kept.read_bytes()
    kept.write_bytes(content[:-8] + bytes(8))
    loops.compiled_march.cache_clear()
    loops.compiled_march()
    assert kept.read_bytes() == content


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "taken").write_text("a file")
    monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "taken"))
    assert run("python").table.height == 11


def test_a_flavour_belongs_to_a_component() -> None:
    with pytest.raises(ValueError, match="flavour belongs to a component"):
        Scenario.model_validate({"run": {"step_s": 1.0}, "fmus": {"c": {"fmu": "c.fmu", "flavour": "native"}}})


def test_native_is_refused_where_nothing_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    from trihedron.fmus.native.compile import BuildError

    def fails(*_: object, **__: object) -> None:
        raise BuildError("there is no C compiler here")

    monkeypatch.setattr(load, "build", fails)
    with pytest.raises(InputError, match=r"^fmus\.c\.flavour: there is no C compiler here$"):
        run("native")
