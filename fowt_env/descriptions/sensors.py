"""Describes sensor chains: the models between true motions of the plant and a controller's readings."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from fowt_env.caches import cached
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.files import DATA, read_toml
from fowt_env.descriptions.nrel5mw import GEAR_RATIO, GENERATOR_SPEED, ROTOR_SPEED, TORQUE
from fowt_env.errors import InputError, unknown
from fowt_env.plant.measurement import BladeMeasure, BladeMeasurement, Measurement

EXACT = "exact"
LONGEST_DELAY = 100.0  # s
FIELDS = Measurement._fields + BladeMeasurement._fields
MOMENTS = BladeMeasurement._fields[BladeMeasure.ROOT_OUT_OF_PLANE_1 :]


@dataclass(frozen=True)
class Sensor:
    """Describes the sensor of a field of Measurement or BladeMeasurement, in SI units.

    Low pass, delay, noise with drift, and quantisation, in this order.

    Raises: InputError naming the key, value and allowed range.
    """

    noise: float = 0.0  # standard deviation of white noise on each reading
    drift: float = 0.0  # standard deviation of a slow error, a first-order Gauss-Markov process from t = 0 on
    drift_time: float = 3600.0  # s, its correlation time; long against a run: a constant offset
    time_constant: float = 0.0  # s, of a first-order low pass; 0: none
    delay: float = 0.0  # s from measurement to reading, taken as the nearest whole number of control periods
    step: float = 0.0  # of the quantisation; 0: none
    integral_of: str | None = None  # field that is integrated instead, as an acceleration to a velocity
    high_pass: float = 0.0  # rad/s, of the first-order high pass on such an integral
    source: str = ""
    confidence: str = ""

    def __post_init__(self) -> None:
        for key in ("noise", "drift", "time_constant", "step", "high_pass"):
            check_number(key, getattr(self, key), 0.0, allowed=">= 0 and finite")
        check_number("drift_time", self.drift_time, 0.0, low_open=True, allowed="> 0 and finite")
        check_number("delay", self.delay, 0.0, LONGEST_DELAY)


@dataclass(frozen=True)
class SensorChain:
    """Holds sensors by field of Measurement; a controller cannot read fields that the chain does not have.

    Fields of BladeMeasurement are read with individual pitch only. The time is always exact.
    Raises: InputError naming the field, key, value and allowed range.
    """

    name: str
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    description: str = ""

    def __post_init__(self) -> None:
        where = f"sensor chain {self.name!r}"
        known = [name for name in FIELDS if name != "time"]
        for name, sensor in self.sensors.items():
            if name not in known:
                raise unknown(f"field of {where}:", name, known)
            if not isinstance(sensor, Sensor):
                raise InputError(f"{where}: {name} = {sensor!r}: must be a Sensor")
            measured = sensor.integral_of
            if measured is None:
                continue
            if measured not in self.sensors or self.sensors[measured].integral_of is not None:
                allowed = "must be a field that the chain measures"
                raise InputError(f"{where}: {name}.integral_of = {measured!r}: {allowed}")
            if sensor != replace(sensor, noise=0.0, drift=0.0, time_constant=0.0, delay=0.0, step=0.0):
                raise InputError(
                    f"{where}: {name}: an integral has integral_of and high_pass; noise, drift,"
                    f" time_constant, delay and step are those of {measured}"
                )

    @property
    def available(self) -> tuple[str, ...]:
        """Return the fields of Measurement that the chain has, in the order of Measurement."""
        return tuple(name for name in Measurement._fields if name in self.sensors)

    @property
    def available_of_blades(self) -> tuple[str, ...]:
        """Return the fields of BladeMeasurement that the chain has, in the order of BladeMeasurement."""
        return tuple(name for name in BladeMeasurement._fields if name in self.sensors)


@cached(1)
def built_in_chains() -> dict[str, SensorChain]:
    """Return {name: SensorChain} of fowt_env/data/sensors.toml."""
    table = read_toml(DATA / "sensors.toml", "sensors")["chain"]
    return {name: _chain(name, entries) for name, entries in table.items()}


def _chain(name: str, entries: dict[str, Any]) -> SensorChain:
    known = [item.name for item in fields(Sensor)]
    sensors = {}
    for quantity, values in entries.items():
        if quantity == "description":
            continue
        for key in values:
            if key not in known:
                raise unknown(f"key of sensor {name}.{quantity}:", key, known)
        sensors[quantity] = Sensor(**values)
    return SensorChain(name, sensors, entries.get("description", ""))


def sensors_of(sensors: str | SensorChain | None, turbine: Any) -> SensorChain | None:
    """Return the SensorChain of a run with a Turbine description; None for exact readings.

    A built-in chain, selected by name, is scaled to the turbine: noise, drift and quantisation of shaft
    speeds and torque with the rated values, those of bending moments with the rated torque on the rotor
    shaft. A SensorChain is returned unchanged. Raises: InputError as sensor_chain.
    """
    chain = sensor_chain(sensors)
    if chain is None or not isinstance(sensors, str):
        return chain
    factors = {
        "rotor_speed": turbine.rated_rotor_speed / ROTOR_SPEED,
        "generator_speed": turbine.torque_law.rated_speed / GENERATOR_SPEED,
        "generator_torque": turbine.torque_law.rated_torque / TORQUE,
    }
    slow = turbine.drivetrain.gear_ratio * factors["generator_torque"] / GEAR_RATIO
    factors |= dict.fromkeys(MOMENTS, slow)
    if all(factor == 1.0 for factor in factors.values()):
        return chain
    scaled = dict(chain.sensors)
    for name, factor in factors.items():
        if name in scaled:
            sensor = scaled[name]
            parts = {key: factor * getattr(sensor, key) for key in ("noise", "drift", "step")}
            scaled[name] = replace(sensor, **parts)
    return replace(chain, sensors=scaled)


def sensor_chain(sensors: str | SensorChain | None) -> SensorChain | None:
    """Return the SensorChain of a run from a name or SensorChain; None for None and "exact".

    Raises: InputError for an unknown name and for anything else.
    """
    if sensors is None or isinstance(sensors, SensorChain):
        return sensors
    if not isinstance(sensors, str):
        raise InputError(f"sensors = {sensors!r}: must be the name of a sensor chain, a SensorChain or None")
    if sensors == EXACT:
        return None
    if sensors not in built_in_chains():
        raise unknown("sensor chain", sensors, (EXACT, *built_in_chains()))
    return built_in_chains()[sensors]
