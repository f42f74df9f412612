"""Fills the array of the Bladed interface from a measurement, and reads the demands of a library from it."""

import os

import numpy as np

from fowt_env.control import values_of_blades
from fowt_env.controllers.bladed import library as arguments
from fowt_env.controllers.bladed.records import (
    BLADES,
    EXTENDED_VERSION,
    INDEX,
    LOG_START,
    MOST_LOGS,
    NUMBER,
    PLATFORM_START,
    RECORDS,
    SIZE,
    START,
)
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure

# {record: (field of Measurement, sign)}; OpenFAST's yaw error is the wind direction (0 here) minus the yaw
READINGS = {
    "time": (Measure.TIME, 1.0),
    **{f"blade_pitch_{blade}": (Measure.BLADE_PITCH, 1.0) for blade in range(1, BLADES + 1)},
    "generator_speed": (Measure.GENERATOR_SPEED, 1.0),
    "rotor_speed": (Measure.ROTOR_SPEED, 1.0),
    "generator_torque": (Measure.GENERATOR_TORQUE, 1.0),
    "yaw_error": (Measure.YAW, -1.0),
    "hub_wind_speed": (Measure.WIND_SPEED, 1.0),
    "nacelle_direction": (Measure.YAW, 1.0),
    "tower_top_fore_aft_acceleration": (Measure.NACELLE_ACCELERATION, 1.0),
    "nacelle_nodding_acceleration": (Measure.NACELLE_PITCH_ACCELERATION, 1.0),
    "platform_displacement_x": (Measure.SURGE, 1.0),
    "platform_displacement_y": (Measure.SWAY, 1.0),
    "platform_displacement_z": (Measure.HEAVE, 1.0),
    "platform_rotation_displacement_x": (Measure.ROLL, 1.0),
    "platform_rotation_displacement_y": (Measure.PLATFORM_PITCH, 1.0),
    "platform_rotation_displacement_z": (Measure.YAW, 1.0),
    "platform_velocity_x": (Measure.SURGE_RATE, 1.0),
    "platform_velocity_y": (Measure.SWAY_RATE, 1.0),
    "platform_velocity_z": (Measure.HEAVE_RATE, 1.0),
    "platform_rotation_velocity_x": (Measure.ROLL_RATE, 1.0),
    "platform_rotation_velocity_y": (Measure.PLATFORM_PITCH_RATE, 1.0),
    "platform_rotation_velocity_z": (Measure.YAW_RATE, 1.0),
    "platform_rotation_acceleration_y": (Measure.NACELLE_PITCH_ACCELERATION, 1.0),
}
BLADE_READINGS = {  # of a scene with individual pitch
    record.name: BladeMeasure[record.name.upper()]
    for record in RECORDS
    if record.name.upper() in BladeMeasure.__members__
}
INFORMATION = tuple(
    dict.fromkeys(
        [field.name.lower() for field, _ in READINGS.values()]
        + [field.name.lower() for field in BLADE_READINGS.values()]
    )
)
# Demands that the plant cannot follow: {record: what a library demands with any value but 0}
REFUSED = {
    "shaft_brake": "the shaft brake, which the plant does not have",
    "yaw_rate_demand": "a yaw rate: the nacelle does not yaw",
    "pitch_override": "a pitch control of the simulator, which there is none of",
    "torque_override": "a torque control of the simulator, which there is none of",
    "yaw_control_flag": "a yaw torque: the nacelle does not yaw",
}
STATUS, FIRST_PITCH = INDEX["status"], INDEX["blade_pitch_1"]
SHAFT_POWER, ELECTRICAL_POWER = INDEX["shaft_power"], INDEX["electrical_power"]
LAST_DEMAND, CONTACTOR = INDEX["last_pitch_demand"], INDEX["generator_contactor"]
TORQUE, LOGS = INDEX["generator_torque_demand"], INDEX["logs"]
COLLECTIVE, INDIVIDUAL = INDEX["collective_pitch_demand"], INDEX["pitch_demand_1"]  # the other blades follow


def _places(readings):
    return np.array([INDEX[name] for name in readings])


_PLACES, _BLADE_PLACES, _REFUSED_PLACES = map(_places, (READINGS, BLADE_READINGS, REFUSED))
_FIELDS, _SIGNS = (np.array(part) for part in zip(*READINGS.values(), strict=True))
_BLADE_FIELDS = np.array(list(BLADE_READINGS.values()))


@kernel
def fill_records(records, values, blades, status, efficiency):
    """Fill the records of a call from the values of a measurement; NaN leaves a record as it is.

    values: (n,) of the measurement, those of single blades from the index `blades` on, if there are any.
    """
    records[STATUS] = status
    for i in range(_PLACES.shape[0]):
        value = values[_FIELDS[i]]
        if value == value:  # declared, and in the sensor chain
            records[_PLACES[i]] = value * _SIGNS[i]
    power = values[Measure.GENERATOR_TORQUE] * values[Measure.GENERATOR_SPEED]
    if power == power:
        records[SHAFT_POWER], records[ELECTRICAL_POWER] = power, efficiency * power
    if values.shape[0] > blades:
        for i in range(_BLADE_PLACES.shape[0]):
            value = values[blades + _BLADE_FIELDS[i]]
            if value == value:  # otherwise the pitch of all blades stays in force
                records[_BLADE_PLACES[i]] = value
    if status == START:
        records[LAST_DEMAND] = records[FIRST_PITCH]


