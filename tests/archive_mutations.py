"""Mutated archives: each kind of damage or malice, drawn from a seed; every one must be refused."""

import io
import random
import re
import stat
import struct
import zipfile
from collections.abc import Callable

Members = dict[str, bytes]

OUTSIDE = (
    "../escaped.txt", "resources/../../escaped.txt", "/tmp/escaped-{}.txt", "//host/escaped.txt", "C:/escaped.txt",
    "..\\escaped.txt", "resources\\..\\..\\escaped.txt", "a/b/../../../escaped.txt", "resources/\\escaped.txt",
    "file:escaped.txt", "../" * 12 + "tmp/escaped-{}.txt",
)  # fmt: skip

BOMB = (
    '<!DOCTYPE b [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
    '<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>'
)
DOCTYPES = (
    BOMB,
    '<!DOCTYPE b [<!ENTITY a SYSTEM "file:///etc/passwd">]>',
    '<!DOCTYPE b [<!ENTITY % a SYSTEM "http://localhost:1/a.dtd"> %a;]>',
    '<!DOCTYPE b SYSTEM "b.dtd">',
    "<!DOCTYPE b>",
)


def packed(members: Members, method: int = zipfile.ZIP_STORED) -> bytes:
    """Return an archive of these members."""
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, method)
    return inner.getvalue()


def with_entry(members: Members, entry: zipfile.ZipInfo, content: bytes) -> bytes:
    """Return an archive with a further entry at a random place."""
    inner = io.BytesIO(packed(members))
    with zipfile.ZipFile(inner, "a") as archive:
        archive.writestr(entry, content)
    return inner.getvalue()


def directory_at(archive: bytes, name: str) -> int:
    """Return the offset of a member's entry in the central directory."""
    (at,) = struct.unpack_from("<I", archive, len(archive) - 6)
    while True:
        size, extra, comment = struct.unpack_from("<HHH", archive, at + 28)
        if archive[at + 46 : at + 46 + size] == name.encode():
            return at
        at += 46 + size + extra + comment


def patched(archive: bytes, at: int, form: str, value: int) -> bytes:
    changed = bytearray(archive)
    struct.pack_into(form, changed, at, value)
    return bytes(changed)


def truncated(members: Members, described: str, rng: random.Random) -> bytes:
    archive = packed(members)
    return archive[: rng.randrange(len(archive) - 22)]


def not_an_archive(members: Members, described: str, rng: random.Random) -> bytes:
    return rng.choice([b"", b"PK", b"PK\x05\x06", rng.randbytes(rng.randrange(1, 400)), members[described]])


def spoilt_content(members: Members, described: str, rng: random.Random) -> bytes:
    """Return an archive whose description has changed bytes, so that its checksum is wrong."""
    method = rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
    archive = bytearray(packed({described: members[described], **members}, method))
    begin = 30 + len(described)
    (size,) = struct.unpack_from("<I", archive, 18)
    for _ in range(rng.randrange(1, 8)):
        archive[begin + rng.randrange(min(size, 2000))] ^= rng.randrange(1, 256)
    return bytes(archive)


def spoilt_directory(members: Members, described: str, rng: random.Random) -> bytes:
    """Change place, size, checksum, name or method in the central directory."""
    archive = packed({described: members[described], **members})
    at = directory_at(archive, described)
    return rng.choice(
        [
            lambda: patched(archive, at + 10, "<H", rng.choice([1, 6, 9, 97, 98])),
            lambda: patched(archive, at + 16, "<I", rng.getrandbits(32)),
            lambda: patched(archive, at + 42, "<I", len(archive) - rng.randrange(1, 40)),
            lambda: patched(archive, at + 46, "<B", 1 + rng.randrange(31)),
            lambda: patched(archive, at + 24, "<I", rng.randrange(1, 200)),
            lambda: patched(archive, at + 28, "<H", rng.randrange(200, 60000)),
        ]
    )()


