"""Proofs that so many positions cannot reach a ratio: their check agrees with the bench's model and refuses others."""

import json
from importlib import resources
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from planning_tasks import stored, tables_task
from trihedron.models.bench import TARGETS as SYMBOLS
from trihedron.models.bench import admissible, regressors
from trihedron.tools.check.checked import check
from trihedron.tools.errors import InputError
from trihedron.tools.planning import proof
from trihedron.tools.planning.forms import x_from_targets
from trihedron.tools.planning.positions import costs
from trihedron.tools.planning.proof import Proof
from trihedron.tools.planning.proof_cuts import Cells
from trihedron.tools.planning.proof_search import prove

SHIPPED = sorted(
    (entry for entry in resources.files("trihedron.tools.planning").joinpath("proofs").iterdir()),
    key=lambda entry: entry.name,
)


def content_of(name: str = "positions-07.json") -> dict[str, Any]:
    return json.loads(resources.files("trihedron.tools.planning").joinpath("proofs", name).read_text(encoding="utf-8"))


def verify(content: dict[str, Any]) -> None:
    Proof.model_validate_json(json.dumps(content), strict=True).verify()


def caps(positions: int) -> dict[str, Any]:
    """Every scale factor needs a position near a pole of its accelerometer: no position is near two.

    The first cut puts one position there, the second another; the third no position is left for.
    """
    content, ratio = content_of(), 1.1
    costs = {plan["target"]: plan["cost"] for plan in content["optima"]}
    cuts = []
    for target, plus, minus, bias in (("X4", 3, 4, 15), ("X9", 8, 9, 16), ("X14", 13, 14, 17)):
        y = [0.0] * 18
        y[plus], y[minus], y[bias] = ratio * costs[target] + 1e-6, -ratio * costs[target], -0.95
        cuts.append({"target": target, "y": y})
    nodes = [{"narrow": [0, 16], "cover": 32}]
    return content | {
        "positions": positions,
        "ratio": ratio,
        "quarter_deg": [5, 11, 20, 32, 45],
        "cuts": cuts,
        "nodes": nodes,
    }


def test_two_positions_are_near_two_of_three_axes_at_most() -> None:
    verify(caps(2))
    with pytest.raises(InputError, match="1 are missing"):
        verify(caps(3))


def test_two_positions_hit_two_of_three_weights_at_most() -> None:
    """The same without a division: no cell is in two of the regions, so two positions hit two of them at most."""
    three = [[0, 500], [16, 501], [32, 500]]
    verify(caps(2) | {"nodes": [{"weights": three}]})
    with pytest.raises(InputError, match="may hit a weight of 1503"):
        verify(caps(3) | {"nodes": [{"weights": three}]})
    for weights in ([], [[0, 1], [16, 1]], [[0, 2], [16, 1], [32, 1]], [[0, 1], [16, 1], [48, 1]]):
        with pytest.raises(InputError, match="nodes"):
            verify(caps(2) | {"nodes": [{"weights": weights}]})
    for weight in (-1, 0, 10**9):
        with pytest.raises(ValidationError):
            verify(caps(2) | {"nodes": [{"weights": [[0, weight], *three[1:]]}]})


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


def test_an_image_holds_the_cells_of_the_images_of_its_positions() -> None:
    rng = np.random.default_rng(6)
    checked = Proof.model_validate_json(json.dumps(caps(2)), strict=True)
    lines = np.degrees(checked._lines)
    n = len(lines) - 1
    for g in range(16):
        ways = [proof._sense_and_shift(g, axis) for axis in (0, 1)]
        for place in rng.uniform(-45.0, 315.0, (20, 2)):
            there = [sense * angle + 180.0 * shift for (sense, shift), angle in zip(ways, place, strict=True)]
            cells = np.zeros((n, n), dtype=bool)
            cells[tuple(np.searchsorted(lines, place) - 1)] = True
            moved = tuple(np.searchsorted(lines, (np.array(there) + 45.0) % 360.0 - 45.0) - 1)
            assert np.argwhere(proof._image(cells, g)).tolist() == [list(moved)]


