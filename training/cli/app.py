"""Assembles the `fowt` command; each subcommand parses its options, calls the library and prints."""

import os
from importlib import import_module

from fowt_env.training.cli.console import MODULES, app

for module in MODULES:
    import_module(f"fowt_env.training.cli.{module}")


def main():
    """Run the console script `fowt`."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of worker processes; here commands see to it
    app()
