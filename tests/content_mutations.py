"""FMUs and .ssp files whose descriptions, libraries or parameters are wrong; every one of them must be refused."""

import io
import random
import re
import zipfile

from archive_mutations import OF_ANY, Members, Mutation, another_root, deep, entities, not_xml, packed


def replaced(members: Members, name: str, pattern: str, text: str) -> bytes:
    """An archive whose description has another text in the first place that fits a pattern."""
    changed, count = re.subn(pattern, lambda m: m.expand(text), members[name].decode(), count=1)
    assert count == 1, pattern
    return packed({**members, name: changed.encode()})


def wrong_description(members: Members, described: str, rng: random.Random) -> bytes:
    """A model description that says what cannot be."""
    pattern, text = rng.choice(
        [
            (r'fmiVersion="[^"]*"', f'fmiVersion="{rng.choice(["1.0", "", "4.0", "two", "9" * 50])}"'),
            (r'fmiVersion="[^"]*"', ""),
            (r"<CoSimulation", "<ModelExchange"),
            (r'modelIdentifier="[^"]*"', f'modelIdentifier="{rng.choice(["", "../../evil", "/bin/sh", "no such"])}"'),
            (r'valueReference="[^"]*"', f'valueReference="{rng.choice(["", "x", "1.5", "1e3"])}"'),
            (r'valueReference="[^"]*"', ""),
            (r'(<ScalarVariable[^>]*name=")gain"', r'\1times"'),
            (r'start="1"', f'start="{rng.choice(["x", "", "1,0", "0x1", "--1"])}"'),
            (r"<Real ", r'<Real min="low" '),
            (r"<Real ", r'<Real declaredType="NoSuchType" '),
            (
                r"(?s)<ModelVariables>.*?</ScalarVariable>",
                "<ModelVariables><ScalarVariable name='x' valueReference='1'/>",
            ),
        ]
    )
    return replaced(members, described, pattern, text)


def wrong_platform(members: Members, described: str, rng: random.Random) -> bytes:
    """Binaries for another platform only, or none."""
    other = rng.choice(["win32", "darwin64", "x86_64-plan9", None])
    changed = {}
    for name, content in members.items():
        if not name.startswith("binaries/"):
            changed[name] = content
        elif other is not None:
            changed[f"binaries/{other}/{name.rpartition('/')[2]}"] = content
    return packed(changed)


def no_library(members: Members, described: str, rng: random.Random) -> bytes:
    """Something else in the place of the library."""
    content = rng.choice([b"", b"#!/bin/sh\n", rng.randbytes(500), b"\x7fELF", b"\x7fELF\x02\x01\x01" + bytes(60)])
    return packed({n: content if n.startswith("binaries/") else c for n, c in members.items()})


def shortened_library(members: Members, described: str, rng: random.Random) -> bytes:
    """A library that ends before what its headers say is in it: the loader of Linux would kill the process."""
    share = rng.uniform(0.001, 0.7)
    return packed({n: c[: int(share * len(c))] if n.startswith("binaries/") else c for n, c in members.items()})


OF_FMUS: tuple[Mutation, ...] = (wrong_description, wrong_platform, no_library, shortened_library)


def wrong_structure(members: Members, described: str, rng: random.Random) -> bytes:
    """A system structure that says what cannot be."""
    pattern, text = rng.choice(
        [
            (r'version="1.0"', f'version="{rng.choice(["0.9", "", "3.0", "x"])}"'),
            (r'source="resources/[^"]*fmu"', f'source="{rng.choice(SOURCES)}"'),
            (r'source="resources/[^"]*ssv"', f'source="{rng.choice(SOURCES)}"'),
            (r'startElement="[^"]*"', 'startElement="nobody"'),
            (r'endConnector="[^"]*"', 'endConnector="nothing"'),
            (r'stopTime="[^"]*"', f'stopTime="{rng.choice(["", "x", "inf", "nan", "-1", "1e400"])}"'),
            (r'startTime="[^"]*"', f'startTime="{rng.choice(["", "x", "inf", "nan", "1e9"])}"'),
            (r'stepSize="[^"]*"', f'stepSize="{rng.choice(["", "x", "0", "-1", "nan", "1e-300", "0.3"])}"'),
            (r"<ssd:Elements>", "<ssd:Elements><ssd:Other/>"),
            (r"<ssd:Component ", '<ssd:Component type="application/x-other" '),
            (r"(?s)<ssd:System .*</ssd:System>", ""),
            (r"(?s)<ssd:DefaultExperiment.*?/>", ""),
            (r"<ssc:BaseUnit", f'<ssc:BaseUnit factor="{rng.choice(["", "x", "0", "nan"])}"'),
        ]
    )
    return replaced(members, described, pattern, text)


SOURCES = (
    "", "../../etc/passwd", "/etc/passwd", "file:///etc/passwd", "http://localhost:1/x.fmu", "resources/none.fmu",
    "%2e%2e/x", "resources", "resources/%00", "SystemStructure.ssd", "//host/x.fmu", "http://[",
    "#x", "resources/x.fmu?y",
)  # fmt: skip


def wrong_parameters(members: Members, described: str, rng: random.Random) -> bytes:
    """A parameter set that says what cannot be, or is none."""
    name = "resources/gain.ssv"
    if rng.random() < 0.4:
        mutation = rng.choice([entities, not_xml, deep, another_root])
        return mutation(members, name, rng)
    pattern, text = rng.choice(
        [
            (r'(name="gain"[^/]*value=")[^"]*"', rf'\g<1>{rng.choice(["x", "", "nan", "inf", "1e999", "1,5"])}"'),
            (r'(name="times"[^/]*value=")[^"]*"', rf'\g<1>{rng.choice(["x", "", "1.5", "9" * 30])}"'),
            (r'(name="gain"[^/]*)ssv:Real', r"\1ssv:Boolean"),
            (r'(name="gain"[^/]*)ssv:Real', r"\1ssv:Binary"),
            (r'(name="gain"[^/]*ssv:Real )value="[^"]*"', r"\1"),
        ]
    )
    return replaced(members, name, pattern, text)


def wrong_fmu(members: Members, described: str, rng: random.Random) -> bytes:
    """An .ssp whose FMU is mutated."""
    name = "resources/Gain.fmu"
    with zipfile.ZipFile(io.BytesIO(members[name])) as archive:
        inner = {n: archive.read(n) for n in archive.namelist()}
    mutation = rng.choice([*OF_ANY, wrong_description, wrong_platform])
    return packed({**members, name: mutation(inner, "modelDescription.xml", rng)})


OF_SSPS: tuple[Mutation, ...] = (wrong_structure, wrong_parameters, wrong_fmu)