@kernel
def take_demands(records, individual, command):
    """Write the demands of a call to a command; there is no torque with the generator off.

    individual: whether there is a demand for each blade, else one for all.
    """
    command[0] = records[TORQUE] if records[CONTACTOR] != 0.0 else 0.0
    first, count = (INDIVIDUAL, BLADES) if individual else (COLLECTIVE, 1)
    for i in range(count):
        command[1 + i] = records[first + i]
    records[LAST_DEMAND] = records[first]


class Swap:
    """Holds the arguments of a library's calls in one run: avrSWAP, aviFAIL, MESSAGE, OUTNAME and INFILE.

    memory: writable buffer of MEMORY_SIZE bytes (bladed/library.py). Records that neither the turbine nor a
    reading fills are 0, and so are readings that the controller does not have.
    Raises: InputError for an input file or a root name of outputs that is too long.
    """

    def __init__(self, memory, turbine, control_dt, input_file="", output_name="", individual=False):
        self._memory = memory
        self.records = np.frombuffer(memory, np.float32, arguments.RECORDS)
        self.records[:] = 0.0
        self._failure = np.frombuffer(memory, np.int32, 1, arguments.FAILURE_AT)
        self._efficiency = turbine.drivetrain.generator_efficiency
        self._individual = bool(individual)
        self._control_dt, self._rate = control_dt, 0.0  # rad/s, of platform pitch at the last call
        names = [os.fsencode(name) for name in (input_file, output_name)]
        for name, start, size in (
            (names[0], arguments.INPUT_FILE_AT, arguments.INPUT_FILE_SIZE),
            (names[1], arguments.OUTPUT_NAME_AT, arguments.OUTPUT_NAME_SIZE),
        ):
            if len(name) >= size:
                raise InputError(f"path {os.fsdecode(name)!r}: {len(name)} bytes: must be fewer than {size}")
            memory[start : start + size] = name.ljust(size, b"\0")
        law, drive = turbine.torque_law, turbine.pitch_drive
        constants = {
            "communication_interval": control_dt,
            "fine_pitch": drive.minimum,
            "minimum_pitch": drive.minimum,
            "maximum_pitch": drive.maximum,
            "minimum_pitch_rate": -drive.rate_limit,
            "maximum_pitch_rate": drive.rate_limit,
            "demanded_power": self._efficiency * law.rated_power,
            "optimal_mode_gain": law.region2_constant,
            "minimum_generator_speed": law.region2_start_speed,
            "maximum_optimal_speed": law.transition_speed,
            "rated_generator_speed": law.rated_speed,
            "rated_generator_torque": law.rated_torque,
            "pitch_control": float(individual),
            "generator_contactor": 1.0,
            "message_size": arguments.MESSAGE_SIZE,
            "input_file_size": len(names[0]) + 1,
            "output_name_size": len(names[1]) + 1,
            "blades": turbine.rotor.blades,
            "most_logs": MOST_LOGS,
            "log_start": LOG_START,
            "output_name_capacity": arguments.OUTPUT_NAME_SIZE,
            "platform_start": PLATFORM_START,
            "size": SIZE,
            "extended_version": EXTENDED_VERSION,
        }
        for name, value in constants.items():
            self.records[INDEX[name]] = value

    def fill(self, status, measurement):
        """Fill the records of a call with its status (START or STEP) from a Measurement.

        A chain of sensors without the angular acceleration of the nacelle gives the slope of the measured
        rate of platform pitch for it: with 0 there, ROSCO's floating feedback would do nothing.
        """
        values = np.array([*measurement, *values_of_blades(measurement)], dtype=np.float64)
        rate = values[Measure.PLATFORM_PITCH_RATE]
        if np.isnan(values[Measure.NACELLE_PITCH_ACCELERATION]):
            slope = 0.0 if status == START else (rate - self._rate) / self._control_dt
            values[Measure.NACELLE_PITCH_ACCELERATION] = slope
        self._rate = rate
        fill_records(self.records, values, N_MEASUREMENTS, float(status), self._efficiency)
        self.clear()

    def clear(self):
        """Reset the code and the message of the last call."""
        self._failure[0] = 0
        self._memory[arguments.MESSAGE_AT] = 0

    @property
    def failure(self):
        """Return the code of the last call: 0, > 0 with a message, < 0 for a failure."""
        return int(self._failure[0])

    @property
    def message(self):
        """Return the message of the last call as one line."""
        return arguments.text_at(self._memory, arguments.MESSAGE_AT, arguments.MESSAGE_SIZE)

    def refusal(self):
        """Return what the library demands that the plant cannot follow, None for nothing."""
        records = self.records
        if records[_REFUSED_PLACES].any():
            for name, what in REFUSED.items():
                if value := float(records[INDEX[name]]):
                    return f"demands {what} (record {NUMBER[name]}, {name} = {value:g})"
        if (value := float(records[CONTACTOR])) not in (0.0, 1.0):
            return f"sets the generator contactor (record 35) to {value:g}: must be 0 (off) or 1 (on)"
        if (value := float(records[LOGS])) > MOST_LOGS:
            return f"returns {value:g} values for logging (record 65): must be at most {MOST_LOGS}"
        return None

    def demands(self):
        """Return (generator torque, blade pitch or that of each blade); no torque with the generator off."""
        command = np.empty(1 + (BLADES if self._individual else 1))
        take_demands(self.records, self._individual, command)
        return tuple(command.tolist())
