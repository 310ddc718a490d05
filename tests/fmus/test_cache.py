"""What is kept between runs: damage is noticed, what others could have put there is not used."""

import os
from pathlib import Path

import pytest

from trihedron.fmus import build, host_name
from trihedron.fmus.cache import kept
from trihedron.fmus.native.compile import compiles


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own."""
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
