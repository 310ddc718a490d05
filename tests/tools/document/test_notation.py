"""Typographic signs, drawn intervals, equations."""

from xml.etree import ElementTree

import pytest

from trihedron.models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace
from trihedron.tools.document import Bar, bars, effect_formula, minus, symbol_text, typographic
from trihedron.tools.document import equation as mathml


@pytest.mark.parametrize(
    ("sign", "text", "written"),
    [
        (typographic, "-1.09e-03 n² and 1e-05 g", "−1.09·10⁻³ n² and 10⁻⁵ g"),
        (typographic, "5e12ab 52e1f4 v1e5", "5e12ab 52e1f4 v1e5"),
        (
            typographic,
            "κ by -812.8 arcsec (-1.5), accelerometer-2, X4-5, 2026-11-21, --prior",
            "κ by −812.8 arcsec (−1.5), accelerometer-2, X4-5, 2026-11-21, --prior",
        ),
        (minus, "-1.5e-5", "−1.5e−5"),
        (symbol_text, "-X12@first-side", "−X12@first-side"),
        (symbol_text, "X8@identity", "X8@identity"),
    ],
)
def test_only_numbers_and_signs_are_rewritten(sign, text, written):
    assert sign(text) == written


def test_bars_share_one_scale_and_reach_their_ends():
    drawn, reach = bars([Bar(2.0, -1.0, 1.5), Bar(None, None, None), Bar(1.0, -0.5, 0.5, truth=3.0)])
    assert reach == pytest.approx(3.06)
    assert drawn[1] is None
    assert drawn[0] is not None
    root = ElementTree.fromstring(drawn[0].svg)
    band = root.find("rect")
    assert band is not None
    assert float(band.attrib["x"]) == pytest.approx(-200.0 / reach, abs=0.06)
    assert float(band.attrib["width"]) == pytest.approx(400.0 / reach, abs=0.06)
    assert bars([]) == ([], 0.0)


def tree(formula: str) -> ElementTree.Element:
    return ElementTree.fromstring(mathml(formula).replace("&nbsp;", " "))


def test_formulas_become_mathml_that_is_well_formed():
    root = tree(
        "f_1/g = n_1 + {0.5 n_1 ; 'where' n_1 > 0 | −1.2e−3 n_1² ; 'where' n_1 < 0} + sin(2α + (−0.1)) <&'x & y'"
    )
    message = "".join(root.itertext())
    assert "1.2·10−3" in message
    assert "x & y" in message
    assert root.find(".//mtable") is not None


def test_a_matrix_has_rows_and_columns_and_a_change_an_upright_letter():
    root = tree("Δω = [1 ; 2 | 3 ; 4] n")
    rows = [["".join(cell.itertext()) for cell in row.iter("mtd")] for row in root.iter("mtr")]
    assert rows == [["1", "2"], ["3", "4"]]
    assert "".join(root.itertext()) == "Δω=(1234)n"
    assert [e.text for e in root.iter() if e.attrib.get("mathvariant") == "normal"] == ["Δ"]


@pytest.mark.parametrize("effect", [e for e in CATALOGUE.values() if e.formula], ids=lambda effect: effect.name)
def test_every_effect_has_a_formula_with_its_parameters_in_it(effect):
    for place in effect.places or (EffectPlace(effect.name, "position-7", axes=(2,)),):
        names = [parameter.name for parameter in effect.at(place).parameters]
        formula = effect_formula(place, {name: f"{k}.25" for k, name in enumerate(names, start=1)})
        assert formula is not None, place.title
        message = "".join(tree(formula).itertext())
        assert all(f"{k}.25" in message for k in range(1, len(names) + 1)), place.title


def test_every_effect_that_can_be_searched_has_a_formula():
    searched = [*POSITION_EFFECTS.values(), *(e for e in STRAPDOWN_EFFECTS.values() if e.variants is None)]
    assert all(effect.formula for effect in searched)
