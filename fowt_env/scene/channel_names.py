"""Reads names of output channels with or without unit: RotSpeed, or the column name RotSpeed_[rpm]."""

from typing import Any

from fowt_env.errors import InputError
from fowt_env.plant.channels import FIXED_CHANNELS, GROUPS

UNITS = {channel.name: channel.unit for group in (FIXED_CHANNELS, *GROUPS.values()) for channel in group}


def channel_name(name: Any) -> Any:
    """Return the bare name of a channel: "RotSpeed" of "RotSpeed_[rpm]"; other objects unchanged.

    Raises: InputError for a unit other than that of the channel.
    """
    if not isinstance(name, str) or "_[" not in name:
        return name
    bare, _, unit = name.partition("_[")
    unit = unit.removesuffix("]")
    if UNITS.get(bare, unit) != unit:
        raise InputError(f"channel {name!r}: {bare} is in {UNITS[bare]}: must be {bare}_[{UNITS[bare]}]")
    return bare


def channel_unit(name: str) -> str:
    """Return the unit of a channel by its bare name; "" for user-defined loads."""
    return "kN" if name.startswith(("FAIRTEN", "ANCHTEN")) else UNITS.get(name, "")
