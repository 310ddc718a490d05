"""Every command of the program with working arguments, for tests over all commands."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from generator.carried import POSES, strapdown_record, true_motion
from generator.positions import write_hidden_record
from generator.tables import PROGRAMME, Errors, Programme, Truth, bench_record
from simulated_table import SimulatedTable
from trihedron.models.effects import EffectPlace
from trihedron.tools import cli
from trihedron.tools.records import write_record
from trihedron.tools.templates import new

SCENARIO = """schema = "trihedron.scenario/1"
[run]
stop_s = 2.0
step_s = 0.1
[fmus.table]
component = "TurntableMotion"
flavour = "python"
[record]
format = "csv"
"""
CAMPAIGN = """schema = "trihedron.campaign/1"
seed = 1
[calibration]
noise_bound = 1e-5
[sampling]
points = 4
[parameters]
kappa = { uniform = [-1e-3, 1e-3] }
"""


@dataclass(frozen=True)
class Command:
    """A command that works in a folder of `make_inputs`.

    Attributes
    ----------
    arguments : tuple of str
        "out" and "out.*" are its outputs
    inputs : tuple of str
        the arguments that are input files
    slow : bool
        True if it takes more than a few seconds
    """

    arguments: tuple[str, ...]
    inputs: tuple[str, ...] = ()
    slow: bool = False

    @property
    def title(self) -> str:
        return " ".join(self.arguments[:2])


def command(line: str, *inputs: str, slow: bool = False) -> Command:
    return Command(tuple(line.split()), inputs, slow)


COMMANDS = (
    command("simulate run.toml --out out --json out.json --plot out.html", "run.toml"),
    command("calibrate clean.csv --noise-bound 1e-5 --json out.json --report out.html --ssv out.ssv", "clean.csv"),
    command(
        "calibrate bench.csv --noise-bound 1.2e-5 --latitude-deg 55.75 --azimuth-deg 20 --ssv out.ssv "
        "--strapdown out.csv --json out.json",
        "bench.csv",
    ),
    command("calibrate clean.csv --noise-bound 1e-5 --export out", "clean.csv"),
    command("calibrate clean.csv --noise-bound 1e-5 --sheet out.html --about about.toml", "clean.csv", "about.toml"),
    command("calibrate clean.csv measured.csv --noise-bound 1e-5 --own * --json out.json", "clean.csv", "measured.csv"),
    command("diagnose measured.csv --noise-bound 1e-5 --json out.json --report out.html --export out", "measured.csv"),
    command("apply calibration.json clean.csv --out out.csv --json out.json", "calibration.json", "clean.csv"),
    command("export-calibration calibration.json --to c --out out.h --json out.json", "calibration.json"),
    command("inspect strapdown.csv --json out.json --allan out.svg --plot out.html", "strapdown.csv"),
    command("noise strapdown.csv --dwell 1 --json out.json --report out.html --kalibr out.yaml", "strapdown.csv"),
    command("attitude strapdown.csv --out out --json out.json --plot out.html", "strapdown.csv"),
    command("fmpy-input strapdown.csv --out out.csv --json out.json", "strapdown.csv"),
    command("hidden out.csv --seed 3 --answer out-answer.json --json out.json"),
    command("hidden --cases 1 --mode clean --positions 12 14 --out out --json out.json"),
    command(
        "measure angles-to-set.csv --from growing.csv --out out.csv --noise-bound 1e-5 --patience 0 --json out.json",
        *("angles-to-set.csv", "growing.csv"),
    ),
    command("export AccelerometerBlock --out out --json out.json"),
    command("export-ssp run.toml --out out.ssp --flavour python --json out.json", "run.toml"),
    command("plan target X4 --grid 15 --json out.json --report out.html --picture out.svg"),
    command("plan positions 6 --starts 1 --cuts 0 --out out --json out.json --report out.html"),
    command("plan hand --measured strapdown.csv --json out.json --report out.html", "strapdown.csv"),
    command("plan imu --minutes 15 --exchanges 0 --out out --json out.json --report out.html", slow=True),
    command("plan check angles.csv --json out.json", "angles.csv"),
    command("import foreign.csv --out out.csv --json out.json", "foreign.csv"),
    command("check run.toml --json out.json", "run.toml"),
    command("new scenario out.toml --json out.json"),
    command("export-notebook clean.csv --noise-bound 1e-5 --out out.ipynb --json out.json", "clean.csv"),
    command("completion bash --json out.json"),
    command("open clean.csv --no-browser --duration 0 --json out.json", "clean.csv"),
    command("campaign campaign.toml --jobs 1 --out out --json out.json", "campaign.toml"),
    # A record that cannot be used is a row of a batch, not its end.
    command("batch clean.csv measured.csv --do calibrate --noise-bound 1e-5 --jobs 1 --out out --json out.json"),
    command("campaign-report finished --report out.html --json out.json"),
    command("compare clean.csv measured.csv --report out.html --json out.json", "clean.csv", "measured.csv"),
    command("plot strapdown.csv out.html --json out.json", "strapdown.csv"),
    command("doctor --json out.json"),
    command("instrument add out calibration.json --date 2026-11-23 --json out.json", "calibration.json"),
    command("instrument list unit --json out.json"),
    command("instrument show unit --out out.json"),
    command("instrument trend unit --json out.json --report out.html"),
    command("reproduce calibration --json out.json", slow=True),
    command("reproduce attitude --json out.json --out out", slow=True),
    command("reproduce word-length --json out.json", slow=True),
    command("demo --no-show --out out --json out.json", slow=True),
)


QUICK = [command for command in COMMANDS if not command.slow]


def make_inputs(folder: Path) -> None:
    """Write the files that the commands read."""
    from trihedron.tools.calibration import calibrate
    from trihedron.tools.records import PositionRecord, read_record

    turns = ((0.0, 0.0), (360.0, 0.0), (360.0, 90.0), (0.0, 90.0), (90.0, 450.0))
    motion = Programme((*PROGRAMME.positions[:24:2], *turns), dwell=4.0, rate=2.0, step=0.05)
    truth = Truth.drawn(np.random.default_rng(5))
    write_record(bench_record(truth, motion, Errors(rate=5e-5, encoder=2e-6)), folder / "bench.csv")
    (folder / "run.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "about.toml").write_text('operator = "A. Person"\n', encoding="utf-8")
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    write_hidden_record(folder / "measured.csv", 5, EffectPlace("quadratic", "accelerometer-2"), (6e-4,))
    write_hidden_record(folder / "clean.csv", 5)
    clean = (folder / "clean.csv").read_text(encoding="utf-8")
    (folder / "foreign.csv").write_text(clean.replace(",", ";").replace(".", ","), encoding="cp1252")
    calibration = calibrate(read_record(folder / "clean.csv", PositionRecord), noise_bound=1e-5)
    (folder / "calibration.json").write_text(calibration.json_text(), encoding="utf-8")
    unnamed = calibration.model_copy(update={"provenance": None}).json_text()
    for k, date in enumerate(("2026-11-02", "2026-11-16")):
        (folder / "again.json").write_text(unnamed + k * "\n", encoding="utf-8")
        assert (
            cli.main(["instrument", "add", *(str(folder / n) for n in ("unit", "again.json")), "--date", date, "-q"])
            == 0
        )
    finished = ["--jobs", "1", "--out", str(folder / "finished"), "--quiet"]
    assert cli.main(["campaign", str(folder / "campaign.toml"), *finished]) == 0
    record = strapdown_record(true_motion(POSES[:6]))
    write_record(record, folder / "strapdown.csv")
    new("scenario", folder / "bench.toml")
    angles = pl.read_csv(folder / "bench-positions.csv", comment_prefix="#")
    angles.write_csv(folder / "angles-to-set.csv")
    table = SimulatedTable(folder / "growing.csv")
    for alpha, beta in angles.rows()[:2]:
        table.go(alpha, beta)
    planned = {f"planned_{name}": angles[name] for name in angles.columns}
    moved = {name: angles[name] + np.linspace(-0.01, 0.01, angles.height) for name in angles.columns}
    pl.DataFrame({**planned, **moved}).write_csv(folder / "angles.csv")


def files(folder: Path) -> dict[str, bytes]:
    """Return the content of a folder and its subfolders."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
