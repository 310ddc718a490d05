"""Where the methods are published that a result was made with; only those that were used."""

from ..calibration import Calibration
from ..diagnosis import Diagnosis

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
        "Noise from the scatter within rests: D. W. Allan. Statistics of atomic frequency standards. Proceedings "
        "of the IEEE 54 (1966), pp. 221–230. doi 10.1109/PROC.1966.4634."
    ),
    "left-out": (
        "Parts of the record left out and predicted: M. Stone. Cross-validatory choice and assessment of statistical "
        "predictions. Journal of the Royal Statistical Society B 36 (1974), pp. 111–147."
    ),
    "angles": (
        "What could be taken for what, by angles between subspaces: Å. Björck, G. H. Golub. Numerical methods for "
        "computing angles between linear subspaces. Mathematics of Computation 27 (1973), pp. 579–594."
    ),
    "gyros": (
        "Model of the gyro block: P. Groves. Principles of GNSS, inertial, and multisensor integrated navigation "
        "systems. 2nd edition, Artech House, 2013, section 4.4."
    ),
    "attitude": (
        "Attitude from increments: Yu. N. Chelnokov, S. E. Perelyaev, L. A. Chelnokova. Investigation of algorithms "
        "for the inertial orientation of a moving object. Izvestiya of Saratov University, Mathematics. Mechanics. "
        "Informatics 16 (2016), no. 1, pp. 80–95 (in Russian). doi 10.18500/1816-9791-2016-16-1-80-95."
    ),
    "norm": (
        "Accelerometers by the size of gravity at rest: J. C. Lötters, J. Schipper, P. H. Veltink, W. Olthuis, "
        "P. Bergveld. Procedure for in-use calibration of triaxial accelerometers in medical applications. Sensors and "
        "Actuators A 68 (1998), pp. 221–228."
    ),
    "shuffles": "Shuffled effects as a control: R. A. Fisher. The Design of Experiments. Oliver and Boyd, 1935.",
    "fmi": (
        "Simulation by FMUs: Modelica Association. Functional Mock-up Interface for Model Exchange and "
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


def diagnosis_sources(result: Diagnosis, *, compared: bool) -> list[str]:
    """Of a diagnosis; `compared` where it is shown how alike effects are."""
    used = []
    if result.tried:
        used.append("lawson")
    if result.judgement is not None and result.judgement.shuffles:
        used.append("shuffles")
    if result.judgement is not None and (result.judgement.folds or result.judgement.blocks):
        used.append("left-out")
    if result.gain is not None:
        used.append("fmi")
    if compared:
        used.append("angles")
    return [*calibration_sources(result.evidence.calibration), *(SOURCES[name] for name in used)]


def strapdown_sources(result: Diagnosis) -> list[str]:
    """Of the diagnosis of a strapdown record."""
    used = []
    found = result.evidence.found
    if found.accelerometers is not None and found.accelerometers.least_squares is not None:
        used.append("norm")
    if found.gyros is not None:
        used.append("allan")
    if result.evidence.parts:
        used += ["gyros", "attitude", "fmi", "simplex"]
    if result.tried:
        used += ["chebyshev", "lawson"]
    if len(result.tried) > 1:
        used.append("angles")
    if result.judgement:
        used += ["shuffles", "left-out"]
    return [SOURCES[name] for name in used]


def plan_sources(*, proven: bool) -> list[str]:
    """Of optimal plans; `proven` over all angles."""
    return [SOURCES[name] for name in ("guaranteed", "simplex", "columns", *(("branches",) if proven else ()))]


def common_plan_sources() -> list[str]:
    """Of one set of positions for all targets."""
    return [SOURCES[name] for name in ("guaranteed", "simplex")]