def outside(members: Members, described: str, rng: random.Random) -> bytes:
    """Add a member that would be written outside the folder: up, absolute, on a drive, with backslashes."""
    name = rng.choice(OUTSIDE).replace("{}", str(rng.getrandbits(30)))
    entry = zipfile.ZipInfo("x")
    entry.filename = name
    return with_entry(members, entry, b"escaped")


def link(members: Members, described: str, rng: random.Random) -> bytes:
    """Add a link to another place, and perhaps a file through it."""
    entry = zipfile.ZipInfo(rng.choice(["resources/link", "binaries/link", "link"]))
    entry.external_attr = (stat.S_IFLNK | 0o777) << 16
    return with_entry(members, entry, rng.choice([b"/tmp", b"../..", b"/etc/passwd"]))


def twice(members: Members, described: str, rng: random.Random) -> bytes:
    """Add two members of one name."""
    name = rng.choice(list(members))
    archive = packed({**members, "@" * len(name): rng.randbytes(20)})
    return archive.replace(b"@" * len(name), name.encode())


def huge(members: Members, described: str, rng: random.Random) -> bytes:
    """Declare gigabytes of unpacked size, in one member or in several."""
    archive = packed({**members, "resources/a": b"a", "resources/b": b"b"})
    size = rng.choice([0x7FFFFFFF, 0xFFFFFFF0, 3 << 30])
    for name in ("resources/a", "resources/b"):
        archive = patched(archive, directory_at(archive, name) + 24, "<I", size)
    return archive


def countless(members: Members, described: str, rng: random.Random) -> bytes:
    """Add more members than anyone needs."""
    return packed({**members, **{f"resources/{i}": b"" for i in range(20_001)}})


def encrypted(members: Members, described: str, rng: random.Random) -> bytes:
    archive = packed(members)
    at = directory_at(archive, rng.choice(list(members)))
    return patched(archive, at + 8, "<H", 1)


def undescribed(members: Members, described: str, rng: random.Random) -> bytes:
    """Remove the description, or move or rename it."""
    rest = {name: content for name, content in members.items() if name != described}
    name = rng.choice(["", f"folder/{described}", described.upper(), f"{described}.bak"])
    return packed({**rest, **({name: members[described]} if name else {})})


def entities(members: Members, described: str, rng: random.Random) -> bytes:
    """Add a DOCTYPE: entities that grow, files and addresses that would be opened."""
    text = re.sub(r"^<\?xml.*?\?>", "", members[described].decode())
    return packed({**members, described: (rng.choice(DOCTYPES) + text).encode()})


def not_xml(members: Members, described: str, rng: random.Random) -> bytes:
    """Cut the description off, lose a tag or a quote, or insert bytes that are not text."""
    xml = members[described]
    at = rng.randrange(60, len(xml) - 10)
    # A lost "<" may leave text between elements, which is well-formed; a lost ">" never does.
    tags = [m.start() for m in re.finditer(rb">", xml)][2:-2]
    place = rng.choice(tags)
    changed = rng.choice(
        [
            b"",
            xml[:at],
            xml[:place] + xml[place + 1 :],
            xml[: rng.choice(tags)] + b"<",
            xml + b"<more/>",
            xml[:at] + b"\xff\xfe\x00" + xml[at:],
            b'<?xml version="1.0" encoding="no-such"?>' + re.sub(rb"^<\?xml.*?\?>", b"", xml),
            xml.replace(b"<", b"&lt;"),
            rng.randbytes(300),
        ]
    )
    return packed({**members, described: changed})


def deep(members: Members, described: str, rng: random.Random) -> bytes:
    """Nest elements thousands deep."""
    many = rng.randrange(3_000, 60_000)
    xml = members[described]
    end = xml.rindex(b"</")
    return packed({**members, described: xml[:end] + b"<a>" * many + b"</a>" * many + xml[end:]})


