"""Nearly correct inputs: a file of a command, or its options, changed at random; a seed decides everything."""

import gzip
import io
import json
import random
import re
import zipfile
from collections.abc import Callable
from typing import Any

import polars as pl

NUMBERS = (
    *("nan", "NaN", "inf", "-inf", "1e309", "-1e309", "1e-320", "4.9e-324", "-0", "0", "-1", "1e308", "1e-308", "1e15"),
    *("9" * 400, "0." + "1" * 300, "0x10", "1_000", "1,5", "1.2.3", "--1", "+1", ".5", "5.", "1e", "1d3", "१२", "１"),
    *("", " ", "null", "None", "true", "TRUE", "abc", "-", "=1+1", "#N/A", "1°30'", "10:00", "2026-01-01", "\u202e1"),
    *("9007199254740993", "18446744073709551616", "-9223372036854775809", "1e3000000", "%s", "{0}", "'", '"', "\\"),
)
"""Replacements for a number by people, programs or nobody."""
BYTES = (
    b"\0",
    b"\xff",
    b"\xef\xbb\xbf",
    b"\r",
    b"\n",
    b"\t",
    b",",
    b";",
    b'"',
    b"#",
    b"[",
    b"{",
    b"\x1b[2J",
    b"\xed\xa0\x80",
)
Text = Callable[[str, random.Random], str]
Bytes = Callable[[bytes, random.Random], bytes]


def flipped(data: bytes, rng: random.Random) -> bytes:
    """Flip some bits."""
    changed = bytearray(data)
    for _ in range(rng.choice([1, 1, 3, 30])):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def cut(data: bytes, rng: random.Random) -> bytes:
    """Cut the end off."""
    return data[: rng.randrange(len(data) + 1)]


def spliced(data: bytes, rng: random.Random) -> bytes:
    """Remove, double or move a part."""
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    at = rng.randrange(len(data) + 1)
    part = data[a:b]
    return rng.choice([data[:a] + data[b:], data[:at] + part + data[at:], part + data[:a] + data[b:], part])


def strewn(data: bytes, rng: random.Random) -> bytes:
    """Insert foreign bytes."""
    for _ in range(rng.choice([1, 2, 10])):
        at = rng.randrange(len(data) + 1)
        data = data[:at] + rng.choice([*BYTES, rng.randbytes(rng.choice([1, 8, 200]))]) + data[at:]
    return data


def recoded(data: bytes, rng: random.Random) -> bytes:
    """Change the encoding, or the ends of lines."""
    text = data.decode("utf-8", "replace")
    return rng.choice(
        [
            text.encode("utf-16"),
            text.encode("utf-16-le"),
            text.encode("utf-32"),
            b"\xef\xbb\xbf" + data,
            data.replace(b"\n", b"\r\n"),
            data.replace(b"\n", b"\r"),
            data.replace(b"\n", b"\n\n"),
            data.replace(b"\n", b""),
        ]
    )


ANY: tuple[Bytes, ...] = (flipped, cut, spliced, strewn, recoded)


