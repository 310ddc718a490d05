"""The content of a wheel: every package and every file that the program reads; one version everywhere."""

import re
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import trihedron

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SETTINGS = PROJECT["tool"]["setuptools"]
FOLDERS = ("models", "fmus", "tools", "scenarios")
NOT_SHIPPED = ("__pycache__", "prebuilt")


def packages() -> dict[str, Path]:
    """Return the import names of the folders with an __init__.py."""
    result = [ROOT, *(file.parent for folder in FOLDERS for file in (ROOT / folder).rglob("__init__.py"))]
    return {".".join(["trihedron", *folder.relative_to(ROOT).parts]): folder for folder in result}


def test_every_package_is_declared():
    assert SETTINGS["package-dir"] == {"trihedron": "."}
    assert sorted(SETTINGS["packages"]) == sorted(packages())


def test_every_file_that_is_read_is_declared():
    catalogue = packages()
    missing = []
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_dir() or path.suffix in (".py", ".pyc") or set(path.parts) & set(NOT_SHIPPED):
                continue
            inside = [name for name, at in catalogue.items() if at in path.parents]
            name = max(inside, key=lambda name: len(catalogue[name].parts))
            patterns = [*SETTINGS["package-data"]["*"], *SETTINGS["package-data"].get(name, [])]
            relative = path.relative_to(catalogue[name]).as_posix()
            if not any(fnmatch(relative, p) and relative.count("/") == p.count("/") for p in patterns):
                missing.append(f"{name}: {relative}")
    assert missing == []


def test_one_version():
    """pyproject.toml has the version; all other places agree."""
    version = PROJECT["project"]["version"]
    assert trihedron.__version__ == version
    assert re.search(rf"(?m)^version: {re.escape(version)}$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    first = re.search(r"(?m)^## (\d\S*)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    assert first is not None
    assert first[1] == version


def test_what_the_doctor_looks_for_is_what_is_installed():
    from trihedron.tools.installation import CORE, EXTRAS

    assert set(CORE) == {Requirement(text).name for text in PROJECT["project"]["dependencies"]}
    extras = PROJECT["project"]["optional-dependencies"]
    for extra, names in EXTRAS.items():
        if extra not in extras:
            pytest.fail(f"there is no extra {extra}")
        assert set(names) <= {Requirement(text).name for text in extras[extra]}, extra


def test_nothing_ignores_a_python_version_that_is_promised():
    promised = {text.rpartition(" ")[2] for text in PROJECT["project"]["classifiers"] if ":: 3." in text}
    assert promised == {"3.11", "3.12", "3.13"}
    assert PROJECT["project"]["requires-python"] == ">=3.11"
