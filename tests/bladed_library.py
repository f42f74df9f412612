"""Libraries with the Bladed interface that tests build: from C with gcc, from Fortran with gfortran."""

import shutil
import subprocess
from pathlib import Path

import pytest

SOURCES = Path(__file__).parent / "controllers" / "bladed"
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc, which builds the library")
needs_gfortran = pytest.mark.skipif(shutil.which("gfortran") is None, reason="needs gfortran")


def built(folder, source="discon.c", compiler="gcc", *options):
    """Path of the shared library of a source in tests/controllers/bladed."""
    path = SOURCES / source
    library = Path(folder) / f"{path.stem}.so"
    words = [compiler, "-shared", "-fPIC", "-O1", *options, "-o", str(library), str(path), "-lm"]
    subprocess.run(words, check=True, capture_output=True, cwd=folder)
    return library
