"""Fixtures that several tests share."""

import gc
import os
import shlex
import shutil
import signal
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

pytest_plugins = ("browser",)

COMPILED_AS_SHIPPED = {
    *("acceptance", "benchmarks", "test_bits", "test_capabilities", "test_installation", "test_loops"),
    *("test_native_conformance", "test_native_platforms", "test_native_translation", "test_prebuilt"),
}
"""Folders and modules of tests that need the C compiler's optimisation."""

# The time of an example depends on the load of the machine.
settings.register_profile("no deadlines", deadline=None)
settings.load_profile("no deadlines")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options that limit the cases of each long test, and that keep measured costs."""
    parser.addoption("--cases", type=int, help="run at most so many long cases of each test, spread over all its cases")
    parser.addoption(
        "--costs", type=Path, metavar="DOCS", help="write measured costs into the tables of DOCS/figures.md"
    )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark cases after the first n of a test with `first(n)` as long; of each long test keep `--cases`."""
    counts = Counter[str]()
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        name = item.nodeid.partition("[")[0]
        for marker in item.iter_markers("first"):
            counts[name] += 1
            if counts[name] > marker.args[0]:
                item.add_marker(pytest.mark.acceptance)
        if item.get_closest_marker("acceptance"):
            cases.setdefault(name, []).append(item)
    limit = config.getoption("cases")
    if limit is None:
        return
    dropped = set[pytest.Item]()
    for members in cases.values():
        kept = {len(members) * index // limit for index in range(limit)}
        dropped.update(item for index, item in enumerate(members) if index not in kept)
    config.hook.pytest_deselected(items=list(dropped))
    items[:] = [item for item in items if item not in dropped]


def pytest_collection_finish() -> None:
    """Freeze modules and tests, so that the collector of cycles does not traverse them again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)


@pytest.fixture(scope="session", autouse=True)
def _ctrl_c_is_heard() -> None:
    """Restore SIGINT, which a shell's background job ignores and passes on to its children."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep binaries from run to run, by the hash of all their sources, unless a cache is named.

    If others could put files beside them, they are kept only for this run, for all its workers.
    """
    from trihedron.fmus.cache import others_can_write

    base = tmp_path_factory.getbasetemp()
    shared = base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base
    build = Path(__file__).resolve().parents[1] / "build"
    folder = shared if others_can_write(build) else build
    os.environ.setdefault("TRIHEDRON_CACHE", str(folder / "test-cache"))


@pytest.fixture(scope="session")
def _hasty_compiler(tmp_path_factory: pytest.TempPathFactory) -> Path | None:
    """Return the host's C compiler without its slow optimisation; None without a compiler."""
    real = shutil.which(os.environ.get("CC") or "cc")
    if real is None or os.name != "posix":
        return None
    path = tmp_path_factory.mktemp("compiler") / "cc"
    # Its version differs, so that the cache separates the products of the two.
    path.write_text(
        f'#!/bin/sh\nif [ "$1" = --version ]; then echo hasty; fi\nexec {shlex.quote(real)} "$@" -O0\n',
        encoding="utf-8",
    )
    path.chmod(0o755)
    return path


@pytest.fixture(scope="module", autouse=True)
def _compiler(request: pytest.FixtureRequest, _hasty_compiler: Path | None) -> Iterator[None]:
    """Compile native FMUs hastily where their machine code is not tested."""
    from trihedron.fmus import host_compiler

    with pytest.MonkeyPatch.context() as patch:
        if _hasty_compiler and not COMPILED_AS_SHIPPED & {request.path.parent.name, request.path.stem}:
            patch.setenv("CC", str(_hasty_compiler))
        host_compiler.cache_clear()
        yield
    host_compiler.cache_clear()


@pytest.fixture(scope="session", autouse=True)
def _interpreters_let_go_in_time() -> Iterator[None]:
    """Release Python in time: PythonFMU's library otherwise writes into freed memory at the end of a process."""
    import fmpy.fmi1

    unload = fmpy.fmi1._FMU.freeLibrary

    def let_go(fmu: fmpy.fmi1._FMU) -> None:
        with suppress(AttributeError):
            fmu.dll["finalizePythonInterpreter"]()
        unload(fmu)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fmpy.fmi1._FMU, "freeLibrary", let_go)
        yield


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a folder for the path with a `trihedron` that starts at once."""
    from warm_commands import warm_commands

    with warm_commands(tmp_path_factory.mktemp("programs"), os.environ) as folder:
        yield folder


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make figures without drawing them, for tests of the text beside them."""
    monkeypatch.setattr("trihedron.tools.reports.pictures.svg_text", lambda figure, label: "<svg />")


@pytest.fixture(scope="session")
def fmu_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMU of every component."""
    from trihedron.fmus import build, component_names

    folder = tmp_path_factory.mktemp("fmus")
    for name in component_names():
        build(name, folder)
    return folder


@pytest.fixture
def slaves() -> Iterator[object]:
    """`slaves(path, name)` instantiates an FMU through FMPy; everything is freed at the end of the test."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    opened: list[FMU2Slave] = []
    folders: list[str] = []

    def open_slave(path: Path, name: str = "instance") -> FMU2Slave:
        description = fmpy.read_model_description(path)
        assert description.coSimulation is not None
        folder = str(fmpy.extract(path))
        slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        slave.instantiate()
        slave.description = description  # type: ignore[attr-defined]
        opened.append(slave)
        folders.append(folder)
        return slave

    yield open_slave
    for slave in opened:
        slave.freeInstance()
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def command_inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the input files of the commands of `command_table`; tests copy them and never use them directly."""
    from command_table import make_inputs

    folder = tmp_path_factory.mktemp("inputs")
    make_inputs(folder)
    return folder


@pytest.fixture
def here(command_inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set the current folder, with the commands' inputs in it; temporary files go beside it."""
    folder = tmp_path / "here"
    shutil.copytree(command_inputs, folder)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    monkeypatch.chdir(folder)
    return folder
