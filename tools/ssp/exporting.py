"""A scenario as an .ssp: its system for other tools."""

import json
import re
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

from ...fmus import build
from ...fmus.archive import write_archive
from ...fmus.native.compile import BuildError, chosen_platforms
from ...models.effects import place_from_mapping
from ..errors import InputError
from ..exporting import Flavour
from ..files import whole_file
from ..orchestrator.connections import check_single_sources, resolve_connections
from ..orchestrator.grid import make_grid
from ..orchestrator.interface import spread
from ..orchestrator.loading import Loaded, Sources, load
from ..orchestrator.parameters import calibrated_parameters
from ..scenario import FmuSetting, Scenario
from .namespaces import STRUCTURE
from .parameters import WrittenSet, mapping_xml, parameter_set_xml
from .self_contained import PROGRAMME, self_contained
from .structure import Structure, structure_xml

RECORD = "extra/trihedron/record.json"
"""What the scenario records, for `trihedron simulate`; other tools do not read it."""

COUPLING = "extra/trihedron/coupling.json"
"""How the scenario takes cycles, for `trihedron simulate`; there only where it says so."""

COUPLING_SETTINGS = ("coupling", "tolerance", "iterations")
"""What `[run]` says of cycles."""


def export_ssp(
    scenario: Scenario,
    out: Path,
    *,
    flavour: Flavour | None = None,
    fmi: int = 2,
    platform: str | None = None,
) -> Path:
    """Write the system of a scenario as an .ssp of SSP 1.0.

    Parameters
    ----------
    scenario : Scenario
        position programmes become components PositionProgramme, constants become parameters
    out : Path
        the file; the same scenario gives the same bytes
    flavour : str, optional
        "python": components run by PythonFMU, which C++ hosts cannot load; "native": compiled, the default where
        there is a compiler
    fmi : int
        2: the tools that open an .ssp take FMI 2.0
    platform : str, optional
        of the native flavour: "host" (the default), "all" or a name

    Returns
    -------
    Path
        the file

    Raises
    ------
    InputError
        what the scenario asks for and cannot be done, or what cannot stand in an .ssp: timed rows, names that other
        tools do not take
    """
    if out.suffix.lower() != ".ssp":
        raise InputError(f"{out}: must end in .ssp; other tools know it by that")
    if fmi != 2:
        raise InputError(f"--fmi {fmi}: an .ssp has FMUs of FMI 2.0; FMPy and OMSimulator run no others in it")
    if flavour is None:
        flavour = _best_flavour(platform)
    if flavour == "python" and platform is not None:
        raise InputError("--platform: belongs to --flavour native; PythonFMU brings its own binaries")
    try:
        if flavour == "native":
            chosen_platforms("host" if platform is None else platform)
        with tempfile.TemporaryDirectory(prefix="trihedron-ssp-", ignore_cleanup_errors=True) as scratch:
            members = _members(scenario, flavour, "host" if platform is None else platform, Path(scratch))
    except BuildError as error:
        raise InputError(f"--flavour native: {error}") from error
    except InputError as error:
        prefix = f"{scenario.source}: " if scenario.source is not None else ""
        raise InputError(f"{prefix}{error}") from error
    with whole_file(out) as beside:
        write_archive(beside, members, first=STRUCTURE)
    return out


def _best_flavour(platform: str | None) -> Flavour:
    """Native where something compiles it, or where a platform is asked for."""
    try:
        chosen_platforms("host")
    except BuildError:
        return "python" if platform is None else "native"
    return "native"


