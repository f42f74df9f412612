"""Describes the faults of a run: grid, pitch drives, sensors, platform, and ordered stops and start-up."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from fowt_env.descriptions.records import Finite, NonNegative, Positive, Record, checked_record
from fowt_env.errors import InputError, unknown
from fowt_env.plant.measurement import BladeMeasurement, Measurement

STOP_FAULTS = ("emergency_stop", "normal_stop")
FIELDS = tuple(name for name in (*Measurement._fields, *BladeMeasurement._fields) if name != "time")


class FaultKind(NamedTuple):
    """Describes a kind of fault."""

    keys: tuple[str, ...]  # in addition to kind and time
    summary: str  # TIME stands for the time of the fault


FAULTS = {
    "grid_loss": FaultKind(("delay", "rate"), "the generator torque is zero from TIME on"),
    "emergency_stop": FaultKind(("rate",), "zero torque, and the blades feather from TIME on"),
    "normal_stop": FaultKind(
        ("rate",), "the blades feather at the normal rate; the torque falls with the rotor speed"
    ),
    "start_up": FaultKind(
        ("rate", "by"), "the parked turbine starts at TIME: blades pitch to fine, then the generator connects"
    ),
    "line_loss": FaultKind(("line",), "a mooring line breaks at its fairlead (JSON: line)"),
    "flooded_compartment": FaultKind(
        ("mass", "point", "duration"), "water fills a compartment (JSON: mass, kg, and point [x, y, z], m)"
    ),
    "stuck_pitch": FaultKind(("blades", "backup"), "blades stay at their pitch of TIME"),
    "pitch_runaway": FaultKind(
        ("blades", "towards", "backup"), "blades run to one end of their range (JSON: towards)"
    ),
    "pitch_offset": FaultKind(
        ("blades", "offset"), "blade pitch differs from the encoder reading (JSON: offset, deg)"
    ),
    "sensor_bias": FaultKind(("field", "value"), "a reading has a constant error (JSON: field, value)"),
    "sensor_freeze": FaultKind(("field",), "a reading stays at its value of TIME (JSON: field)"),
    "sensor_loss": FaultKind(("field",), "a reading is zero from TIME on (JSON: field)"),
}
KINDS = tuple(FAULTS)
BLADE_FAULTS = tuple(kind for kind, fault in FAULTS.items() if "blades" in fault.keys)
SENSOR_FAULTS = tuple(kind for kind, fault in FAULTS.items() if "field" in fault.keys)
PLATFORM_FAULTS = ("line_loss", "flooded_compartment")
# required by the kinds of fault that have these keys
NEEDED = ("towards", "offset", "field", "value", "line", "mass", "point")
Blade = Annotated[int, Field(ge=1, le=3, strict=True)]


class Fault(Record):
    """Defines a fault of a load case.

    A run with a fault continues above the turbine's overspeed, which ends a run without faults as failed, to
    show the maximum speed of a rotor without torque or pitch.

    The kinds are those of FAULTS, the keys of each as in docs/guides/faults.md. Readings are fields of
    Measurement or, with pitch="individual", of BladeMeasurement; `blades` needs that option as well.
    """

    kind: Literal[KINDS]
    time: NonNegative  # s
    delay: NonNegative | None = None  # s from the loss of the grid to feathering; None: no feathering
    rate: Positive | None = None  # deg/s of feathering or of a start-up, replaces the rate of the protection
    blades: tuple[Blade, ...] | None = None  # None: all
    # whether an emergency stop still feathers these blades, from their backup energy storage
    backup: Annotated[bool, Field(strict=True)] = False
    towards: Literal["fine", "feather"] | None = None
    offset: Finite | None = None  # deg, actual blade pitch minus encoder reading
    field: str | None = None
    value: Finite | None = None  # SI, added to the reading
    # which start-up: that of the supervisor or of the controller; None: the controller's if it has one
    by: Literal["supervisor", "controller"] | None = None
    line: Annotated[int, Field(ge=1, strict=True)] | None = None  # number of a mooring line
    mass: Positive | None = None  # kg of water in the full compartment
    point: tuple[Finite, Finite, Finite] | None = None  # m, centre of this water in body axes
    duration: NonNegative | None = None  # s of filling at a constant rate; None: full at once

    def _problems(self):
        known = FAULTS[self.kind].keys
        for key in sorted(self.model_fields_set - {"kind", "time", *known}):
            if getattr(self, key) not in (None, False):
                yield f"{key}: is not a key of {self.kind}, which has {', '.join(known)}"
        for key in NEEDED:
            if key in known and getattr(self, key) is None:
                yield f"{key} is missing: {self.kind} needs it"
        if self.field is not None and self.field not in FIELDS:
            yield str(unknown("field", self.field, FIELDS))
        if self.blades is not None and len(set(self.blades)) != max(len(self.blades), 1):
            yield f"blades = {list(self.blades)}: must be one or more of 1, 2, 3, each once"

    @property
    def grid_loss(self) -> float | None:
        """Return the time (s) from which the generator is disconnected from the grid; None: never."""
        return self.time if self.kind in ("grid_loss", "emergency_stop") else None

    @property
    def ends_operation(self) -> bool:
        """Return whether the fault stops the turbine, so that the protection is part of the load case."""
        return self.kind not in (*SENSOR_FAULTS, *PLATFORM_FAULTS, "pitch_offset", "start_up")


def read_faults(value: Any) -> tuple[Fault, ...]:
    """Return the tuple of Faults of None, one or several, each a Fault or a mapping of its keys.

    Raises: InputError with a line per wrong key.
    """
    if value is None:
        return ()
    if isinstance(value, Fault | Mapping):
        value = (value,)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise InputError(f"faults = {value!r}: must be a Fault, a mapping of its keys, or a list of them")
    return tuple(
        item if isinstance(item, Fault) else checked_record(Fault, item, f"faults.{number}")
        for number, item in enumerate(value, 1)
    )
