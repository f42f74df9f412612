"""The settings in tuned.toml, which training/design/tune.py has written."""

import tomllib
from pathlib import Path
from typing import Any

TUNED = Path(__file__).parent / "tuned.toml"


def tuned(name: str) -> dict[str, Any]:
    """{setting: value} of a controller that `fowt design tune` has tuned."""
    return tomllib.loads(TUNED.read_text())[name]["settings"]
