"""An .ssp from elsewhere: its bindings, mappings, units, nested systems and experiment are used, or refused."""

import math
import os
import shutil
from pathlib import Path

import pytest

from foreign_fmus import build_foreign
from foreign_fmus.habits import Habit, build_habit
from ssp_files import HEAD, component, inline, packed, system, values, wire
from trihedron.fmus import build
from trihedron.models.attitude_algorithms import ALGORITHMS
from trihedron.tools import cli, library
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Scenario, run_scenario
from trihedron.tools.ssp import scenario_of_ssp

MEAN_RATE = next(a.number for a in ALGORITHMS if a.name == "mean-rate")
STEP = (
    '<ssd:Annotations><ssc:Annotation type="org.openmodelica"><a><FixedStepMaster stepSize="0.5"/></a>'
    "</ssc:Annotation></ssd:Annotations>"
)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fmus")
    for script in ("foreign_clock", "foreign_gain", "foreign_accumulator"):
        build_foreign(script, folder)
    build("TurntableMotion", folder)
    build("AttitudeComputer", folder)
    return folder


def imported(path: Path) -> tuple[Scenario, tuple[str, ...]]:
    with scenario_of_ssp(path) as scenario_read:
        return scenario_read


def run(path: Path) -> dict[str, list]:
    with scenario_of_ssp(path) as simulation:
        return run_scenario(simulation[0]).table.to_dict(as_series=False)


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as refused, scenario_of_ssp(path):
        pass
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.mark.acceptance
def test_connections_experiment_and_step(tmp_path, fmus):
    """A connection may be written from either end; the experiment sets the times, the annotation the step."""
    system_text = system(
        "root",
        component("clock", "Clock", ended="output"),
        component("gain", "Gain", inline("gain|Real|3"), u_1="input", y_1="output"),
        component("sum", "Accumulator", increment="input"),
        wires=wire("clock.ended", "gain.u[1]") + wire("sum.increment", "gain.y[1]"),
        after=STEP,
    )
    simulation = run(packed(tmp_path, fmus, system_text, "Clock", "Gain", "Accumulator"))
    assert simulation["time_s"] == [2.0, 2.5, 3.0, 3.5, 4.0]
    assert simulation["gain.y[1]"][1:] == [7.5, 9.0, 10.5, 12.0]
    assert simulation["sum.total"][-1] == 39.0


@pytest.mark.acceptance
def test_bindings_of_outer_systems_and_later_ones_win(tmp_path, fmus):
    inner = system(
        "inner",
        component("a", "Gain", inline("gain|Real|1", "times|Integer|5")),
        component("b", "Gain", inline("gain|Real|1", "label|String|of b", "inverted|Boolean|true")),
        bound=(inline("a.gain|Real|2", "b.gain|Real|2"),),
    )
    outer = inline("inner.a.gain|Real|3") + inline("a.gain|Real|4", attributes='prefix="inner."')
    system_text = system("root", inner, bound=(outer, inline("inner.c.gain|Real|9")), after=STEP)
    scenario, ignored = imported(packed(tmp_path, fmus, system_text, "Gain"))
    assert scenario.fmus["inner_a"].parameters == {"gain": 4.0, "times": 5}
    assert scenario.fmus["inner_b"].parameters == {"gain": 2.0, "label": "of b", "inverted": True}
    assert ignored == ("inner.c.gain",)


@pytest.mark.acceptance
def test_connectors_of_nested_systems_pass_values_and_parameters_on(tmp_path, fmus):
    inner = system(
        "inner",
        component("gain", "Gain", u_1="input", y_1="output", gain="parameter"),
        wires=wire("given", "gain.u[1]") + wire("gain.y[1]", "product") + wire("factor", "gain.gain"),
        given="input",
        product="output",
        factor="parameter",
    )
    system_text = system(
        "root",
        component("clock", "Clock", ended="output"),
        inner,
        component("sum", "Accumulator", increment="input"),
        wires=wire("clock.ended", "inner.given") + wire("inner.product", "sum.increment"),
        bound=(inline("inner.factor|Real|10"),),
        after=STEP,
    )
    simulation = run(packed(tmp_path, fmus, system_text, "Clock", "Gain", "Accumulator"))
    assert simulation["sum.total"][-1] == 10.0 * (2.5 + 3.0 + 3.5 + 4.0)


