"""Where the methods are published that a result was made with; only those that were used."""

from trihedron.calibration import Calibration
from trihedron.diagnosis import Diagnosis

SOURCES = {
    "guaranteed": (
        "Model of bench and block, targets, guaranteed estimates: A. A. Golovan, A. I. Matasov, I. E. Tarygin. "
        "Calibration of an accelerometer block with asymmetric models of its sensors. Izvestiya RAN, Teoriya i sistemy "
        "upravleniya, 2022, no. 2, pp. 107–119 (in Russian)."
    ),
    "simplex": (
        "Linear programmes, by HiGHS: Q. Huangfu, J. A. J. Hall. Parallelizing the dual revised simplex method. "
        "Mathematical Programming Computation 10 (2018), pp. 119–142. doi 10.1007/s12532-017-0130-5."
    ),
    "chebyshev": (
        "Least largest residual, and the few readings that decide it: E. W. Cheney. Introduction to Approximation "
        "Theory. McGraw-Hill, 1966, chapter 2."
    ),
    "lawson": (
        "Sets of effects refused by weighted least squares: C. L. Lawson. Contributions to the theory of linear least "
        "maximum approximation. Thesis, University of California, Los Angeles, 1961."
    ),
    "allan": (
        "Noise bound from the scatter within rests: D. W. Allan. Statistics of atomic frequency standards. Proceedings "
        "of the IEEE 54 (1966), pp. 221–230. doi 10.1109/PROC.1966.4634."
    ),
    "shuffles": "Shuffled effects as a control: R. A. Fisher. The Design of Experiments. Oliver and Boyd, 1935.",
    "fmi": (
        "Simulation of held-out positions: Modelica Association. Functional Mock-up Interface for Model Exchange and "
        "Co-Simulation, version 2.0. 2014."
    ),
    "columns": (
        "Optimal plans by generated columns: P. C. Gilmore, R. E. Gomory. A linear programming approach to the "
        "cutting-stock problem. Operations Research 9 (1961), pp. 849–859. doi 10.1287/opre.9.6.849."
    ),
    "branches": (
        "Proof that no plan is better: A. H. Land, A. G. Doig. An automatic method of solving discrete programming "
        "problems. Econometrica 28 (1960), pp. 497–520. doi 10.2307/1910129."
    ),
}
"""Methods, each with what it does here and where it is from."""


def calibration_sources(result: Calibration) -> list[str]:
    """Of a calibration."""
    used = ["guaranteed", "simplex"]
    if result.verdict == "falsified":
        used.append("chebyshev")
    if "Allan" in result.noise_bound_basis:
        used.append("allan")
    return [SOURCES[name] for name in used]


def diagnosis_sources(result: Diagnosis) -> list[str]:
    """Of a diagnosis."""
    used = []
    if result.tried:
        used.append("lawson")
    if result.judgement is not None and result.judgement.shuffles:
        used.append("shuffles")
    if result.gain is not None:
        used.append("fmi")
    return [*calibration_sources(result.baseline), *(SOURCES[name] for name in used)]


def plan_sources(*, proven: bool) -> list[str]:
    """Of optimal plans; `proven` over all angles."""
    return [SOURCES[name] for name in ("guaranteed", "simplex", "columns", *(("branches",) if proven else ()))]


def common_plan_sources() -> list[str]:
    """Of one set of positions for all targets."""
    return [SOURCES[name] for name in ("guaranteed", "simplex")]
