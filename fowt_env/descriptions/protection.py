"""Describes the protection of a turbine: the limits of its trips, its two kinds of stop, its start-up."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from fowt_env.descriptions.files import raise_problems
from fowt_env.descriptions.records import NonNegative, Positive, Record, bounded, to_si, validate
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError

TURBINE = "turbine"  # the protection of the turbine file
END_AT_OVERSPEED = "end_at_overspeed"  # the run ends above the overspeed of the turbine file
STOPS = ("normal", "emergency", "end")
NORMAL_RATE = 0.9 * DEGREE  # rad/s
EMERGENCY_RATE = 8.0 * DEGREE
OFF_SPEED = 0.3
START_RATE = 1.0 * DEGREE  # rad/s


class TripLimit(Record):
    """Holds the limit of a trip, the time for which it must be exceeded without a break, and the stop.

    stop: "normal", "emergency", or "end", which ends the run at once.
    """

    limit: Positive
    time: NonNegative = 0.0  # s
    stop: Literal[STOPS] = "emergency"


# a file disables a trip by false
Limited = Annotated[TripLimit | None, BeforeValidator(lambda value: None if value is False else value)]


class Protection(Record):
    """Describes the trips of a turbine, each a TripLimit or None, its two kinds of stop and its start-up.

    Defaults: trips at 1.3 of rated rotor speed, 1.25 of rated power for 1 s, 3.3 m/s2 (the constraint of the
    ATLAS Offshore contest, ARPA-E 2019) and 5 deg for 1 s; feathering at 8 deg/s in an emergency
    (NREL/TP-500-38060) and at 0.9 deg/s otherwise (90 deg in 100 s: ASME OMAE2020 V009T09A070), each limited
    by the pitch drive. A normal stop reduces the torque with the rotor speed, to zero at off_speed, where the
    generator is disconnected. In a start-up the blades pitch from feather at start_rate, 1 deg/s by choice of
    this project, and the generator is connected at connect_speed.
    """

    overspeed: Limited = TripLimit(limit=1.3)  # of rated rotor speed
    overpower: Limited = TripLimit(limit=1.25, time=1.0, stop="normal")  # of rated power
    # of the tower top in the plane of the nacelle, m/s2
    acceleration: Limited = TripLimit(limit=3.3, stop="normal")
    # of a blade's measured pitch from its command, or between blades, rad
    pitch_deviation: Limited = TripLimit(limit=5.0 * DEGREE, time=1.0)
    normal_rate: Positive = NORMAL_RATE  # rad/s
    emergency_rate: Positive = EMERGENCY_RATE
    off_speed: bounded(gt=0, lt=1) = OFF_SPEED  # of rated rotor speed
    start_rate: Positive = START_RATE  # rad/s
    # of rated rotor speed; None: where the torque law begins, its cut_in_speed
    connect_speed: bounded(gt=0, lt=1) | None = None

    def _problems(self):
        for name in ("overspeed", "overpower"):
            trip = getattr(self, name)
            if trip is not None and not trip.limit > 1.0:
                yield f"{name}.limit = {trip.limit:g}: must be > 1 (of rated)"


NO_TRIPS = dict.fromkeys(("overspeed", "overpower", "acceleration", "pitch_deviation"))


def read_protection(value: Any, own: Protection, overspeed: float = 1.3) -> Protection:
    """Return the Protection of a run from its setting.

    value: None (no trips), "turbine" (`own`, that of the turbine file), "end_at_overspeed" (the run ends at a
    rotor speed above `overspeed`, of rated), a Protection, or a mapping of the keys of a turbine file's
    [protection] that override entries of `own`; false for no trip.
    Raises: InputError naming the key, value and allowed range.
    """
    if isinstance(value, Protection):
        return value
    if value is None:
        return own.model_copy(update=NO_TRIPS)
    if isinstance(value, str) and value == TURBINE:
        return own
    if isinstance(value, str) and value == END_AT_OVERSPEED:
        return own.model_copy(update=NO_TRIPS | {"overspeed": TripLimit(limit=overspeed, stop="end")})
    if not isinstance(value, Mapping):
        raise InputError(
            f"protection = {value!r}: must be {TURBINE!r}, {END_AT_OVERSPEED!r}, a table of trips, or none"
        )
    problems: list[str] = []
    data, origin = to_si(dict(value), problems)
    record, invalid = validate(Protection, data, origin)
    raise_problems("protection", problems + invalid)
    return own.model_copy(update={key: getattr(record, key) for key in data})