def test_units_names_and_transformations(tmp_path, fmus):
    """Convert a .ssv in degrees and arcminutes with its own names to the FMU's by a .ssm."""
    units = (
        f'<ssc:Unit name="deg"><ssc:BaseUnit rad="1" factor="{math.pi / 180!r}"/></ssc:Unit>'
        '<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>'
    )
    written = values(
        "dip|Real|0.5|deg", "Gz|Real|9.81|m/s2", "room|Real|300|K", "raw|Real|2|deg", "site|Real|0.7", "seed|Integer|8",
        units=units,
    )  # fmt: skip
    entries = (
        '<ssm:MappingEntry source="dip" target="kappa"/><ssm:MappingEntry source="dip" target="epsilon">'
        '<ssc:LinearTransformation factor="-1" offset="0.25"/></ssm:MappingEntry>'
        '<ssm:MappingEntry source="Gz" target="gravity"/><ssm:MappingEntry source="room" target="temperature"/>'
        '<ssm:MappingEntry source="raw" target="azimuth" suppressUnitConversion="true"/>'
        '<ssm:MappingEntry source="site" target="latitude"/>'
    )
    mapping = f'<ssm:ParameterMapping {HEAD} version="1.0">{entries}</ssm:ParameterMapping>'
    binding = (
        '<ssd:ParameterBinding source="resources/bench.ssv"><ssd:ParameterMapping source="resources/bench.ssm"/>'
        "</ssd:ParameterBinding>"
    )
    computer = inline("algorithm|Enumeration|mean-rate", "renormalise|Boolean|0")
    system_text = system(
        "root", component("table", "TurntableMotion", binding), component("computer", "AttitudeComputer", computer)
    )
    path = packed(
        tmp_path, fmus, system_text, "TurntableMotion", "AttitudeComputer", bench_ssv=written, bench_ssm=mapping
    )
    scenario, ignored = imported(path)
    table = scenario.fmus["table"].parameters
    assert table.pop("temperature") == pytest.approx(26.85, abs=1e-12)
    assert table.pop("kappa") == pytest.approx(math.radians(0.5), rel=1e-15)
    assert table.pop("epsilon") == pytest.approx(math.radians(-0.25), rel=1e-15)
    assert table == {"gravity": 9.81, "azimuth": 2.0, "latitude": 0.7, "seed": 8}
    assert ignored == ()
    assert scenario.fmus["computer"].parameters == {"algorithm": MEAN_RATE, "renormalise": False}
    # Without the annotation: the smallest step of an FMU's own experiment.
    assert (scenario.run.start_s, scenario.run.stop_s, scenario.run.step_s) == (2.0, 4.0, 0.01)


@pytest.mark.parametrize(
    ("parameter", "says"),
    [
        ("gain|Real|abc", "'abc' is not a value of gain, which is Real"),
        ("gain|Real|nan", "gain = nan is not a finite number"),
        ("gain|Boolean|true", "is Boolean, but gain is Real"),
        ("times|Real|2", "is Real, but times is Integer"),
        ("times|Integer|99999999999", "does not fit 32 bits"),
        ("inverted|Boolean|yes", "'yes' is not a value of inverted"),
        ("gain|Real|1_000", "'1_000' is not a value of gain"),
        ("times|Integer|٣", "'٣' is not a value of times"),
        ("gain|Real|1&#10;2", "'1 2' is not a value of gain"),
        (f"times|Integer|{'x' * 5000}", "which is Integer"),
        ("gain|Binary|00", "parameter 'gain' has no value of a type that FMI 2.0 has"),
    ],
)
def test_a_value_that_a_parameter_does_not_take(tmp_path, fmus, parameter, says):
    system_text = system("root", component("gain", "Gain", inline(parameter)), after=STEP)
    assert says in refusal(packed(tmp_path, fmus, system_text, "Gain"))