def another_root(members: Members, described: str, rng: random.Random) -> bytes:
    root = rng.choice([b"<html/>", b"<svg xmlns='http://www.w3.org/2000/svg'/>", b"<a><b/></a>"])
    return packed({**members, described: root})


Mutation = Callable[[Members, str, random.Random], bytes]

OF_ANY: tuple[Mutation, ...] = (
    truncated, not_an_archive, spoilt_content, spoilt_directory, outside, link, twice, huge, encrypted, undescribed,
    entities, not_xml, deep, another_root,
)  # fmt: skip


def replaced(members: Members, name: str, pattern: str, text: str) -> bytes:
    """Return an archive whose description has another text in the first place that fits a pattern."""
    changed, count = re.subn(pattern, lambda m: m.expand(text), members[name].decode(), count=1)
    assert count == 1, pattern
    return packed({**members, name: changed.encode()})


def wrong_description(members: Members, described: str, rng: random.Random) -> bytes:
    """Write an impossible model description."""
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
    """Keep binaries only for another platform, or none."""
    foreign = rng.choice(["win32", "darwin64", "x86_64-plan9", None])
    changed = {}
    for name, content in members.items():
        if not name.startswith("binaries/"):
            changed[name] = content
        elif foreign is not None:
            changed[f"binaries/{foreign}/{name.rpartition('/')[2]}"] = content
    return packed(changed)


def no_library(members: Members, described: str, rng: random.Random) -> bytes:
    """Replace the library by something else."""
    content = rng.choice([b"", b"#!/bin/sh\n", rng.randbytes(500), b"\x7fELF", b"\x7fELF\x02\x01\x01" + bytes(60)])
    return packed({n: content if n.startswith("binaries/") else c for n, c in members.items()})


def shortened_library(members: Members, described: str, rng: random.Random) -> bytes:
    """Return an archive with a library that ends too early for its headers: the loader of Linux would kill the
    process."""
    share = rng.uniform(0.001, 0.7)
    return packed({n: c[: int(share * len(c))] if n.startswith("binaries/") else c for n, c in members.items()})


OF_FMUS: tuple[Mutation, ...] = (wrong_description, wrong_platform, no_library, shortened_library)


def wrong_structure(members: Members, described: str, rng: random.Random) -> bytes:
    """Write an impossible system structure."""
    pattern, text = rng.choice(
        [
            (r'version="1.0"', f'version="{rng.choice(["0.9", "", "3.0", "x"])}"'),
            (r'source="resources/[^"]*fmu"', f'source="{rng.choice(SOURCES)}"'),
            (r'source="resources/[^"]*ssv"', f'source="{rng.choice(SOURCES)}"'),
            (r'startElement="[^"]*"', 'startElement="nobody"'),
            (r'endConnector="[^"]*"', 'endConnector="nothing"'),
            (r'stopTime="[^"]*"', f'stopTime="{rng.choice(["", "x", "inf", "nan", "-1", "1e400"])}"'),
            (r'startTime="[^"]*"', f'startTime="{rng.choice(["", "x", "inf", "nan", "1e9"])}"'),
            (r'stepSize="[^"]*"', f'stepSize="{rng.choice(["", "x", "0", "-1", "nan", "1e-300"])}"'),
            (r"<ssd:Elements>", "<ssd:Elements><ssd:Other/>"),
            (r"<ssd:Component ", '<ssd:Component type="application/x-other" '),
            (r"(?s)<ssd:System .*</ssd:System>", ""),
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
    """Write an impossible parameter set, or something else."""
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
    """Return an .ssp whose FMU is mutated."""
    name = "resources/Gain.fmu"
    with zipfile.ZipFile(io.BytesIO(members[name])) as archive:
        inner = {n: archive.read(n) for n in archive.namelist()}
    mutation = rng.choice([*OF_ANY, wrong_description, wrong_platform])
    return packed({**members, name: mutation(inner, "modelDescription.xml", rng)})


OF_SSPS: tuple[Mutation, ...] = (wrong_structure, wrong_parameters, wrong_fmu)
