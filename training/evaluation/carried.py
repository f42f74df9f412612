"""Tells which fatigue loads a scene carries: those of parts that bend, twist or move with its options.

The load of a rigid part follows from the forces on it and lacks the part's own dynamics: nobody should design
by it. A suite therefore scores and limits only loads that its scenes carry.
"""

from fowt_env.descriptions.platform import read_platform
from fowt_env.errors import unknown
from fowt_env.scene.options import FIDELITIES

# option of build_scene: values with which the part is not rigid, metrics of its loads
PARTS = {
    "shaft": (("torsion",), ("RotTorq_DEL_[kN-m]",)),
    "tower": (
        ("modes", "modes2"),
        ("TwrBsMyt_DEL_[kN-m]", "YawBrMyp_DEL_[kN-m]", "YawBrMzp_DEL_[kN-m]"),
    ),
    "blades": (
        ("modes", "modes2"),
        tuple(
            f"{name}_DEL_[kN-m]"
            for name in (
                *("RootMyc", "RootMxc", "RootMyb", "RootMxb"),
                *("LSSTipMys", "LSSTipMzs", "LSSTipMya", "LSSTipMza"),
            )
        ),
    ),
    "mooring": (("dynamic",), ("FAIRTEN_DEL_[kN]",)),
}
CARRIED = {metric: (option, values) for option, (values, metrics) in PARTS.items() for metric in metrics}


def missing_part(metric, case):
    """Return (option, value of the Case, values needed) if its scene lacks the load of a metric; else None.

    Raises: InputError for an unknown fidelity.
    """
    if metric not in CARRIED:
        return None
    option, needed = CARRIED[metric]
    options = read_platform(case.platform).options | case.options
    level = options.get("fidelity", "standard")
    if level not in FIDELITIES:
        raise unknown("fidelity", level, FIDELITIES)
    value = options.get(option)
    if value is None or value is True:  # as by the fidelity
        value = getattr(FIDELITIES[level], option)
    return None if value in needed else (option, value, needed)