@pytest.mark.parametrize(
    ("written", "says"),
    [
        ("kappa|Real|1|K", "parameter 'kappa': K cannot be converted to rad"),
        ("kappa|Real|1|furlong", "parameter 'kappa': furlong cannot be converted to rad"),
        ("kappa|Real|2|rad", "kappa = 2.0 is outside its limits [-0.5, 0.5]"),
        ("kappa|Real|1e-3|x", "the exponent of rad is 0.5, not a whole number"),
    ],
)
def test_a_value_in_another_unit_or_outside_its_limits(tmp_path, fmus, written, says):
    broken = '<ssc:Unit name="x"><ssc:BaseUnit rad="0.5"/></ssc:Unit>' if written.endswith("x") else ""
    units = f'<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>{broken}'
    system_text = system("root", component("table", "TurntableMotion", inline(written, units=units)), after=STEP)
    assert says in refusal(packed(tmp_path, fmus, system_text, "TurntableMotion"))


GAIN = component("gain", "Gain", u_1="input", y_1="output")
OTHER = component("other", "Gain", u_1="input", y_1="output")
SCALED = '<ssc:LinearTransformation factor="2" offset="0.5"/>'
TABLE = '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/></ssc:IntegerMappingTransformation>'


def alone(model: str = "Gain", *bound: str, attributes: str = "") -> str:
    """Return a system of one FMU."""
    return system("root", component("g", model, *bound, attributes=attributes))


@pytest.mark.parametrize(
    ("system_text", "says"),
    [
        (
            system("root", GAIN, OTHER, wires=wire("gain.y[1]", "other.u[1]", TABLE)),
            "IntegerMappingTransformation, which is not supported",
        ),
        (system("root", GAIN, wires=wire("gain.y[1]", "none.u[1]")), "an element 'none' that is not there"),
        (system("root", GAIN, GAIN), "two elements 'gain'"),
        (system("root"), "has no FMU"),
        (alone(), "give --step"),
        ("", "has no System"),
        (alone(attributes='type="application/x-ssp-package"'), "x-ssp-package"),
        (alone(attributes='implementation="ModelExchange"'), "has no model exchange"),
        (alone("None"), "has no file 'resources/None.fmu'"),
        (alone("../../Gain"), "would leave the archive's folder"),
        (system("root", '<ssd:Component name="g" source="file:///etc/passwd"/>'), "not a file of the archive"),
        (system("root", '<ssd:SignalDictionaryReference name="g" dictionary="bus"/>'), "a signal dictionary 'bus'"),
        (system("root", '<ssd:Other name="g"/>'), "element 'g' is a Other, which is not supported"),
        (alone("Gain", '<ssd:ParameterBinding source="x.ssv"/>'), "has no file 'x.ssv'"),
        (alone("Gain", "<ssd:ParameterBinding/>"), "neither a source nor values"),
    ],
)
def test_what_is_not_supported_or_wrong_is_named(tmp_path, fmus, system_text, says):
    message = refusal(packed(tmp_path, fmus, system_text, "Gain"))
    assert says in message
    assert message.startswith(str(tmp_path / "made.ssp"))


def test_an_experiment_that_says_no_end_or_none_that_can_be_counted(tmp_path, fmus):
    system_text = system("root", GAIN, after=STEP)
    soon = '<ssd:DefaultExperiment stopTime="soon"/>'
    assert "'soon', not a finite number" in refusal(packed(tmp_path, fmus, system_text, "Gain", tail=soon))
    result = library.simulate(packed(tmp_path, fmus, system_text, "Gain", tail=""))
    assert result.table["time_s"].to_list() == [0.0, 0.5, 1.0]
    assert "says no stop time: the run ends at 1 s" in result.notes[0]
    ages = '<ssd:DefaultExperiment startTime="-1e308" stopTime="1e308"/>'
    with pytest.raises(InputError, match="makes inf steps; at most"):
        run(packed(tmp_path, fmus, system_text, "Gain", tail=ages))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="skipped: no named pipes")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    for name in ("made.ssp", "made.fmu"):
        os.mkfifo(tmp_path / name)
    assert "is not a regular file" in refusal(tmp_path / "made.ssp")
    fmus = {"a": {"fmu": "made.fmu"}}
    settings = {"run": {"step_s": 0.1, "stop_s": 1.0}, "fmus": fmus, "base_folder": tmp_path}
    with pytest.raises(InputError, match="is not a regular file"):
        run_scenario(Scenario.model_validate(settings))


