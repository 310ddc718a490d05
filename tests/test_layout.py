"""The root is the package: every module has one name, with any loader."""

import ast
import importlib
import pkgutil
import sys
from pathlib import Path

import pytest

import trihedron

ROOT = Path(__file__).resolve().parents[1]
FACE = ROOT / "__init__.py"
PARTS = ("models", "fmus", "tools", "scenarios")


def names() -> list[str]:
    """Return the import names of all modules of the product."""
    result = pkgutil.walk_packages([str(ROOT)], "trihedron.")
    parts = [module.name.split(".") for module in result]
    # A module that is run is not imported.
    return [".".join(p) for p in parts if p[1] in PARTS and p[-1] != "__main__"]


def loaded_twice() -> list[str]:
    """Return the files of the product that are loaded under two names."""
    observed: dict[Path, str] = {}
    twice = []
    for name, module in sorted(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file is None or (not any(ROOT / part in Path(file).parents for part in PARTS) and Path(file) != FACE):
            continue
        first = observed.setdefault(Path(file).resolve(), name)
        if first != name:
            twice.append(f"{file}: {first} and {name}")
    return twice


def test_no_module_is_loaded_under_two_names():
    for name in names():
        importlib.import_module(name)
    assert Path(str(trihedron.__file__)) == ROOT / "__init__.py"
    assert loaded_twice() == []


@pytest.mark.acceptance
def test_a_module_loaded_under_two_names_is_seen(monkeypatch):
    import trihedron.tools.errors as errors

    monkeypatch.setitem(sys.modules, "tools.errors", errors)
    assert len(loaded_twice()) == 1


def test_every_name_of_a_package_s_face_is_there():
    """`__init__.pyi` lists the names that a package offers to upper floors; each is loaded on request."""
    faces = sorted(ROOT.glob("tools/*/__init__.pyi"))
    assert len(faces) > 10
    for face in faces:
        package = importlib.import_module(f"trihedron.tools.{face.parent.name}")
        assert package.__all__
        for name in package.__all__:
            assert getattr(package, name) is not None


def test_no_two_files_of_tests_have_the_same_name():
    """Pytest imports them by their names alone."""
    names = [file.name for file in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(set(names)) == sorted(names)


def large_factors(source: str) -> list[int]:
    """Return the lines that call `svd` and do not say which factors they want: the default makes a square one."""
    lines = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        keywords = {keyword.arg for keyword in node.keywords}
        if name == "svd" and not keywords & {"full_matrices", "compute_uv"}:
            lines.append(node.lineno)
    return lines


def test_no_svd_makes_a_large_factor_unasked():
    for part in PARTS:
        for path in sorted((ROOT / part).rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            lines = large_factors(source) if "svd" in source else []
            assert lines == [], f"{path}: give full_matrices or compute_uv to svd"


def test_an_svd_with_a_large_factor_is_seen():
    assert large_factors("np.linalg.svd(a)\nsvd(a, full_matrices=False)\nnp.linalg.svd(a, compute_uv=False)") == [1]
