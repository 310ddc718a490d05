"""The cache between runs: damage is noticed, and foreign content is not used."""

import hashlib
import os
import pickle
from collections.abc import Callable
from pathlib import Path

import pytest

from trihedron.fmus import build, host_name
from trihedron.fmus.cache import kept
from trihedron.fmus.native.compile import compiles
from trihedron.tools.compiled import COMPILES, compiled_and_kept


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty cache."""
    monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_damaged_library_does_not_get_into_an_fmu(cache: Path, tmp_path: Path) -> None:
    if not compiles(host_name()):
        pytest.skip("nothing compiles here")
    first = build("HarmonicMotion", tmp_path / "a", flavour="native").read_bytes()
    (path,) = cache.glob("binaries/*")
    content = path.read_bytes()
    for damage in (content[:-1000], content[: len(content) // 2] + b"x" + content[len(content) // 2 + 1 :], b""):
        path.write_bytes(damage)
        assert build("HarmonicMotion", tmp_path / "b", flavour="native").read_bytes() == first
        assert path.read_bytes() == content


def test_the_cache_that_is_made_is_its_owners(cache: Path) -> None:
    old = os.umask(0)
    try:
        assert kept("things", "a", lambda: b"made") == b"made"
    finally:
        os.umask(old)
    assert (cache / "things").stat().st_mode & 0o077 == 0
    assert kept("things", "a", lambda: b"another") == b"made"


def _file_with_digest(path: Path, content: bytes) -> None:
    path.write_bytes(hashlib.sha256(content).digest() + content)


def _replace_by_link(path: Path) -> None:
    path.rename(path.with_suffix(".elsewhere"))
    path.symlink_to(path.with_suffix(".elsewhere"))


def _replace_by_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _replace_by_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.skipif(os.name == "nt", reason="files have other owners and modes there")
@pytest.mark.parametrize(
    "change",
    [
        lambda path: path.chmod(0o666),
        lambda path: path.chmod(0o620),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(path.read_bytes()[:-1]),
        _replace_by_link,
        _replace_by_pipe,
        _replace_by_folder,
    ],
)
def test_a_file_that_is_damaged_or_open_to_others_is_made_again(cache: Path, change: Callable[[Path], None]) -> None:
    assert kept("things", "a", lambda: b"made") == b"made"
    change(cache / "things" / "a")
    assert kept("things", "a", lambda: b"another") == b"another"
    assert not list((cache / "things").glob("tmp*"))


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives a file away")
def test_a_file_of_another_user_is_made_again(cache: Path) -> None:
    assert kept("things", "a", lambda: b"made") == b"made"
    os.chown(cache / "things" / "a", 12345, 12345)
    assert kept("things", "a", lambda: b"another") == b"another"


def test_a_file_in_the_place_of_the_cache(cache: Path) -> None:
    cache.write_text("no folder")
    assert kept("things", "a", lambda: b"made") == b"made"


class _Bomb:
    """An object whose pickle makes a file when it is loaded."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, (str(self.path),)


def _triple(x):
    return 3.0 * x


@pytest.mark.acceptance
@pytest.mark.skipif(not COMPILES, reason="needs numba")
def test_damaged_machine_code_is_compiled_again(cache: Path, tmp_path: Path) -> None:
    """Code of numba is only in the checked cache; no content of it ends a call."""
    assert compiled_and_kept(_triple)(2.0) == 6.0
    (path,) = cache.glob("code/*")
    content = path.read_bytes()
    bomb = tmp_path / "bomb"
    for damage in (b"", content[:-7], hashlib.sha256(b"x").digest() + pickle.dumps(_Bomb(bomb))):
        path.write_bytes(damage)
        assert compiled_and_kept(_triple)(2.0) == 6.0
        assert path.read_bytes()[:-1] != damage[:-1]
    _file_with_digest(path, pickle.dumps(_Bomb(bomb)))
    path.chmod(0o666)
    assert compiled_and_kept(_triple)(2.0) == 6.0
    assert not bomb.exists()
    for wrong in (b"", b"no pickle", pickle.dumps((1, 2, 3)), pickle.dumps({"a": 1})):
        _file_with_digest(path, wrong)
        assert compiled_and_kept(_triple)(2.0) == 6.0
    assert not list(Path(__file__).parent.glob("__pycache__/*.nb[ic]"))
