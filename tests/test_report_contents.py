"""What the pages of calibrate, diagnose and plan say, and that their figures are those of the results."""

import csv
import io
import re
from dataclasses import replace
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest

from bench_cases import draw_case, measure
from page_text import html_of
from trihedron.models.effects import POSITION_EFFECTS, EffectPlace
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.search import likeness
from trihedron.tools.document.equations import effect_formula, math
from trihedron.tools.document.numbers import (
    Bar,
    Written,
    bars,
    minus,
    outwards,
    significant,
    symbol_text,
    to_bound,
    typeset,
    upwards,
)
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.planning.plan import plan_targets
from trihedron.tools.reports.calibration import page as calibration_page
from trihedron.tools.reports.calibration import target_section
from trihedron.tools.reports.diagnosis import page as diagnosis_page
from trihedron.tools.reports.plan import plan_page
from trihedron.tools.reports.record import next_positions_csv
from trihedron.tools.trials.bench import NOISE_BOUND

MATH = "{http://www.w3.org/1998/Math/MathML}"


@pytest.fixture(scope="module")
def clean():
    return measure(draw_case(5, effects=[]), 5)


@pytest.fixture(scope="module")
def page(clean):
    return html_of(calibration_page, calibrate(clean, noise_bound=NOISE_BOUND), clean)


def headings(text: str) -> list[str]:
    return re.findall(r"<h2>([^<]*)</h2>", text)


def sources(text: str) -> str:
    return text[text.index("Methods used") :]


@pytest.mark.parametrize(
    ("value", "bound", "written"),
    [
        (0.00393096, 2.4e-5, "0.003931"),
        (-0.00062534, 1.06e-5, "−0.000625"),
        (0.0, 1e-5, "0.000000"),
        (-1e-9, 1e-5, "0.000000"),
        (0.5, 0.12, "0.50"),
        (3.14159, 12.0, "3"),
        (0.00393096, 0.0, "0.00393"),
        (0.00393096, None, "0.00393"),
    ],
)
def test_estimates_have_the_digits_that_their_bounds_justify(value, bound, written):
    assert to_bound(value, bound) == Written(written)


def test_guarantees_survive_rounding():
    rng = np.random.default_rng(1)
    for middle, half in zip(rng.normal(size=300), 10.0 ** rng.uniform(-9, 1, 300), strict=True):
        low, high = outwards(middle - half, middle + half, half)
        assert low is not None
        assert high is not None
        ends = [float(end.text.replace("−", "-")) for end in (low, high)]
        assert ends[0] <= middle - half + 1e-6 * half
        assert ends[1] >= middle + half - 1e-6 * half
        assert ends[1] - ends[0] <= 2.4 * half
        above = upwards(half)
        assert above is not None
        assert half * (1 - 1e-9) <= float(above.text.replace("−", "-")) <= 1.101 * half


def test_figures_without_a_bound_have_two_digits():
    assert [str(significant(v)) for v in (3.218e-5, 0.0, 1e-17, 12.7)] == [
        str(Written(text)) for text in ("3.2e−5", "0", "0", "13")
    ]
    assert significant(float("nan")) is None


def test_powers_of_ten_are_typeset_and_hashes_are_not():
    assert typeset("-1.09e-03 n² and 1e-05 g") == "−1.09·10⁻³ n² and 10⁻⁵ g"
    assert typeset("5e12ab 52e1f4 v1e5") == "5e12ab 52e1f4 v1e5"


def test_a_sign_before_a_number_is_a_minus_and_a_hyphen_stays():
    assert typeset("κ by -812.8 arcsec (-1.5), accelerometer-2, X4-5, 2026-11-21, --prior") == (
        "κ by −812.8 arcsec (−1.5), accelerometer-2, X4-5, 2026-11-21, --prior"
    )


def test_only_numbers_and_signs_are_rewritten():
    assert minus("-1.5e-05") == "−1.5e−5"
    assert minus("2.0e+03 and -1e-10") == "2.0e3 and −1e−10"
    assert minus("identity 1 0") == "identity 1 0"
    assert symbol_text("-X12@first-side") == "−X12@first-side"
    assert symbol_text("X8@identity") == "X8@identity"


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


def test_formulas_become_mathml_that_is_well_formed():
    text = math(
        "f_1/g = n_1 + {0.5 n_1 ; 'where' n_1 > 0 | −1.2e−3 n_1² ; 'where' n_1 < 0} + sin(2α + (−0.1)) <&'x & y'"
    )
    root = ElementTree.fromstring(text.replace("&nbsp;", " "))
    said = "".join(root.itertext())
    assert "1.2·10−3" in said
    assert "x & y" in said
    assert root.find(".//mtable") is not None


