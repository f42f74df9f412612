"""What each field of a Measurement is: unit, sign, meaning, and whether a turbine has such a sensor."""

from typing import NamedTuple

from fowt_env.plant.measurement import BLADE_SENSOR_FIELDS, SENSOR_FIELDS, BladeMeasurement, Measurement


class Measured(NamedTuple):
    """One field."""

    unit: str
    positive: str  # which way it counts
    meaning: str


MEASURED = {
    "time": Measured("s", "", "time since the start of the run"),
    "rotor_speed": Measured("rad/s", "in operation", "speed of the rotor"),
    "generator_speed": Measured(
        "rad/s", "in operation", "speed of the high-speed shaft: gear_ratio times the rotor's"
    ),
    "blade_pitch": Measured(
        "rad",
        "towards feather",
        "pitch angle that the blades have; the mean of blades with pitches of their own",
    ),
    "generator_torque": Measured(
        "N m", "braking the rotor", "generator torque on the high-speed shaft, as applied until now"
    ),
    "surge": Measured("m", "downwind", "position of the platform"),
    "sway": Measured("m", "left, looking downwind", "position of the platform"),
    "heave": Measured("m", "up", "position of the platform"),
    "roll": Measured("rad", "tower top to the right", "Euler angle about the platform's own x"),
    "platform_pitch": Measured("rad", "tower top downwind", "Euler angle of the platform's pitch"),
    "yaw": Measured("rad", "counter-clockwise from above", "Euler angle of the platform's yaw"),
    "surge_rate": Measured("m/s", "downwind", "time derivative of surge"),
    "sway_rate": Measured("m/s", "left", "time derivative of sway"),
    "heave_rate": Measured("m/s", "up", "time derivative of heave"),
    "roll_rate": Measured("rad/s", "as roll", "time derivative of roll"),
    "platform_pitch_rate": Measured("rad/s", "as platform_pitch", "time derivative of platform_pitch"),
    "yaw_rate": Measured("rad/s", "as yaw", "time derivative of yaw"),
    "nacelle_acceleration": Measured(
        "m/s2", "downwind", "acceleration of the tower top along the platform's x"
    ),
    "nacelle_velocity": Measured("m/s", "downwind", "velocity of the tower top along the platform's x"),
    "platform_pitch_acceleration": Measured(
        "rad/s2", "as platform_pitch", "angular acceleration about the platform's own y"
    ),
    "wind_speed": Measured(
        "m/s", "downwind", "wind at the hub along x; rotor-averaged where the scene's wind is"
    ),
    "wave_elevation": Measured("m", "up", "water surface at the platform's rest position"),
}
BLADES_MEASURED = {
    "azimuth": Measured("rad", "in operation", "of the first blade, 0 where it points up"),
    **{
        f"blade_pitch_{blade}": Measured("rad", "towards feather", f"pitch angle of blade {blade}")
        for blade in (1, 2, 3)
    },
    **{
        f"root_out_of_plane_{blade}": Measured(
            "N m",
            "pushed downwind",
            f"bending moment at the root of blade {blade} out of the rotor plane (RootMyc)",
        )
        for blade in (1, 2, 3)
    },
    **{
        f"root_in_plane_{blade}": Measured(
            "N m",
            "pushed the way it turns",
            f"bending moment at the root of blade {blade} in the rotor plane (RootMxc)",
        )
        for blade in (1, 2, 3)
    },
    "hub_tilt_moment": Measured(
        "N m", "top pushed downwind", "tilting moment at the hub, in axes that do not turn with the rotor"
    ),
    "hub_yaw_moment": Measured(
        "N m", "as yaw", "yawing moment at the hub, in axes that do not turn with the rotor"
    ),
    "yaw_bearing_tilt_moment": Measured("N m", "top pushed downwind", "tilting moment at the yaw bearing"),
    "yaw_bearing_yaw_moment": Measured("N m", "as yaw", "yawing moment at the yaw bearing"),
}
HEAD = ("field", "unit", "positive", "meaning", "sensor of a turbine")


def measurement_rows(of: type = Measurement) -> list[tuple[str, str, str, str, str]]:
    """Rows (field, unit, positive, meaning, whether turbines have such a sensor) of a class of measurements.

    of: Measurement or BladeMeasurement, in the order of its fields.
    """
    table, sensors = (
        (MEASURED, SENSOR_FIELDS) if of is Measurement else (BLADES_MEASURED, BLADE_SENSOR_FIELDS)
    )
    return [(name, *table[name], "yes" if name in sensors else "no") for name in of._fields]


def _as_text(of):
    """The rows as lines of a docstring."""
    rows = [HEAD, *measurement_rows(of)]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    lines = []
    for name, unit, positive, meaning, sensor in rows:
        cells = (name.ljust(widths[0]), unit.ljust(widths[1]), positive.ljust(widths[2]))
        mark = "" if sensor == "yes" or name == HEAD[0] else "; no sensor of a turbine"
        lines.append(f"    {'  '.join(cells)}  {meaning}{mark}".rstrip())
    return "\n".join(lines)


# help(fowt_env.Measurement) shows the table; the class lies among the kernels' sources, which hold no texts
for _class in (Measurement, BladeMeasurement):
    _class.__doc__ = f"{(_class.__doc__ or '').rstrip()}\n\n{_as_text(_class)}\n    "
