"""The `fowt` command with all its commands. Each is thin: it parses, calls, prints."""

from importlib import import_module

from fowt_env.training.cli.console import app

MODULES = (  # that add their commands to the app; console.GROUPS has the order of fowt --help
    "simulate", "listing", "check", "evaluate", "validate", "doctor", "warmup", "cache", "benchmark",
    "design", "plot", "report", "scores", "leaderboard", "import_deck", "hydro", "train",
)  # fmt: skip
for module in MODULES:
    import_module(f"fowt_env.training.cli.{module}")


def main():
    """Entry point of the console script."""
    app()
