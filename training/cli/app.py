"""The `fowt` command with all its commands. Each is thin: it parses, calls, prints."""

from importlib import import_module

from fowt_env.training.cli.console import app

GROUPS = (  # modules that add their commands to the app, in the order of fowt --help
    "simulate", "check", "evaluate", "validate", "doctor", "benchmark", "design", "plot", "report", "scores",
    "leaderboard", "import_deck", "hydro", "train",
)  # fmt: skip
for group in GROUPS:
    import_module(f"fowt_env.training.cli.{group}")


def main():
    """Entry point of the console script."""
    app()
