"""Proofs that so many positions cannot reach a ratio: their check agrees with the bench's model and refuses others."""

import json
from importlib import resources
from itertools import product
from typing import Any

import numpy as np
import pytest

from planning_tasks import stored, tables_task
from trihedron.models.bench import TARGETS as SYMBOLS
from trihedron.models.bench import admissible, regressors
from trihedron.tools.check.checked import check
from trihedron.tools.errors import InputError
from trihedron.tools.planning import proof
from trihedron.tools.planning.forms import x_from_targets
from trihedron.tools.planning.positions import costs
from trihedron.tools.planning.proof import Proof
from trihedron.tools.planning.proof_search import Cells, prove

SHIPPED = sorted(
    (entry for entry in resources.files("trihedron.tools.planning").joinpath("proofs").iterdir()),
    key=lambda entry: entry.name,
)


def content_of(name: str = "positions-07.json") -> dict[str, Any]:
    return json.loads(resources.files("trihedron.tools.planning").joinpath("proofs", name).read_text(encoding="utf-8"))


def verify(content: dict[str, Any]) -> None:
    Proof.model_validate_json(json.dumps(content), strict=True).verify()


def caps(positions: int) -> dict[str, Any]:
    """Every scale factor needs a position near a pole of its accelerometer: no position is near two."""
    content, ratio = content_of(), 1.1
    costs = {plan["target"]: plan["cost"] for plan in content["optima"]}
    cuts = []
    for target, plus, minus, bias in (("X4", 3, 4, 15), ("X9", 8, 9, 16), ("X14", 13, 14, 17)):
        y = [0.0] * 18
        y[plus], y[minus], y[bias] = ratio * costs[target] + 1e-6, -ratio * costs[target], -0.95
        cuts.append({"target": target, "y": y})
    nodes = [{"cuts": [[0, 0, 1], [1, 0, 1], [2, 0, 1]]}]
    return content | {
        "positions": positions,
        "ratio": ratio,
        "quarter_deg": [5, 11, 20, 32, 45],
        "cuts": cuts,
        "nodes": nodes,
    }


def test_two_positions_are_near_two_of_three_axes_at_most() -> None:
    verify(caps(2))
    with pytest.raises(InputError, match="can hit all cuts"):
        verify(caps(3))


@pytest.mark.parametrize("entry", SHIPPED, ids=lambda entry: entry.name)
def test_shipped_proofs_hold_and_contradict_no_set_that_is_known(entry: Any) -> None:
    content = json.loads(entry.read_text(encoding="utf-8"))
    verify(content)
    worst = costs(tables_task(), stored(content["positions"])).worst
    assert 1.0 < content["ratio"] < worst
    assert entry.name == f"positions-{content['positions']:02d}.json"


def test_its_regressors_and_admissible_cells_are_the_bench_s() -> None:
    rng = np.random.default_rng(3)
    checked = Proof.model_validate_json(json.dumps(caps(2)), strict=True)
    lines = np.degrees(checked._lines)
    for alpha, beta in rng.uniform(-45.0, 315.0, (300, 2)):
        a, b = np.radians([alpha, beta])
        at = np.outer([np.cos(a), np.sin(a), 1.0], [np.cos(b), np.sin(b), 1.0])
        inputs = np.array([at[form] for form in proof.INPUTS])
        expected = regressors(np.array([a]), np.array([b]), np.eye(3))[0]
        found = [(proof._forms()[p, int(inputs[p] < 0.0)] * at).sum(axis=(1, 2)) for p in range(3)]
        np.testing.assert_allclose(found, expected, atol=1e-14)
        cell = np.searchsorted(lines, alpha) - 1, np.searchsorted(lines, beta) - 1
        counts = admissible(np.array([a]), np.array([b]), np.eye(3), rule="tables")[0]
        for p in np.flatnonzero(counts):
            assert checked._counts[p, int(inputs[p] < 0.0)][cell]


def test_a_region_holds_every_position_that_is_in_it() -> None:
    rng = np.random.default_rng(4)
    checked = Proof.model_validate_json(json.dumps(caps(2)), strict=True)
    lines = np.degrees(checked._lines)
    hit = 0
    for _ in range(20):
        y = rng.normal(size=18)
        region = checked._region(y)
        for alpha, beta in rng.uniform(-45.0, 315.0, (40, 2)):
            a, b = (np.radians([angle]) for angle in (alpha, beta))
            counts = admissible(a, b, np.eye(3), rule="tables")[0]
            if (np.abs(regressors(a, b, np.eye(3))[0] @ y)[counts] > 1.0).any():
                hit += 1
                assert region[np.searchsorted(lines, alpha) - 1, np.searchsorted(lines, beta) - 1]
    assert hit > 100


