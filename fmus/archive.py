"""FMU and SSP files: zip archives with the same bytes on every build."""

import zipfile
from collections.abc import Mapping
from pathlib import Path


def write_archive(path: Path, members: Mapping[str, bytes], first: str = "modelDescription.xml") -> None:
    """Write an archive in a fixed order with fixed dates, whole or not at all.

    Parameters
    ----------
    path : Path
        the file
    members : mapping
        name inside the archive to content
    first : str
        name of the member that stands first
    """
    beside = path.with_suffix(path.suffix + ".part")
    try:
        with zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for name in sorted(members, key=lambda name: (name != first, name)):
                entry = zipfile.ZipInfo(name.replace("\\", "/"), date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, members[name], compresslevel=9)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
