"""Reads from a library's file, without loading it, whether this machine can load it and what it exports."""

import struct
import sys
from pathlib import Path

from fowt_env.errors import InputError

MAGIC, SIXTY_FOUR_BIT, LITTLE_ENDIAN, SHARED = b"\x7fELF", 2, 1, 3
HEADER = struct.Struct("<16sHHIQQQIHHHHHH")  # Elf64_Ehdr
SECTION = struct.Struct("<IIQQQQIIQQ")  # Elf64_Shdr
SYMBOL = struct.Struct("<IBBHQQ")  # Elf64_Sym
DYNAMIC_SYMBOLS, FUNCTION = 11, 2  # SHT_DYNSYM, STT_FUNC
MACHINES = {3: "x86", 40: "ARM", 62: "x86-64", 183: "AArch64", 243: "RISC-V"}


def check_library(path: Path, symbol: str) -> list[str]:
    """Return the names of the functions that a 64-bit shared library of this machine exports.

    [] if the file has no table of sections, which loading does not need.
    Raises: InputError for any other file, and if the library exports functions and not the symbol.
    """
    where = f"library {str(path)!r}"
    if sys.platform != "linux":
        raise InputError(f"{where}: libraries are loaded on Linux alone: this is {sys.platform}")
    if not path.is_file():
        raise InputError(f"{where}: {'is a folder' if path.is_dir() else 'there is no such file'}")
    content = path.read_bytes()
    if content[:2] == b"MZ":
        raise InputError(f"{where}: is a Windows DLL: build a shared library (.so) for Linux from its source")
    if content[:4] != MAGIC or len(content) < HEADER.size:
        raise InputError(f"{where}: is no shared library (ELF)")
    if content[4] != SIXTY_FOUR_BIT or content[5] != LITTLE_ENDIAN:
        raise InputError(f"{where}: is a 32-bit or big-endian library: must be 64-bit, little-endian")
    header = HEADER.unpack_from(content)
    own = struct.unpack_from("<H", Path(sys.executable).read_bytes()[:20], 18)[0]
    if header[2] != own:
        names = [MACHINES.get(number, f"machine {number}") for number in (header[2], own)]
        raise InputError(f"{where}: is built for {names[0]}: this machine is {names[1]}")
    if header[1] != SHARED:
        raise InputError(f"{where}: is no shared library: link it with -shared")
    exported = _exported(content, header)
    if exported and symbol not in exported:
        alike = [name for name in exported if name.strip("_").lower() == symbol.strip("_").lower()]
        hint = f"{alike[0]!r}: use symbol={alike[0]}" if alike else _few(exported)
        raise InputError(f"{where}: exports no function {symbol!r}; it exports {hint}")
    return exported


def _exported(content, header):
    """Return the names of the exported functions, [] without a readable table of sections."""
    start, size, number = header[6], header[11], header[12]
    try:
        sections = [SECTION.unpack_from(content, start + size * index) for index in range(number)]
        tables = [section for section in sections if section[1] == DYNAMIC_SYMBOLS]
        names = []
        for table in tables:
            texts = sections[table[6]][4]
            for position in range(table[4], table[4] + table[5], SYMBOL.size):
                name, info, _, section, _, _ = SYMBOL.unpack_from(content, position)
                if info & 15 == FUNCTION and section:  # defined here
                    names.append(content[texts + name : content.index(b"\0", texts + name)].decode())
    except (struct.error, IndexError, ValueError):
        return []
    return sorted(names)


def _few(names):
    """Return the first names of a list as a text."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
