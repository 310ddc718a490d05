"""The picture of the architecture is that of the code; nothing imports in a circle."""

from pathlib import Path

import pytest

from trihedron.tools.architecture import architecture, architecture_picture, direct, layers

ROOT = Path(__file__).resolve().parents[1]


def test_the_picture_is_up_to_date():
    picture = ROOT / "docs" / "pictures" / "architecture.svg"
    assert picture.read_text(encoding="utf-8") == architecture_picture(ROOT), "run `make docs`"


def test_no_packages_import_one_another():
    rows, _ = layers(direct(architecture(ROOT)))
    named = [[name for name in row if ">" not in name] for row in rows]
    assert "models" in named[0]
    assert named[-1] == ["command line"]
    assert sum(map(len, named)) == len(architecture(ROOT))


def test_every_package_is_in_it():
    packages = {file.parent.name for file in (ROOT / "tools").glob("*/__init__.py")}
    assert packages | {"models", "fmus"} <= set(architecture(ROOT))


def test_a_circle_is_named():
    graph = {"a": frozenset("b"), "b": frozenset("c"), "c": frozenset("a")}
    with pytest.raises(ValueError, match="import one another"):
        direct(graph)


def test_what_is_reached_through_others_is_not_drawn():
    graph = {"a": frozenset("bc"), "b": frozenset("c"), "c": frozenset()}
    assert direct(graph) == {"a": frozenset("b"), "b": frozenset("c"), "c": frozenset()}
    assert layers(graph)[1] == [["a", "b"], ["a", "a>c>1", "c"], ["b", "c"]]
