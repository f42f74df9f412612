"""What goes wrong in a run: the grid, a pitch drive, a sensor; and stops that are ordered."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from fowt_env.descriptions.records import Finite, NonNegative, Positive, Record, checked_record
from fowt_env.errors import InputError, unknown
from fowt_env.plant.measurement import BladeMeasurement, Measurement

STOP_FAULTS = ("emergency_stop", "normal_stop")
FIELDS = tuple(name for name in (*Measurement._fields, *BladeMeasurement._fields) if name != "time")


class FaultKind(NamedTuple):
    """A kind of fault."""

    keys: tuple[str, ...]  # beside kind and time
    summary: str  # TIME: its time


FAULTS = {
    "grid_loss": FaultKind(("delay", "rate"), "the generator torque is zero from TIME on"),
    "emergency_stop": FaultKind(("rate",), "no torque, and the blades feather from TIME on"),
    "normal_stop": FaultKind(
        ("rate",), "the blades feather at the normal rate; the torque falls with the rotor speed"
    ),
    "stuck_pitch": FaultKind(("blades", "backup"), "blades stay where they are at TIME"),
    "pitch_runaway": FaultKind(
        ("blades", "towards", "backup"), "blades run to one end of their range (JSON: towards)"
    ),
    "pitch_offset": FaultKind(
        ("blades", "offset"), "blades are off from what their encoders show (JSON: offset, deg)"
    ),
    "sensor_bias": FaultKind(("field", "value"), "a reading is off (JSON: field, value)"),
    "sensor_freeze": FaultKind(("field",), "a reading stays as it is at TIME (JSON: field)"),
    "sensor_loss": FaultKind(("field",), "a reading is zero from TIME on (JSON: field)"),
}
KINDS = tuple(FAULTS)
BLADE_FAULTS = tuple(kind for kind, fault in FAULTS.items() if "blades" in fault.keys)
SENSOR_FAULTS = tuple(kind for kind, fault in FAULTS.items() if "field" in fault.keys)
NEEDED = ("towards", "offset", "field", "value")  # by the kinds that have them
Blade = Annotated[int, Field(ge=1, le=3, strict=True)]


class Fault(Record):
    """A fault of a load case.

    A run with a fault goes on past the turbine's overspeed, which ends any other as failed: how far a rotor
    without torque or pitch runs away is what such a case shows.

    The kinds are those of FAULTS, the keys of each as in docs/guides/faults.md. Readings are of Measurement
    or, with pitch="individual", of BladeMeasurement; single blades need a scene with that option too.
    """

    kind: Literal[KINDS]
    time: NonNegative  # s
    delay: NonNegative | None = None  # s from the loss of the grid to feathering; None: no feathering
    rate: Positive | None = None  # deg/s of feathering, in place of the protection's
    blades: tuple[Blade, ...] | None = None  # None: all
    # whether an emergency stop feathers these blades all the same, from their own energy stores
    backup: Annotated[bool, Field(strict=True)] = False
    towards: Literal["fine", "feather"] | None = None
    offset: Finite | None = None  # deg, of the blades beyond what their encoders show
    field: str | None = None
    value: Finite | None = None  # SI, added to the reading

    def _problems(self):
        known = FAULTS[self.kind].keys
        for key in sorted(self.model_fields_set - {"kind", "time", *known}):
            if getattr(self, key) not in (None, False):
                yield f"{key}: is no key of {self.kind}, which has {', '.join(known)}"
        for key in NEEDED:
            if key in known and getattr(self, key) is None:
                yield f"{key} is missing: {self.kind} needs it"
        if self.field is not None and self.field not in FIELDS:
            yield str(unknown("field", self.field, FIELDS))
        if self.blades is not None and len(set(self.blades)) != max(len(self.blades), 1):
            yield f"blades = {list(self.blades)}: must be one or more of 1, 2, 3, each once"

    @property
    def grid_loss(self) -> float | None:
        """Return the time (s) from which the generator is off the grid; None: it stays."""
        return self.time if self.kind in ("grid_loss", "emergency_stop") else None

    @property
    def ends_operation(self) -> bool:
        """Return whether the turbine is stopped because of it: its protection then is part of the case."""
        return self.kind not in (*SENSOR_FAULTS, "pitch_offset")


def read_faults(value: Any) -> tuple[Fault, ...]:
    """Return a tuple of Faults from none, one or several, each a Fault or a mapping of its keys.

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