def test_a_matrix_has_rows_and_columns_and_a_change_an_upright_letter():
    root = ElementTree.fromstring(math("Δω = [1 ; 2 | 3 ; 4] n").replace("&nbsp;", " "))
    rows = [["".join(cell.itertext()) for cell in row.iter(f"{MATH}mtd")] for row in root.iter(f"{MATH}mtr")]
    rows = rows or [["".join(cell.itertext()) for cell in row.iter("mtd")] for row in root.iter("mtr")]
    assert rows == [["1", "2"], ["3", "4"]]
    assert "".join(root.itertext()) == "Δω=(1234)n"
    upright = [e.text for e in root.iter() if e.attrib.get("mathvariant") == "normal"]
    assert upright == ["Δ"]


def test_every_effect_of_the_table_has_a_formula_with_its_parameters_in_it():
    for effect in POSITION_EFFECTS.values():
        places = effect.places or (EffectPlace(effect.name, "position-7", axes=(2,)),)
        for place in places:
            here = effect.at(place)
            names = [parameter.name for parameter in here.parameters]
            formula = effect_formula(place, {name: f"{k}.25" for k, name in enumerate(names, start=1)})
            assert formula is not None, place.title
            for k in range(1, len(names) + 1):
                assert f"{k}.25" in formula, place.title
            ElementTree.fromstring(math(formula).replace("&nbsp;", " "))


def test_a_calibration_says_verdict_record_model_residuals_targets_and_provenance(page, clean):
    result = calibrate(clean, noise_bound=NOISE_BOUND)
    assert headings(page)[:4] == ["What was measured", "What was simulated", "Residuals before and after", "Targets"]
    assert f"within {result.radius:.2g} σ" in page
    row = next(e for e in result.parameters if e.symbol == "X4")
    written = to_bound(row.estimate, row.guaranteed_error)
    assert written is not None
    # in the table, and in the model's equation
    assert page.count(written.text) >= 2
    assert page.count('<svg class="bar"') == 18
    assert "<math " in page
    assert headings(page)[-2:] == ["What these results rest on", "Methods used, and where they are published"]
    for word in ("Golovan", "HiGHS"):
        assert word in sources(page)
    for word in ("Cheney", "Lawson", "Allan", "Fisher", "Functional Mock-up"):
        assert word not in sources(page)


def test_a_record_that_leaves_targets_open_says_where_to_measure_and_carries_the_list(clean):
    few = clean.selected(np.arange(4))
    result = calibrate(few, noise_bound=NOISE_BOUND)
    assert result.verdict == "insufficient"
    text = html_of(calibration_page, result, few)
    assert "do not determine any of the targets" in text
    assert "<mi>?</mi>" in text
    (carried,) = re.findall(r'href="data:text/csv;charset=utf-8,([^"]*)" download="next-positions.csv"', text)
    rows = list(csv.DictReader(io.StringIO(unquote(carried))))
    wanted = [(float(p["alpha_deg"]), float(p["beta_deg"])) for p in result.next_positions]
    assert [(float(row["alpha_deg"]), float(row["beta_deg"])) for row in rows] == wanted


def test_a_falsified_calibration_shows_the_readings_that_prove_it_and_no_guarantees():
    record = measure(draw_case(501, effects=["quadratic"]), 501)
    result = calibrate(record, noise_bound=NOISE_BOUND)
    text = html_of(calibration_page, result, record)
    table = text[text.index("the readings that prove it</h2>") :]
    at_best = re.findall(r'<td class="number">([+−]\d+\.\d\d)</td>\s*</tr>', table)
    assert len(at_best) == len(result.witness)
    # At the Chebyshev centre the readings that prove it are all off by the radius.
    assert {abs(float(v.replace("−", "-"))) for v in at_best} == {round(result.radius, 2)}
    assert "guaranteed error</th>" not in text
    assert "Cheney" in sources(text)


def test_a_named_cause_stands_with_its_interval_its_equation_and_its_rivals():
    record = measure(draw_case(501, effects=["quadratic"]), 501)
    result = diagnose(record, noise_bound=NOISE_BOUND, rerun=False)
    text = html_of(diagnosis_page, result, record)
    titles = headings(text)
    for title in ("The cause", "Evidence: which effect mends it", "Evidence: what could be taken for what"):
        assert title in titles
    cause = result.causes[0]
    low, high = cause.intervals[0]
    written = to_bound(cause.values[0], 0.5 * (high - low))
    assert written is not None
    assert f"<mn>{written.text.lstrip('−')}</mn>" in text
    assert "Lawson" in sources(text)
    assert "Fisher" in sources(text)
    assert "Functional Mock-up" not in sources(text)
    assert "seed of the shuffles" in text