def other_number(text: str, rng: random.Random) -> str:
    """Replace numbers by something else."""
    result = list(re.finditer(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?", text))
    for match in sorted(rng.sample(result, min(len(result), rng.choice([1, 1, 3, 20]))), key=lambda m: -m.start()):
        text = text[: match.start()] + rng.choice(NUMBERS) + text[match.end() :]
    return text


NEAR = (1.0 + 1e-9, 1.0 - 1e-6, 1.0001, 1.0001, 1.01, 2.0, -1.0, 0.0)


def near_number(text: str, rng: random.Random) -> str:
    """Change numbers a little: they are still read, and used in computations."""
    result = list(re.finditer(r"-?\d+\.\d+(?:[eE][-+]?\d+)?", text))
    for match in sorted(rng.sample(result, min(len(result), rng.choice([1, 3, 20]))), key=lambda m: -m.start()):
        text = text[: match.start()] + repr(float(match[0]) * rng.choice(NEAR)) + text[match.end() :]
    return text


def near_cells(text: str, rng: random.Random) -> str:
    """Change the values of a table a little, except for positions and times."""
    lines = text.split("\n")
    for k in rng.sample(range(1, len(lines)), min(len(lines) - 1, rng.choice([1, 3, 20]))):
        cells = lines[k].split(",")
        for place in rng.sample(range(len(cells)), min(len(cells), 2)):
            if place > 1 and re.fullmatch(r"-?\d+\.\d+(?:[eE][-+]?\d+)?", cells[place]):
                cells[place] = repr(float(cells[place]) * rng.choice(NEAR[:6]))
        lines[k] = ",".join(cells)
    return "\n".join(lines)


def scaled_numbers(text: str, rng: random.Random) -> str:
    """Scale all numbers of a place in the line by one factor, or make them all the same."""
    place, factor = rng.randrange(8), rng.choice([0.0, -1.0, 1e-320, 1e-12, 1e6, 1e300, 57.29577951308232])

    def changed(line: str) -> str:
        cells = line.split(",")
        if place < len(cells):
            try:
                cells[place] = repr(float(cells[place]) * factor)
            except ValueError:
                return line
        return ",".join(cells)

    return "\n".join(map(changed, text.split("\n")))


def other_lines(text: str, rng: random.Random) -> str:
    """Remove, double or reorder lines, or make one very long."""
    lines = text.split("\n")
    k = rng.randrange(len(lines))
    return "\n".join(
        rng.choice(
            [
                lines[:k] + lines[k + 1 :],
                lines[: k + 1] + lines[k:],
                rng.sample(lines, len(lines)),
                lines[::-1],
                [*lines[:k], lines[k] * rng.choice([2, 1000]), *lines[k + 1 :]],
                [*lines[:k], "," * rng.choice([1, 50, 100000]), *lines[k:]],
                lines[: rng.choice([1, 2, 3, 4])],
                [*lines[:1], *(lines[1:] * 30)],
                lines[:1] * 3 + lines[1:],
            ]
        )
    )


def other_words(text: str, rng: random.Random) -> str:
    """Replace a word by another one of the file, misspell it, or change its case."""
    words = re.findall(r"[A-Za-z_]\w+", text)
    if not words:
        return text
    old = rng.choice(words)
    k = rng.randrange(len(old))
    return text.replace(
        old,
        rng.choice([rng.choice(words), old[:k] + old[k + 1 :], old.upper(), old * 2, "", "é" + old, f"{old} "]),
        rng.choice([1, -1]),
    )


def other_separator(text: str, rng: random.Random) -> str:
    """Change separator, decimal mark, or quotes."""
    return rng.choice(
        [
            text.replace(",", ";"),
            text.replace(",", "\t"),
            text.replace(".", ","),
            text.replace(",", ", "),
            text.replace(",", ',"'),
            re.sub(r"(\d+)", r'"\1"', text),
        ]
    )


def nested(text: str, rng: random.Random) -> str:
    """Nest brackets within brackets."""
    depth, (remaining, right) = rng.choice([5, 900, 100_000]), rng.choice(["[]", "{}", "()"])
    at = rng.randrange(len(text) + 1)
    key = '"a":' if remaining == "{" else ""
    return text[:at] + (remaining + key) * depth + "1" + right * depth + text[at:]


LINES: tuple[Text, ...] = (
    *(other_number, other_number, near_cells, scaled_numbers),
    *(other_lines, other_words, other_separator),
)
WORDS: tuple[Text, ...] = (
    *(other_number, other_number, near_number, near_number),
    *(other_lines, other_words, other_words, nested),
)


def other_value(value: Any, rng: random.Random) -> Any:
    """Return another value for a value of a JSON file."""
    variants: list[Any] = [
        None,
        True,
        0,
        -1,
        1.5,
        1e308,
        -1e-320,
        "",
        "abc",
        "nan",
        [],
        {},
        [value],
        {"a": value},
        10**400,
    ]
    if isinstance(value, list):
        variants += [value[:-1], value + value, value[::-1]]
    if isinstance(value, int | float) and not isinstance(value, bool):
        variants += [-value, value * 1e9, str(value), float(value)]
    return rng.choice(variants)


def other_json(text: str, rng: random.Random) -> str:
    """Replace a value, or a key, anywhere in a JSON file."""
    content = json.loads(text)
    places: list[tuple[Any, Any]] = []

    def walk(part: Any) -> None:
        for key, inner in part.items() if isinstance(part, dict) else enumerate(part):
            places.append((part, key))
            if isinstance(inner, dict | list):
                walk(inner)

    walk(content)
    for part, key in rng.sample(places, min(len(places), rng.choice([1, 1, 2, 5]))):
        if isinstance(part, dict) and rng.random() < 0.3:
            value = part.pop(key, None)
            if rng.random() < 0.5:
                part[f"{key}x"] = value
        elif isinstance(part, dict) or key < len(part):
            part[key] = other_value(part[key] if isinstance(part, list) else part.get(key), rng)
    return json.dumps(content)


def as_parquet(data: bytes, rng: random.Random) -> bytes:
    """Return the table of a CSV file as Parquet, with columns of other types."""
    try:
        table = pl.read_csv(io.BytesIO(data), comment_prefix="#", infer_schema_length=None)
    except pl.exceptions.PolarsError:
        return data
    for name in rng.sample(table.columns, min(table.width, rng.choice([0, 1, 1, 2]))):
        column = pl.col(name)
        makers = [
            column.cast(pl.String),
            column.cast(pl.Float32, strict=False),
            column.cast(pl.Int64, strict=False),
            column.cast(pl.Boolean, strict=False),
            column.cast(pl.Int64, strict=False).cast(pl.Datetime("us")),
            column.cast(pl.Float64, strict=False).cast(pl.Decimal(38, 12), strict=False),
            column.cast(pl.String).cast(pl.Categorical),
            column.cast(pl.String).cast(pl.Binary),
            pl.concat_list(column).alias(name),
            pl.struct(column).alias(name),
            pl.lit(None).alias(name),
            pl.when(pl.int_range(pl.len()) % 7 == 3).then(None).otherwise(column).alias(name),
            pl.lit(float("nan")).alias(name),
        ]
        try:
            table = table.with_columns(rng.choice(makers))
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException):
            continue
    table = rng.choice([table, table, table.head(0), table.head(1), pl.concat([table] * 20)])
    stream = io.BytesIO()
    table.write_parquet(stream, compression=rng.choice(["zstd", "snappy", "uncompressed"]))
    return stream.getvalue() if rng.random() < 0.7 else flipped(stream.getvalue(), rng)


def other_member(data: bytes, rng: random.Random) -> bytes:
    """Change or remove a member of an archive, and pack it again."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
    except (zipfile.BadZipFile, OSError, NotImplementedError, RuntimeError):
        return flipped(data, rng)
    readable = [name for name in members if re.search(r"\.(xml|bin|ssd|ssv|json|toml|rels|py)$", name)] or [*members]
    name = rng.choice(readable)
    if name.endswith(".py"):
        # This would run code, which is not tested here.
        return data
    if rng.random() < 0.1:
        members.pop(name)
    else:
        members[name] = changed("x.xml", members[name], rng)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in members.items():
            archive.writestr(zipfile.ZipInfo(member), content)
    return buffer.getvalue()


def changed(name: str, data: bytes, rng: random.Random) -> bytes:
    """Return a file's content with a change of a kind that fits it."""
    ending = name.rpartition(".")[2]
    if rng.random() < 0.25 or not data:
        return rng.choice(ANY)(data or b"x", rng)
    if ending in ("fmu", "ssp", "xlsx", "xlsb", "ods"):
        return other_member(data, rng)
    if ending == "gz":
        return gzip.compress(changed(name.removesuffix(".gz"), gzip.decompress(data), rng), mtime=0)
    if ending in ("xls", "parquet"):
        return rng.choice(ANY)(data, rng)
    if ending == "csv" and rng.random() < 0.15:
        return as_parquet(data, rng)
    text = data.decode("utf-8", "replace")
    if ending == "csv" and rng.random() < 0.25:
        return near_cells(text, rng).encode()
    for _ in range(rng.choice([1, 1, 2, 4])):
        if ending == "json" and rng.random() < 0.7:
            try:
                text = other_json(text, rng)
                continue
            except (ValueError, RecursionError):
                pass
        text = rng.choice(LINES if ending == "csv" else WORDS)(text, rng)
    return text.encode("utf-8", "replace")


FORMULAS = (
    *(
        "f2",
        "c*sin(3*alpha)",
        "c*f1*f2",
        "exp(1000*f1)",
        "c/0",
        "c**c",
        "sqrt(-1)",
        "((c",
        "c*alpha+d*beta",
        "1/f1",
        "c",
    ),
    *(
        "abs(f3)",
        "__import__('os')",
        "lambda: 1",
        "c*" * 50 + "f1",
        "f1**1e9",
        "nan*c",
        "c if f1 else 2",
        "c*T",
        "c*t",
        "µ*f1",
    ),
)


def option(name: str, value: str, rng: random.Random) -> str:
    """Return another value for an option."""
    if name == "--hypothesis":
        return rng.choice(["f1 += ", "f2 += ", "w1 += ", "q += ", "f1 = ", ""]) + rng.choice(FORMULAS)
    if name in ("--json", "--out", "--report", "--allan", "--ssv", "--export", "--picture", "--answer"):
        return rng.choice([value, ".", "", "/dev/full", "out/" * 30 + "x", "out\n.json", "x" * 300, f"é{value}", "-"])
    return rng.choice([rng.choice(NUMBERS), rng.choice(NUMBERS), value, value * 2, "x" * 10_000, "🦆", "a=b", "-5 5"])
