"""The guide to a new effect: its example works unchanged."""

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from effect_readings import readings, true_bench
from trihedron.fmus import build
from trihedron.models.effects import CATALOGUE, Effect

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "add-an-effect.md"


@pytest.fixture
def example(tmp_path, monkeypatch) -> Effect:
    """The effect of the guide, in the catalogue for the length of a test."""
    (code,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), flags=re.DOTALL)
    path = tmp_path / "effect_of_the_guide.py"
    path.write_text(code, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, path.stem, module)
    spec.loader.exec_module(module)
    monkeypatch.setitem(CATALOGUE, module.EFFECT.name, module.EFFECT)
    return module.EFFECT


def test_the_example_of_the_guide_is_an_effect(example, tmp_path):
    """The components read it, its signature shows it, and it is exported."""
    for place in example.places:
        up, down = (readings({place: (size,)}) for size in (1e-3, -1e-3))
        column = example.signature(place, true_bench()[1])[..., 0]
        assert np.abs((up - down) / 2e-3 - column).max() < 1e-12
    path = build(example.component or "", tmp_path, example.places[:1])
    assert path.name == "AccelerometerBlock.fmu"
    assert "bends at half of gravity" in example.sentence(example.places[0], {"coefficient": 1e-3})
