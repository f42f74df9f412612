"""Assembles the `fowt` command; each subcommand parses its options, calls the library and prints."""

from importlib import import_module

from fowt_env.training.cli.console import MODULES, app

for module in MODULES:
    import_module(f"fowt_env.training.cli.{module}")


def main():
    """Run the console script `fowt`."""
    app()
