"""Shared libraries, looked at before they are loaded: the loader of Linux dies of one that ends too early."""

import struct

from ..errors import InputError

_LOADED = 1
"""Type of a segment that is mapped into memory (PT_LOAD)."""


def refuse_damaged(content: bytes, label: str) -> None:
    """Refuse an ELF library whose segments do not all lie within the file; other formats are the loader's matter.

    Parameters
    ----------
    content : bytes
        the file
    label : str
        the FMU, for the message

    Raises
    ------
    InputError
        the file ends before a segment does, or its headers make no sense
    """
    if not content.startswith(b"\x7fELF"):
        return
    try:
        wide = content[4] == 2
        order = "<" if content[5] == 1 else ">"
        (start,) = struct.unpack_from(f"{order}{'Q' if wide else 'I'}", content, 32 if wide else 28)
        size, count = struct.unpack_from(f"{order}HH", content, 54 if wide else 42)
        for k in range(count):
            at = start + k * size
            if wide:
                kind, _, offset, _, _, length = struct.unpack_from(f"{order}IIQQQQ", content, at)
            else:
                kind, offset, _, _, length = struct.unpack_from(f"{order}IIIII", content, at)
            if kind == _LOADED and offset + length > len(content):
                raise InputError(f"{label}: its library ends too early ({len(content)} bytes); it is damaged")
    except (struct.error, IndexError, OverflowError) as error:
        raise InputError(f"{label}: its library's headers make no sense ({error}); it is damaged") from error
