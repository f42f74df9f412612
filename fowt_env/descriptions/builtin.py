"""Lists the names of the built-in descriptions."""

from fowt_env.descriptions.platform import platform_names
from fowt_env.descriptions.sea_state import joint_tables, sea_states
from fowt_env.descriptions.turbine import turbine_names
from fowt_env.errors import unknown

DESCRIPTIONS = {
    "platforms": platform_names,
    "turbines": turbine_names,
    "sea_states": lambda: sorted(sea_states()),
    "joint_tables": lambda: sorted(joint_tables()),
}


def names(kind):
    """Return the sorted built-in names of a kind of description, see DESCRIPTIONS. Raises: InputError."""
    if kind not in DESCRIPTIONS:
        raise unknown("kind of description", kind, DESCRIPTIONS)
    return DESCRIPTIONS[kind]()
