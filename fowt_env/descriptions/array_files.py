"""Reads the arrays of untrusted .npz files without pickle.

Memory is allocated by the archive's table of contents, not by the array headers, and up to a limit of the
caller.
"""

import math
import zipfile

import numpy as np

HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def read_arrays(path, largest):
    """Return {name: array} of a .npz file, each after a check of its header against its size in the archive.

    largest: bytes of all arrays together. Raises: errors of zipfile, zlib and numpy for a broken file, and
    ValueError for inconsistent sizes.
    """
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        total = sum(member.file_size for member in members)
        if total > largest:
            raise ValueError(f"it holds {total} bytes; allowed: at most {largest}")
        for member in members:
            with archive.open(member) as file:
                version = np.lib.format.read_magic(file)
                if version not in HEADERS:
                    raise ValueError(f"array {member.filename!r} has the version {version}")
                shape, by_columns, kind = HEADERS[version](file)
                size = math.prod(shape) * kind.itemsize
                if kind.hasobject:
                    raise ValueError(f"array {member.filename!r} holds pickled objects, which are not loaded")
                if size != member.file_size - file.tell():
                    raise ValueError(f"array {member.filename!r}: {shape} of {kind} is not its size")
                content = np.frombuffer(file.read(), dtype=kind)
                arrays[member.filename.removesuffix(".npy")] = content.reshape(
                    shape, order="F" if by_columns else "C"
                )
    return arrays
