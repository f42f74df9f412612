"""Reads packs of compiled kernels, with which a wheel brings those of the usual scenes ready.

A pack is a .tar.xz of cache files with machine code of x86-64-v3 (AVX2 and FMA), for one minor version of
Python. Its entries are copied, once, into the user's cache under the key of the processor at hand. No kernel
uses fastmath, so that they give the bits that compiling here gives. A pack of other sources, another numba or
Python, or on a processor without these instructions, is left alone: kernels are then compiled as without it.
"""

import io
import json
import pickle
import sys
import tarfile
from pathlib import Path, PurePosixPath

import llvmlite.binding as llvm
import numba
from numba.core.registry import cpu_target

from fowt_env.caches import cached
from fowt_env.layout import PACKAGE, installed_path, module_path
from fowt_env.plant.compile import decorators
from fowt_env.plant.compile.disk_cache import SharedCacheFile
from fowt_env.plant.compile.sources import imported_at_top, read_source

CPU = "x86-64-v3"
INSTRUCTIONS = (
    "avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2", "xsave",
)  # fmt: skip
VARIABLES = {"NUMBA_CPU_NAME": CPU, "NUMBA_CPU_FEATURES": ""}  # for compiling a pack: nothing of the host's
PACK = PACKAGE / "kernels" / f"{sys.implementation.cache_tag}.tar.xz"
MANIFEST = "manifest.json"
LARGEST = 400_000_000  # bytes of all files of a pack


class _Entries(SharedCacheFile):
    """Holds the cache files of one function, to which stored entries are added as they are."""

    def add(self, entries):
        """Add {key: bytes of the data file} for the keys that the index lacks."""
        with self._lock():
            names = self._load_index()
            for key in entries.keys() - names.keys():
                taken = set(names.values())
                names[key] = next(
                    name for name in map(self._data_name, range(1, len(taken) + 2)) if name not in taken
                )
                with self._open_for_write(self._data_path(names[key])) as file:
                    file.write(entries[key])
            self._save_index(names)


def _source_of(index):
    """Return the source of the function that an index file is of, given by its path in the cache folder."""
    module, _, _ = index.name.partition(".")
    return Path(f"{module_path(f'{index.parent}.{module}')}.py")


def facts(indices):
    """Return what must be the same where a pack is written and where it is used."""
    files = set(decorators.PLANT.rglob("*.py"))
    files = files.union(*(imported_at_top(_source_of(index), decorators.PLANT) for index in indices))
    names = {installed_path(path).relative_to(PACKAGE).as_posix(): path for path in files}
    return {
        "numba": numba.__version__,
        "python": sys.implementation.cache_tag,
        "triple": cpu_target.target_context.codegen().magic_tuple()[0],
        "sources": {name: read_source(path).code for name, path in sorted(names.items())},
    }


def _read(pack):
    """Return {name: bytes} of a pack's files. Raises: ValueError if they are too large."""
    with tarfile.open(pack, "r:xz") as archive:
        members = archive.getmembers()
        if sum(member.size for member in members) > LARGEST:
            raise ValueError(f"{pack}: more than {LARGEST / 1e6:.0f} MB")
        return {member.name: archive.extractfile(member).read() for member in members if member.isfile()}


def _runs_here(processor):
    """Return whether a pack may be used: this processor has its instructions, and numba compiles for it."""
    features = llvm.get_host_cpu_features()
    return processor == llvm.get_host_cpu_name() and all(features.get(name) for name in INSTRUCTIONS)


def _copied(files, folder, magic):
    """Copy the entries of a pack's files into a cache folder under a processor's key; return their number."""
    indices = [PurePosixPath(name) for name in files if name.endswith(".nbi")]
    if json.loads(files[MANIFEST]) != facts(indices):
        return 0
    count = 0
    for index in indices:
        stream = io.BytesIO(files[index.as_posix()])
        pickle.load(stream)  # numba's version, compared above
        _, stored = pickle.load(stream)
        entries = {
            (signature, magic, code): files[(index.parent / name).as_posix()]
            for (signature, _, code), name in stored.items()
        }
        place = folder / index.parent
        decorators.make_private(place)
        stamp = decorators._stamp(_source_of(index))
        _Entries(str(place), index.name.removesuffix(".nbi"), stamp).add(entries)
        count += len(entries)
    return count


@cached(4)
def take_kernels(pack: Path = PACK) -> int:
    """Copy a pack's kernels into the user's cache, once for each cache and pack; return how many were copied.

    0 where there is nothing to do, or where the pack does not fit: kernels are then compiled.
    """
    folder = decorators.CACHE_FOLDER
    if folder is None or numba.config.DISABLE_JIT or not pack.is_file():
        return 0
    status = pack.stat()
    mark = folder / f"pack_{status.st_size}_{status.st_mtime_ns}"
    magic = cpu_target.target_context.codegen().magic_tuple()
    if mark.exists() or not _runs_here(magic[1]):
        return 0
    try:
        count = _copied(_read(pack), folder, magic)
        mark.touch(mode=0o600)
    except Exception:  # a broken pack can raise anything, and is no worse than none
        return 0
    return count
