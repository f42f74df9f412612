"""Programs in a Python of their own: without a compiler, without what this process has imported."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def fresh_python(program, *words, paths=(), cwd=ROOT, **variables):
    """Return what a program prints in a new process, which must end well.

    paths: folders to import from beside the installed package; variables: of its environment.
    """
    given = {"PYTHONPATH": os.pathsep.join(map(str, paths))} if paths else {}
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, words)], env=os.environ | given | variables, cwd=cwd,
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()
