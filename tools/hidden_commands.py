"""The command that hides effects: one record, or a whole suite of them, diagnosed and counted."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .errors import InputError
from .options import Baseline, JsonFile, OutFolder
from .outputs import distinct_files, ordinary_file


def hidden(
    record: Annotated[
        Path | None, Parameter(help="Where one position record is written (CSV).", validator=ordinary_file)
    ] = None,
    /,
    *,
    seed: int | None = None,
    secret: Annotated[Path | None, Parameter(name="--answer", validator=ordinary_file)] = None,
    effect: Annotated[
        tuple[str, ...],
        Parameter(name=("--effect", "--effects"), help="Draw from these effects only; may be repeated."),
    ] = (),
    clean: bool = False,
    strapdown: bool = False,
    baseline: Baseline | None = None,
    cases: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None,
    suite: str | None = None,
    mode: Literal["clean", "single", "between", "pairs"] | None = None,
    positions: tuple[int, int] | None = None,
    size: Annotated[tuple[float, float] | None, Parameter(allow_leading_hyphen=True)] = None,
    noise: Literal["uniform", "edge", "correlated", "all"] | None = None,
    out: OutFolder | None = None,
    jobs: int = 1,
    json: JsonFile = None,
) -> Answer:
    """Make a "measured" record with one hidden effect, or with --cases a suite: many records, diagnosed and counted.

    Example: trihedron hidden measured.csv --seed 7 --answer answer.json

    Example: trihedron hidden --cases 100 --seed 1 --mode single --out suite

    Example: trihedron hidden --suite quick-single

    Example: trihedron hidden moved.csv --strapdown --seed 7 --answer answer.json

    Parameters
    ----------
    seed
        Decides truth, effect, size and noise; 0 by default.
    secret
        Of one record: where the secret is written; without it nobody will know.
    clean
        Hide nothing.
    strapdown
        A record of gyros and accelerometers that are moved by hand, in place of one of a table's positions.
    baseline
        Of one record: whether the block's scale factors depend on the sign; symmetric lets scale-asymmetry be hidden.
    cases
        So many records are drawn, measured and diagnosed; a case is the same whatever their number.
    suite
        A suite of scenarios/hidden/suites.toml: clean, single, between, pairs, detection, or quick- before one of the
        first four. It decides what is drawn, and, unless they are given, --cases and --seed.
    mode
        Of a suite: nothing hidden; one effect that every rival is surely excluded for (the default); one that is only
        surely detected; two effects.
    positions
        Of a suite: fewest and most positions, 12 and 100 by default.
    size
        Of a suite: least and greatest size relative to that of sure detection, in place of those of the mode.
    noise
        Of a suite: uniform within σ, at ±σ everywhere, wandering within σ, or one after the other (the default).
    out
        Of a suite: folder for the results (JSON, CSV, page) and the records.
    jobs
        Of a suite: number of processes.
    """
    if clean and (effect or mode not in (None, "clean")):
        raise InputError(f"--clean and --{'effect' if effect else 'mode'}: give one of the two")
    if strapdown:
        only = {"--baseline": baseline, "--suite": suite, "--mode": mode, "--positions": positions, "--noise": noise}
        refuse(only, "is of records of a table's positions; leave it out with --strapdown")
        return of_strapdown_records(record, seed or 0, secret, effect, cases, size, out, jobs, json, clean=clean)
    drawn = {"--mode": mode, "--positions": positions, "--size": size, "--noise": noise}
    if cases is None and suite is None:
        refuse({**drawn, "--out": out}, "is of a suite; give --cases too, as --cases 100")
        if record is None:
            raise InputError("hidden: give the file of one record, as measured.csv, or --cases for a suite")
        return one_record(record, seed or 0, secret, effect, json, clean=clean, baseline=baseline or "asymmetric")
    only = {"the record": record, "--answer": secret, "--baseline": baseline}
    refuse(only, "is of one record, --cases and --suite of many; give one of the two (many have --out)")
    from .hidden_suite.cases import SuiteOptions
    from .hidden_suite.suite import NamedSuite, named_suite, run_suite
    from .hidden_suite.summary import write_suite

    if suite is not None:
        refuse({**drawn, "--effect": effect or None, "--clean": clean or None}, "is what --suite decides")
        named = named_suite(suite)
    else:
        chosen = "clean" if clean else mode or "single"
        named = NamedSuite(SuiteOptions(chosen, effect, positions or (12, 100), noise or "all", size), 100, 0)
    done = run_suite(
        named.options,
        named.cases if cases is None else cases,
        named.seed if seed is None else seed,
        records=records_folder(out),
        jobs=jobs,
        progress=True,
    )
    files = write_suite(done, out) if out is not None else ()
    return answer([*done.lines(), *map(str, files)], json, done.to_json())


def of_strapdown_records(
    record: Path | None,
    seed: int,
    secret: Path | None,
    effect: tuple[str, ...],
    cases: int | None,
    size: tuple[float, float] | None,
    out: Path | None,
    jobs: int,
    json: Path | None,
    *,
    clean: bool,
) -> Answer:
    """One strapdown record with a secret, or a suite of them."""
    if cases is None:
        refuse({"--size": size, "--out": out}, "is of a suite; give --cases too, as --cases 100")
        if record is None:
            raise InputError("hidden: give the file of one record, as moved.csv, or --cases for a suite")
        distinct_files({"the record": record, "--answer": secret, "--json": json})
        from .hidden_strapdown.one_record import write_hidden_strapdown

        write_hidden_strapdown(record, seed, secret, effects=effect, clean=clean)
        return answer(str(record), json, {"schema": "trihedron.hidden-record/1", "record": str(record), "seed": seed})
    refuse({"the record": record, "--answer": secret}, "is of one record, --cases of many; give one of the two")
    from .hidden_strapdown.cases import SIZES
    from .hidden_strapdown.suite import StrapdownOptions, run_strapdown_suite
    from .hidden_strapdown.summary import suite_json, suite_text, write_suite

    options = StrapdownOptions(clean=clean, effects=effect, sizes=size or SIZES)
    done = run_strapdown_suite(options, cases, seed, records=records_folder(out), jobs=jobs, progress=True)
    files = write_suite(done, out) if out is not None else ()
    return answer([*suite_text(done).split("\n"), *map(str, files)], json, suite_json(done))


def refuse(given: Mapping[str, object], why: str) -> None:
    """Refuse the first option that was given."""
    for name, value in given.items():
        if value is not None:
            raise InputError(f"{name}: {why}")


def one_record(
    record: Path,
    seed: int,
    secret: Path | None,
    effect: tuple[str, ...],
    json: Path | None,
    *,
    clean: bool,
    baseline: Baseline,
) -> Answer:
    """Write one record with a secret."""
    distinct_files({"the record": record, "--answer": secret, "--json": json})
    from .hidden import write_hidden_record

    chosen = () if clean else effect or None
    write_hidden_record(record, seed, secret, effects=chosen, symmetric=baseline == "symmetric", progress=True)
    return answer(str(record), json, {"schema": "trihedron.hidden-record/1", "record": str(record), "seed": seed})


def records_folder(out: Path | None) -> Path | None:
    """The folder for a suite's records, made; None where nothing is written."""
    if out is None:
        return None
    folder = out / "records"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be made a folder ({error.strerror})") from error
    return folder