def _members(scenario: Scenario, flavour: Flavour, platform: str, folder: Path) -> dict[str, bytes]:
    """The files of the archive."""
    for name in scenario.fmus:
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
            raise InputError(f"fmus.{name}: other tools take names of letters, digits and _ only; rename it")
    whole = self_contained(scenario)
    sources = Sources(whole.base_folder)
    (folder / "loaded").mkdir()
    loaded = load(whole, sources, folder / "loaded")
    interfaces = {name: entry.interface for name, entry in loaded.items()}
    wires = resolve_connections(whole.connections, interfaces)
    check_single_sources(wires, [])
    grid = make_grid(whole.run, [])
    files, members = _fmu_files(whole, flavour, platform, folder)
    sets = _parameter_sets(whole, loaded, sources)
    stem = scenario.source.stem if scenario.source is not None else "scenario"
    structure = Structure(
        re.sub(r"\W", "_", stem, flags=re.ASCII),
        scenario.title,
        {name: (files[name], interfaces[name]) for name in interfaces},
        [(wire.source, wire.output, wire.target, wire.input) for wire in wires],
        sets,
        grid.start,
        grid.time(grid.steps),
        grid.step,
    )
    members[STRUCTURE] = structure_xml(structure)
    for each in sets:
        members[each.file] = parameter_set_xml(each)
        if each.mapping_file is not None:
            members[each.mapping_file] = mapping_xml(each.mapping)
    written = scenario.as_written()
    members[RECORD] = _json_bytes(written["record"])
    coupling = {name: written["run"][name] for name in COUPLING_SETTINGS if name in written["run"]}
    if coupling:
        members[COUPLING] = _json_bytes(coupling)
    return members


def _json_bytes(value: object) -> bytes:
    return (json.dumps(value, indent=2, ensure_ascii=False) + "\n").encode()


def _fmu_files(
    scenario: Scenario, flavour: Flavour, platform: str, folder: Path
) -> tuple[dict[str, str], dict[str, bytes]]:
    """Each FMU's file in the archive, and the files; FMUs with the same content share one."""
    files: dict[str, str] = {}
    members: dict[str, bytes] = {}
    for name, setting in scenario.fmus.items():
        if setting.fmu is not None:
            stem, content = PurePosixPath(setting.fmu).stem, (scenario.base_folder / setting.fmu).read_bytes()
        else:
            places = [place_from_mapping(entry)[0] for entry in setting.effects]
            stem = str(setting.component)
            built = build(stem, folder / name, places, flavour=flavour, fmi=2, platform=platform)
            content = built.read_bytes()
        names = [f"resources/{stem}.fmu", *(f"resources/{stem}_{i}.fmu" for i in range(2, len(members) + 3))]
        files[name] = next(n for n in names if members.get(n, content) == content)
        members[files[name]] = content
    return files, members


def _parameter_sets(scenario: Scenario, loaded: Mapping[str, Loaded], sources: Sources) -> list[WrittenSet]:
    """One set for each calibration, mapped to the FMUs that take it; over them the scenario's own values."""
    sets: dict[str, WrittenSet] = {}
    own = WrittenSet("parameters", "parameters of the scenario")
    for name, entry in loaded.items():
        setting = scenario.fmus[name]
        calibrated: dict[str, object] = {}
        if setting.parameters_from is not None:
            calibrated = _add_calibration(sets, setting, entry, sources)
        explicit = {v.name for key in setting.parameters for v in entry.interface.find(key)}
        for element, (variable, value) in entry.values.items():
            if element in explicit or element not in calibrated:
                own.add(f"{name}.{element}", variable, value, entry.interface.scales)
        if setting.component == PROGRAMME:
            # Other tools pass outputs on when all FMUs have stepped: what the table does next must be out by then.
            lead = entry.interface.variables["lead_steps"]
            own.add(f"{name}.lead_steps", lead, 1, entry.interface.scales)
    return [*sets.values(), *([own] if own.values else [])]


def _add_calibration(
    sets: dict[str, WrittenSet], setting: FmuSetting, entry: Loaded, sources: Sources
) -> dict[str, object]:
    """Add what a calibration says of an FMU to its set; returns it by element."""
    label = str(setting.parameters_from)
    interface = entry.interface
    component = setting.component or interface.model
    found: dict[str, object] = {}
    if label not in sets:
        sets[label] = WrittenSet(_free(PurePosixPath(label).stem, sets.values()), f"calibration {label}")
    written = sets[label]
    for key, given in calibrated_parameters(sources.read(label), label, component).items():
        for variable, value in spread(given, interface.find(key), key):
            found[variable.name] = value
            shown = f"{component}.{variable.name}"
            written.add(shown, variable, value, interface.scales)
            written.mapping.setdefault(shown, []).append(f"{interface.name}.{variable.name}")
    return found


def _free(stem: str, sets: Iterable[WrittenSet]) -> str:
    taken = {"parameters", *(each.name for each in sets)}
    return next(n for n in [stem, *(f"{stem}_{i}" for i in range(2, len(taken) + 3))] if n not in taken)
