"""The folders controllers/ and training/ are installed, and imported, as packages of fowt_env.

A name like `controllers` at the top belongs to whoever works in a folder. All else is in pyproject.toml.
"""

from setuptools import find_packages, setup

BESIDE = ("controllers", "training")
# what runs from a clone alone: the studies, and the OpenFAST series of `fowt validate`
LEFT_OUT = ("training.studies*", "training.validation.reference*")

packages = find_packages(include=["fowt_env*", *(f"{name}*" for name in BESIDE)], exclude=LEFT_OUT)
if missing := {"fowt_env", *BESIDE} - set(packages):
    raise SystemExit(f"the sources are incomplete: without {', '.join(sorted(missing))}")
setup(
    packages=[name if name.startswith("fowt_env") else f"fowt_env.{name}" for name in packages],
    package_dir={f"fowt_env.{name}": name for name in BESIDE},
)
