"""The folders controllers/ and training/ are installed, and imported, as packages of fowt_env.

A name like `controllers` at the top belongs to whoever works in a folder. All else is in pyproject.toml.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

BESIDE = ("controllers", "training")
# what runs from a clone alone: the studies, and the OpenFAST series of `fowt dev validate`
LEFT_OUT = ("training.studies*", "training.validation.reference*")



class BuildWithBridge(build_py):
    """Builds the library that runs a controller in Python behind the Bladed interface, where it can."""

    def run(self):
        super().run()
        if self.editable_mode or sys.platform != "linux" or os.uname().machine != "x86_64":
            return
        if compiler := shutil.which("cc"):
            folder = Path(self.build_lib, "fowt_env", "controllers", "export", "c")
            options = ("-std=c99", "-O2", "-s", "-shared", "-fPIC")
            subprocess.run([compiler, *options, "bridge.c", "-o", "bridge.so"], cwd=folder, check=True)


packages = find_packages(include=["fowt_env*", *(f"{name}*" for name in BESIDE)], exclude=LEFT_OUT)
if missing := {"fowt_env", *BESIDE} - set(packages):
    raise SystemExit(f"the sources are incomplete: without {', '.join(sorted(missing))}")
setup(
    packages=[name if name.startswith("fowt_env") else f"fowt_env.{name}" for name in packages],
    cmdclass={"build_py": BuildWithBridge},
    package_dir={f"fowt_env.{name}": name for name in BESIDE},
)
