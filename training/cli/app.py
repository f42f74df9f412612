"""The `fowt` command with all its commands. Each is thin: it parses, calls, prints."""

from importlib import import_module

from fowt_env.training.cli.console import MODULES, app

for module in MODULES:
    import_module(f"fowt_env.training.cli.{module}")


def main():
    """Entry point of the console script."""
    app()
