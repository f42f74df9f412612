"""Reads the settings tuned by training/design/tune.py on OC3-Hywind (tuned.toml), for any turbine.

For turbines other than the NREL 5 MW the settings are scaled, not tuned again: velocities by rated wind,
frequencies by rated rotor speed, torques by rated torque.
"""

import tomllib
from pathlib import Path
from typing import Any

from fowt_env.descriptions.nrel5mw import RATED_WIND, ROTOR_SPEED, TORQUE

TUNED = Path(__file__).parent / "tuned.toml"


def tuned_for(name: str, turbine: Any) -> dict[str, Any]:
    """Return the tuned settings of a controller scaled to a turbine; unchanged for the NREL 5 MW turbine."""
    wind = turbine.rated_wind_speed / RATED_WIND
    frequency = turbine.rated_rotor_speed / ROTOR_SPEED
    factors = {
        "pitch_gain": 1.0 / wind,  # rad per m/s
        "gain": 1.0 / wind,
        "torque_gain": turbine.torque_law.rated_torque / TORQUE / wind,
        "low_pass": frequency,
        "high_pass": frequency,
    }
    return {key: value * factors.get(key, 1.0) for key, value in tuned(name).items()}


def tuned(name: str) -> dict[str, Any]:
    """Return {setting: value} of a controller that `fowt design search` has tuned."""
    return tomllib.loads(TUNED.read_text(encoding="utf-8"))[name]["settings"]
