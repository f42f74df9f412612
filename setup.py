"""Puts fowt_env_registration.pth beside the packages; everything else is in pyproject.toml."""

import os
import sys
import sysconfig

from setuptools import Distribution, setup

SITE_PACKAGES = os.path.relpath(sysconfig.get_path("purelib"), sys.prefix)


class DistributionWithData(Distribution):
    """Installs data files in editable mode too: setuptools asks for them there by this name."""

    has_data = Distribution.has_data_files


setup(distclass=DistributionWithData, data_files=[(SITE_PACKAGES, ["fowt_env_registration.pth"])])