def test_targets_are_the_project_s() -> None:
    assert set(proof.TARGETS) == set(SYMBOLS)


def tampered(content: dict[str, Any], how: str) -> None:
    leaf = content["nodes"][-1]
    match how:
        case "ratio":
            content["ratio"] += 1e-3
        case "positions":
            content["positions"] += 1
        case "narrow":
            leaf["narrow"] = leaf["narrow"][:1]
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
    "how", ["ratio", "positions", "narrow", "cut", "optimum", "plan", "sign", "missing", "more", "lines"]
)
def test_what_is_tampered_with_is_refused(how: str) -> None:
    content = caps(2)
    verify(content)
    tampered(content, how)
    with pytest.raises(InputError):
        verify(content)


def test_a_tree_must_be_whole_and_like_must_look_back() -> None:
    """One of two positions has α within 45° of 0, or of 180°, or none: near no pole of accelerometers 1 and 2."""
    content = caps(2)
    leaf = content["nodes"][0]
    near = {"narrow": [0], "cover": 16}
    near_0, near_180 = {"split": [0, 0, 0, 10]}, {"split": [0, 0, 20, 10]}
    whole = [near_0, near, near_180, near, leaf]
    verify(content | {"nodes": whole})
    verify(content | {"nodes": [*whole[:3], {"like": 1}, leaf]})
    verify(content | {"nodes": [near_0, near, {"cover": 0}, {"cover": 16}, {"cover": 32}]})
    wrong: list[list[dict[str, Any]]] = [whole[:4], [*whole, leaf], [{}], [near_0 | near, near, leaf]]
    wrong += [[{"split": split}] for split in ([1, 0, 0, 10], [0, 0, 0, 40], [0, 2, 0, 10], [0, 0, 0, 0])]
    wrong += [[*whole[:3], {"like": number}, leaf] for number in (-1, 0, 2, 3, 4, 9)]
    wrong += [[*whole[:3], near, {"like": 1}], [near_0, leaf, leaf], [{"cover": 48}], [near_0, near, near_0]]
    for nodes in wrong:
        with pytest.raises(InputError, match="nodes"):
            verify(content | {"nodes": nodes})


def test_check_says_what_is_proven_and_what_is_wrong(tmp_path: Any) -> None:
    path = tmp_path / "proof.json"
    path.write_text(json.dumps(caps(2)), encoding="utf-8")
    found = check(path)
    assert found.good
    assert found.summary == ("no 2 positions have a worst ratio below 1.1",)
    path.write_text(json.dumps(caps(3)), encoding="utf-8")
    assert "1 are missing" in check(path).problems[0].text


def test_the_search_has_the_regions_of_the_check() -> None:
    """Two ways to the same cells: corners of sheets in the planner's parameters, intervals in those of the paper."""
    rng, checked = np.random.default_rng(5), Proof.model_validate_json(json.dumps(caps(2)), strict=True)
    cells = Cells(tables_task(), checked.quarter_deg)
    for _ in range(10):
        y = rng.normal(size=18)
        np.testing.assert_array_equal(cells.region(y), checked._region(x_from_targets() @ y).ravel())


def test_the_search_finds_a_tree() -> None:
    found = prove(7, 1.05)
    assert found is not None
    assert (found.positions, found.ratio) == (7, 1.05)
    assert 1 < len(found.nodes) < 100
    assert any(node.weights for node in found.nodes)


@pytest.mark.acceptance
@pytest.mark.parametrize("entry", SHIPPED, ids=lambda entry: entry.name)
def test_the_search_finds_what_is_stored(entry: Any) -> None:
    content = json.loads(entry.read_text(encoding="utf-8"))
    found = prove(content["positions"], content["ratio"])
    assert found is not None
    assert found.to_json() == content


@pytest.mark.acceptance
def test_the_search_proves_nothing_of_what_is_reached() -> None:
    assert prove(8, 1.17, nodes=50) is None


def test_lines_too_far_apart_prove_nothing() -> None:
    assert prove(7, 1.05, nodes=8, quarter_deg=(30.0, 45.0)) is None
