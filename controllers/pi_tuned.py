"""The PI law with gains searched on training seeds (training/design/tune_pi.py): the baseline at its best."""

import tomllib
from pathlib import Path

from fowt_env.controllers.pi import PI, PISettings

FACTORS_FILE = Path(__file__).parent / "data" / "pi_tuned.toml"


def pi_tuned(turbine, control_dt):
    """OC3 gains times stored factors: least deviations at no more pitch travel than `pi`, on other seeds."""
    factors = tomllib.loads(FACTORS_FILE.read_text(encoding="utf-8"))
    published = PISettings.published(turbine)
    changes = {name: getattr(published, name) * factor for name, factor in factors.items()}
    return PI(PISettings.published(turbine, **changes), control_dt, "pi_tuned")