def test_images_of_boxes_hold_the_images_of_their_cells() -> None:
    n = 40
    for g, box in product(range(16), ((3, 7, 30, 15), (0, 40, 35, 5))):
        ((image, _),) = proof._image(((box, 1),), g, n)
        a, b = (proof._moved_cells(g, axis, n) for axis in (0, 1))
        rows, columns = proof._cells(box, n)
        expected = np.zeros((n, n), dtype=bool)
        expected[np.ix_(a[rows.ravel()], b[columns.ravel()])] = True
        found = np.zeros((n, n), dtype=bool)
        found[proof._cells(image, n)] = True
        np.testing.assert_array_equal(found, expected)


def test_targets_are_the_project_s() -> None:
    assert set(proof.TARGETS) == set(SYMBOLS)


def tampered(content: dict[str, Any], how: str) -> None:
    leaf = next(node for node in content["nodes"] if "cuts" in node)
    match how:
        case "ratio":
            content["ratio"] += 1e-3
        case "positions":
            content["positions"] += 1
        case "weights":
            leaf["cuts"] = leaf["cuts"][:1]
        case "cut":
            content["cuts"] = [cut | {"y": [-factor for factor in cut["y"]]} for cut in content["cuts"]]
        case "optimum":
            content["optima"][3]["cost"] -= 1e-3
        case "plan":
            content["optima"][3]["readings"][0]["weight"] *= 1.001
        case "sign":
            content["optima"][3]["readings"][0]["alpha_deg"] = 0.0
        case "missing":
            content["nodes"] = content["nodes"][:-1]
        case "more":
            content["nodes"].append(leaf)
        case "lines":
            content["quarter_deg"] = content["quarter_deg"][:-1]


@pytest.mark.parametrize(
    "how", ["ratio", "positions", "weights", "cut", "optimum", "plan", "sign", "missing", "more", "lines"]
)
def test_what_is_tampered_with_is_refused(how: str) -> None:
    content = caps(2)
    verify(content)
    tampered(content, how)
    with pytest.raises(InputError):
        verify(content)


def test_a_tree_must_be_whole_and_like_must_look_back() -> None:
    content = caps(2)
    leaf = content["nodes"][0]
    whole = [{"split": [0, 0, 20]}, leaf, leaf, leaf]
    verify(content | {"nodes": whole})
    verify(content | {"nodes": [{"split": [0, 0, 20]}, leaf, leaf, {"like": 1}]})
    wrong = [whole[:3], [*whole, leaf], [{}], [{"split": [1, 0, 20]}], [{"split": [0, 0, 40]}]]
    for nodes in (*wrong, [whole[0], leaf, leaf, {"like": 2}], [whole[0], {"like": 0}, leaf, leaf]):
        with pytest.raises(InputError, match="nodes"):
            verify(content | {"nodes": nodes})


def test_check_says_what_is_proven_and_what_is_wrong(tmp_path: Any) -> None:
    path = tmp_path / "proof.json"
    path.write_text(json.dumps(caps(2)), encoding="utf-8")
    found = check(path)
    assert found.good
    assert found.summary == ("no 2 positions have a worst ratio below 1.1",)
    path.write_text(json.dumps(caps(3)), encoding="utf-8")
    assert "can hit all cuts" in check(path).problems[0].text


def test_the_search_has_the_regions_of_the_check() -> None:
    """Two ways to the same cells: corners of sheets in the planner's parameters, intervals in those of the paper."""
    rng, checked = np.random.default_rng(5), Proof.model_validate_json(json.dumps(caps(2)), strict=True)
    cells = Cells(tables_task(), checked.quarter_deg)
    for _ in range(10):
        y = rng.normal(size=18)
        np.testing.assert_array_equal(cells.region(y), checked._region(x_from_targets() @ y).ravel())


@pytest.mark.acceptance
@pytest.mark.parametrize(("count", "ratio"), [(3, 1.2), (7, 1.05)])
def test_the_search_finds_certificates(count: int, ratio: float) -> None:
    found = prove(count, ratio)
    assert found is not None
    assert (found.positions, found.ratio) == (count, ratio)


@pytest.mark.acceptance
def test_the_search_proves_nothing_of_what_is_reached() -> None:
    assert prove(8, 1.17, rounds=3) is None