@pytest.mark.acceptance
def test_a_cycle_is_refused_as_in_a_scenario(tmp_path, fmus, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    around = wire("gain.y[1]", "other.u[1]") + wire("other.y[1]", "gain.u[1]")
    path = packed(tmp_path, fmus, system("root", GAIN, OTHER, wires=around, after=STEP), "Gain")
    assert cli.main(["simulate", path.name]) == 2
    assert "gain -> other -> gain" in capsys.readouterr().err
    assert cli.main(["simulate", path.name, "--coupling", "jacobi", "--out", "around"]) == 0
    shutil.rmtree(tmp_path / "made-run", ignore_errors=True)
    straight = packed(tmp_path, fmus, system("root", GAIN, bound=(inline("gain.gian|Real|1"),)), "Gain")
    assert cli.main(["simulate", straight.name, "--step", "1", "--out", "r"]) == 0
    assert "1 parameters name nothing in it: gain.gian" in capsys.readouterr().err


@pytest.mark.acceptance
def test_a_connection_may_transform_its_value(tmp_path, fmus):
    """2 x + 0.5, also through the connector of a system, whose own value takes the same way."""
    inner = system("inner", GAIN, wires=wire("u", "gain.u[1]", SCALED) + wire("gain.y[1]", "y"), u="input", y="output")
    clock = component("clock", "Clock", ended="output")
    wired = wire("clock.ended", "inner.u") + wire("inner.y", "other.u[1]", SCALED)
    table = run(packed(tmp_path, fmus, system("root", clock, inner, OTHER, wires=wired, after=STEP), "Gain", "Clock"))
    ended = [0.0, 2.5, 3.0, 3.5, 4.0]
    assert table["clock.ended"] == ended
    assert table["inner_gain.y[1]"] == [2.0 * t + 0.5 for t in ended]
    assert table["other.y[1]"] == [2.0 * y + 0.5 for y in table["inner_gain.y[1]"]]
    bound = system("inner", GAIN, wires=wire("u", "gain.u[1]", SCALED), u="input")
    text = system("root", bound, bound=(inline("inner.u|Real|3"),), after=STEP)
    assert set(run(packed(tmp_path, fmus, text, "Gain"))["inner_gain.y[1]"]) == {6.5}


@pytest.mark.acceptance
def test_what_other_tools_write_is_read(tmp_path, fmus):
    """An empty element is the system; the Open Simulation Platform's step; any implementation; times by options."""
    experiment = (
        '<ssd:DefaultExperiment startTime="0" stopTime="2"><ssd:Annotations><ssc:Annotation type="com.osp">'
        '<a><FixedStepAlgorithm baseStepSize="0.25"/></a></ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>'
    )
    gain = component("gain", "Gain", attributes='implementation="any"', u_1="input", y_1="output")
    empty = '<ssd:Connection startElement="" startConnector="u" endElement="gain" endConnector="u[1]"/>'
    text = system("root", gain, wires=empty, bound=(inline("u|Real|1.5"),), u="input")
    path = packed(tmp_path, fmus, text, "Gain", tail=experiment)
    result = library.simulate(path)
    assert result.table.height == 9
    assert set(result.table["gain.y[1]"]) == {1.5}
    options = {"start": 1.0, "stop": 2.1, "step": 0.5, "values": ["gain.gain=5"], "record": ["gain.gain", "gain.y[1]"]}
    result = library.simulate(path, **options)
    assert result.table["time_s"].to_list()[:3] == [1.0, 1.5, 2.0]
    assert result.columns == ["time_s", "gain.gain", "gain.y[1]"]
    assert set(result.table["gain.y[1]"]) == {7.5}
    assert "0.5 s does not divide the run of 1.1 s" in result.notes[0]


@pytest.mark.acceptance
def test_units_that_connectors_declare_convert_values(tmp_path):
    """20 degC at the connector of a system are 293.15 K in its FMU, and 20 again where an FMU knows no unit."""
    kelvin = ((" start='0'", " start='0' unit='K'"), ("<Real />", "<Real unit='K'/>"))
    warm = build_habit(Habit("warm", changes=kelvin), 2, "CoSimulation", tmp_path).stem
    plain = build_habit(Habit("plain"), 2, "CoSimulation", tmp_path).stem
    units = '<ssd:Units><ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>'
    units += '<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>'
    units += '<ssc:Unit name="rad"><ssc:BaseUnit rad="1"/></ssc:Unit></ssd:Units>'

    def outcome(bound: str, scaled: str = "", unit: str = "degC") -> list[float]:
        inner = system(
            "hot", component("a", warm, d="input", y="output"), wires=wire("T", "a.d") + wire("a.y", "out", scaled)
        )
        ends = "".join(
            f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real unit="{unit}"/></ssd:Connector>'
            for name, kind in (("T", "input"), ("out", "output"))
        )
        inner = inner.replace("<ssd:Elements>", f"<ssd:Connectors>{ends}</ssd:Connectors><ssd:Elements>", 1)
        others = [component("b", warm, d="input", y="output"), component("c", plain, d="input", y="output")]
        wires = wire("hot.out", "b.d") + wire("hot.out", "c.d")
        text = system("root", inner, *others, wires=wires, bound=(inline(bound),), after=STEP)
        table = run(packed(tmp_path, tmp_path, text, warm, plain, tail=units))
        return [table[name][-1] for name in ("hot_a.y_K", "b.y_K", "c.y")]

    assert outcome("hot.T|Real|20") == pytest.approx([293.15, 293.15, 20.0])
    assert outcome("hot.T|Real|300|K") == pytest.approx([300.0, 300.0, 26.85])
    # The transformation acts in K: twice 293.15 K and half a kelvin.
    assert outcome("hot.T|Real|20", SCALED) == pytest.approx([293.15, 586.8, 313.65])
    with pytest.raises(InputError, match=r"a connection to \S+: (K|rad) cannot be converted to (K|rad)"):
        outcome("hot.T|Real|20", unit="rad")


@pytest.mark.acceptance
def test_a_source_may_be_any_relative_address(tmp_path, fmus):
    for source in ("./resources/Gain.fmu", "resources/../resources/Gain.fmu", "resources/%47ain.fmu"):
        text = system(
            "root", GAIN.replace("resources/Gain.fmu", source), bound=(inline("gain.u[1]|Real|4"),), after=STEP
        )
        assert set(run(packed(tmp_path, fmus, text, "Gain"))["gain.y[1]"]) == {4.0}
    outside = system("root", GAIN.replace("resources/Gain.fmu", "resources/../../Gain.fmu"), after=STEP)
    assert "would leave the archive's folder" in refusal(packed(tmp_path, fmus, outside, "Gain"))


@pytest.mark.acceptance
def test_where_a_value_and_a_connection_meet_the_connection_counts(tmp_path, fmus):
    clock = component("clock", "Clock", ended="output")
    gain = component("gain", "Gain", inline("u[1]|Real|99"), u_1="input", y_1="output")
    text = system("root", clock, gain, wires=wire("clock.ended", "gain.u[1]"), after=STEP)
    result = library.simulate(packed(tmp_path, fmus, text, "Gain", "Clock"))
    assert result.table["gain.y[1]"].to_list() == result.table["clock.ended"].to_list()
    assert result.notes == ("gain.u[1] has a value and a connection: the connection from clock.ended counts",)
    # So does one on the command line.
    text = system("root", clock, GAIN, wires=wire("clock.ended", "gain.u[1]"), after=STEP)
    result = library.simulate(packed(tmp_path, fmus, text, "Gain", "Clock"), values=["gain.u[1]=99"])
    assert result.table["gain.y[1]"].to_list() == result.table["clock.ended"].to_list()
    assert result.notes == ("gain.u[1] has a value and a connection: the connection from clock.ended counts",)


@pytest.mark.acceptance
def test_signal_dictionaries_join_what_is_connected_to_them(tmp_path, fmus):
    """Two references, one in a nested system, share the signals of one dictionary, with connections either way."""
    dictionary = '<ssd:SignalDictionary name="bus" source="resources/bus.ssb"/>'
    bus = f"<ssd:SignalDictionaries>{dictionary}</ssd:SignalDictionaries><ssd:Elements>"

    def reference(name: str, kind: str) -> str:
        ends = f'<ssd:Connectors><ssd:Connector name="rate" kind="{kind}"/></ssd:Connectors>'
        return f'<ssd:SignalDictionaryReference name="{name}" dictionary="bus">{ends}</ssd:SignalDictionaryReference>'

    clock = component("clock", "Clock", ended="output")
    for kind, first, second in (
        ("inout", wire("clock.ended", "here.rate", SCALED), wire("there.rate", "gain.u[1]")),
        ("inout", wire("here.rate", "clock.ended", SCALED), wire("gain.u[1]", "there.rate")),
        ("input", wire("clock.ended", "here.rate", SCALED), wire("gain.u[1]", "there.rate")),
    ):
        inner = system("inner", reference("there", "inout"), GAIN, wires=second)
        text = system("root", clock, inner, reference("here", kind), wires=first, after=STEP)
        simulation = run(packed(tmp_path, fmus, text.replace("<ssd:Elements>", bus, 1), "Gain", "Clock"))
        assert simulation["inner_gain.y[1]"] == [2.0 * time + 0.5 for time in simulation["clock.ended"]]
        inside = system("root", inner.replace("<ssd:Elements>", bus, 1), reference("here", kind), after=STEP)
        assert "a signal dictionary 'bus' that is not there" in refusal(packed(tmp_path, fmus, inside, "Gain"))


def test_the_step_is_that_of_the_outermost_master(tmp_path, fmus):
    inner = system("inner", GAIN, after=STEP)
    text = system("root", inner, after=STEP.replace("0.5", "0.25"))
    assert imported(packed(tmp_path, fmus, text, "Gain"))[0].run.step_s == 0.25


@pytest.mark.first(1)
@pytest.mark.parametrize("version", [2, 3])
def test_model_exchange_in_a_system(tmp_path, version):
    """x' = 1 - k x in a nested system, k by a mapping with a transformation, its output in units of its own."""
    fmu = build_habit(Habit("plant"), version, "ModelExchange", tmp_path)
    entries = (
        '<ssm:MappingEntry source="rate" target="plant.k"><ssc:LinearTransformation factor="0.5" offset="1"/>'
        '</ssm:MappingEntry><ssm:MappingEntry source="push" target="plant.u"/>'
    )
    mapping = f'<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{entries}</ssm:ParameterMapping>'
    bound = inline("rate|Real|2", "push|Real|1", mapping=f"{mapping}</ssd:ParameterMapping>")
    for attributes in ("", 'implementation="ModelExchange"'):
        plant = component("plant", fmu.stem, attributes=attributes, u="input", x="output")
        inner = system("inner", plant, bound=(bound,), wires=wire("plant.x", "level"), level="output")
        text = system("root", inner, after=STEP)
        table = run(packed(tmp_path, tmp_path, text, fmu.stem, tail='<ssd:DefaultExperiment stopTime="1"/>'))
        exact = [(1.0 - math.exp(-2.0 * time)) / 2.0 for time in table["time_s"]]
        assert table["inner_plant.x"] == pytest.approx(exact, abs=2e-5)
