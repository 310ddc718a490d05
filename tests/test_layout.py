"""Packages import one way: models <- fmus <- tools."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FORBIDDEN = {
    "models": lambda name: name.startswith("trihedron") and not name.startswith("trihedron.models"),
    "fmus": lambda name: name.startswith("trihedron") and not name.startswith(("trihedron.models", "trihedron.fmus")),
    "scenarios": lambda name: name.startswith("trihedron"),
}


def imported(path: Path) -> set[str]:
    """Modules that a file imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
    return names


@pytest.mark.parametrize("folder", sorted(FORBIDDEN))
def test_packages_import_one_way(folder):
    files = sorted((ROOT / folder).rglob("*.py"))
    assert files
    wrong = [(str(path), name) for path in files for name in imported(path) if FORBIDDEN[folder](name)]
    assert wrong == []


def test_models_know_no_fmi_and_no_files():
    outside = {"fmpy", "pythonfmu", "polars", "pydantic", "highspy", "pathlib", "os", "io", "json", "rich"}
    wrong = [
        (str(path), name)
        for path in sorted((ROOT / "models").rglob("*.py"))
        for name in imported(path)
        if name.split(".")[0] in outside
    ]
    assert wrong == []
