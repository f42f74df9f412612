"""Puts fowt_env_registration.pth beside the packages; everything else is in pyproject.toml."""

import os
import sys
import sysconfig

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

HOOK = "fowt_env_registration.pth"
SITE_PACKAGES = os.path.relpath(sysconfig.get_path("purelib"), sys.prefix)


class BuildWithHook(build_py):
    """Puts it where the packages go, whatever that place is called on the machine that installs."""

    def run(self):
        super().run()
        if not self.editable_mode:
            self.copy_file(HOOK, os.path.join(self.build_lib, HOOK))


class DistributionWithData(Distribution):
    """Has it as a data file too where no packages are put anywhere: in editable mode, and in an sdist."""

    def has_data_files(self):
        return "bdist_wheel" not in self.commands and super().has_data_files()

    has_data = has_data_files  # by which name setuptools asks in editable mode


setup(
    cmdclass={"build_py": BuildWithHook},
    distclass=DistributionWithData,
    data_files=[(SITE_PACKAGES, [HOOK])],
)