def test_the_pages_repeat_to_the_byte_and_ask_nothing_of_the_network(page, clean):
    again = html_of(calibration_page, calibrate(clean, noise_bound=NOISE_BOUND), clean)
    assert again == page
    addresses = re.findall(r'(?:href|src)="([^"]*)"', page)
    assert all(address.startswith(("#", "data:")) for address in addresses)


@pytest.mark.parametrize(
    "options",
    [
        {"convention": "A2"},
        {"baseline": "symmetric"},
        {"targets": ("X4-X5", "X16-X17"), "priors": ("X16=1e-2", "bounds")},
    ],
    ids=["A2", "symmetric", "asked"],
)
def test_pages_of_other_options(clean, options):
    text = html_of(calibration_page, calibrate(clean, noise_bound=NOISE_BOUND, **options), clean)
    assert text.count("<math ") >= 5
    assert all(expression.replace("-", "−") in text for expression in options.get("targets", ()))


def test_pages_of_several_mountings_whatever_they_are_called(clean):
    half = len(clean) // 2
    names = ("upright-1e5",) * half + ("elsewhere",) * (len(clean) - half)
    record = replace(clean, mounting=names)
    mounting = {"upright-1e5": np.eye(3), "elsewhere": np.eye(3)}
    text = html_of(calibration_page, calibrate(record, noise_bound=NOISE_BOUND, mounting=mounting), record)
    assert "X8@upright-1e5" in text
    assert "X13@elsewhere" in text
    result = diagnose(record, noise_bound=NOISE_BOUND, mounting=mounting)
    assert "X8@upright-1e5" in html_of(diagnosis_page, result, record)


def test_likeness_is_one_for_members_of_a_class_and_small_for_strangers(clean):
    evidence = bench_evidence(clean, noise_bound=NOISE_BOUND)
    places = [
        EffectPlace("sag", "outer-axis"),
        EffectPlace("encoder-harmonic", "outer-axis", 1),
        EffectPlace("bias-drift", "accelerometer-1"),
        EffectPlace("quadratic", "accelerometer-3"),
    ]
    alike = likeness(evidence, places)
    assert np.allclose(alike, alike.T)
    assert np.allclose(np.diag(alike), 1.0)
    assert alike[0, 1] > 1.0 - 1e-4
    assert alike[2, 3] < 0.5


def test_a_plan_shows_its_estimator_and_carries_its_positions():
    plans = plan_targets(("X4",), grid=15.0)
    text = html_of(plan_page, plans)
    best = plans[0].optimum
    assert f"{best.cost:.6f} σ" in text
    for weight in best.weights:
        assert f"<mn>{abs(weight):.6f}</mn>" in text
    assert 'download="X4.csv"' in text
    assert "Gilmore" in sources(text)
    assert "Land" not in sources(text)


def test_mountings_and_senses_go_into_the_list_of_positions():
    text = next_positions_csv(
        [
            {"alpha_deg": 90.0, "beta_deg": 355.0, "mounting": "b"},
            {"alpha_deg": 1.5, "beta_deg": 0.0, "approach_alpha": -1},
        ]
    )
    assert text == "position,alpha_deg,beta_deg,mounting,approach_alpha\n1,90.0,355.0,b,\n2,1.5,0.0,,-1\n"


def test_sets_that_remain_are_numbered_and_figures_with_effects_are_said_to_be_of_the_first(clean):
    record = clean.selected(np.arange(len(clean)))
    n = calibrate(clean, noise_bound=NOISE_BOUND).linearised.input
    record.specific_force[:, 1] += 9.80665 * 1.5e-4 * n[:, 1] ** 3
    result = diagnose(record, noise_bound=NOISE_BOUND)
    assert result.verdict == "ambiguous"
    text = html_of(diagnosis_page, result, record)
    for number, finding in enumerate(result.findings, start=1):
        sentence = "; ".join(cause.sentence for cause in finding.causes)
        assert f"Set {number}: {typeset(sentence)}." in text
    assert f"With the first of the sets that remain, {result.findings[0].title}, it leaves" in text
    assert "With the effect" not in text


def test_where_nothing_is_determined_the_table_has_no_empty_columns(clean):
    few = clean.selected(np.arange(3))
    table = target_section(calibrate(few, noise_bound=NOISE_BOUND)).table
    assert table is not None
    assert list(table.header) == ["target", "meaning", "unit"]
    assert len(table.rows) == 18


def test_warnings_of_the_record_are_on_the_page(clean):
    warned = calibrate(clean, noise_bound=NOISE_BOUND).model_copy(update={"warnings": ["row 7 <b>looks</b> odd"]})
    text = html_of(calibration_page, warned, clean)
    assert "Warning: row 7 &lt;b&gt;looks&lt;/b&gt; odd." in text
