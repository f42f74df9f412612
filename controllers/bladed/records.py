"""Defines the records of the Bladed interface: the array that a simulator and a DISCON library exchange.

Numbers, units, signs and directions are those of OpenFAST v5.0.0 (modules/servodyn/src/BladedInterface.f90:
Fill_avrSWAP, Retrieve_avrSWAP, CheckDLLReturnValues; BladedInterface_EX.f90 for 1000 and above). Records are
numbered from 1, as in the Bladed manual; the array of the interface has float32 entries. The axes are
OpenFAST's: x downwind, y to the left seen along the wind, z up; blade pitch is positive towards feather.
"""

from typing import NamedTuple

TO, FROM, BOTH = "to library", "from library", "both"  # directions of a record
START, STEP, END = 0, 1, -1  # values of the record `status`: first call, time step, last call
SIZE = 3300  # records of the interface with the extended ones of OpenFAST
BLADES = 3
LOG_START, MOST_LOGS = 165, 300  # first record, and number, of values that a library may return for logging
PLATFORM_START = 1001  # first record of the platform's motion
EXTENDED_VERSION = 1.0


class Record(NamedTuple):
    """Describes a record: its number from 1, a name, unit, direction and meaning."""

    number: int
    name: str
    unit: str
    direction: str  # TO, FROM or BOTH
    meaning: str

    @property
    def index(self) -> int:
        """Return the index into an array that starts at 0."""
        return self.number - 1


def _each(numbers, name, unit, direction, meaning):
    """Return a record for each blade or axis of {blade or axis: number}, which ends its name and meaning."""
    return [
        Record(number, f"{name}_{end}", unit, direction, f"{meaning} {end}")
        for end, number in numbers.items()
    ]


def _motion(first, name, length, angle):
    """Return six records of the platform's motion from a number on: along x, y, z, then about x, y, z."""
    along, about = ({axis: start + i for i, axis in enumerate("xyz")} for start in (first, first + 3))
    return [
        *_each(along, f"platform_{name}", length, TO, f"{name} of the platform along"),
        *_each(about, f"platform_rotation_{name}", angle, TO, f"{name} of the platform about"),
    ]


# fmt: off
RECORDS = (
    Record(1, "status", "-", TO, "0 at the first call, 1 at every time step, -1 at the last call"),
    Record(2, "time", "s", TO, "time of the simulation"),
    Record(3, "communication_interval", "s", TO, "time between two calls"),
    Record(4, "blade_pitch_1", "rad", TO, "pitch angle of blade 1"),
    Record(5, "fine_pitch", "rad", TO, "pitch angle below rated wind speed"),
    Record(6, "minimum_pitch", "rad", TO, "smallest pitch angle"),
    Record(7, "maximum_pitch", "rad", TO, "largest pitch angle"),
    Record(8, "minimum_pitch_rate", "rad/s", TO, "most negative pitch rate"),
    Record(9, "maximum_pitch_rate", "rad/s", TO, "largest pitch rate"),
    Record(10, "pitch_actuator", "-", TO, "0: pitch angles are demanded; 1: pitch rates"),
    Record(11, "last_pitch_demand", "rad", TO, "pitch angle of blade 1 demanded by the last call"),
    Record(12, "last_pitch_rate_demand", "rad/s", TO, "pitch rate demanded by the last call"),
    Record(13, "demanded_power", "W", TO, "rated electrical power"),
    Record(14, "shaft_power", "W", TO, "mechanical power"),
    Record(15, "electrical_power", "W", TO, "electrical power"),
    Record(16, "optimal_mode_gain", "N m/(rad/s)^2", TO, "torque over squared generator speed, region 2"),
    Record(17, "minimum_generator_speed", "rad/s", TO, "generator speed at which region 2 begins"),
    Record(18, "maximum_optimal_speed", "rad/s", TO, "generator speed at which region 2 ends"),
    Record(19, "rated_generator_speed", "rad/s", TO, "generator speed demanded above rated wind speed"),
    Record(20, "generator_speed", "rad/s", TO, "generator speed, high-speed shaft"),
    Record(21, "rotor_speed", "rad/s", TO, "rotor speed"),
    Record(22, "rated_generator_torque", "N m", TO, "generator torque demanded above rated wind speed"),
    Record(23, "generator_torque", "N m", TO, "generator torque, high-speed shaft"),
    Record(24, "yaw_error", "rad", TO, "wind direction minus nacelle direction, about z"),
    Record(25, "torque_table_start", "-", TO, "first record of a table of torque over speed; 0: no table"),
    Record(26, "torque_table_points", "-", TO, "number of points of that table"),
    Record(27, "hub_wind_speed", "m/s", TO, "horizontal wind speed at the hub"),
    Record(28, "pitch_control", "-", TO, "0: one pitch demand for all blades; 1: one for each"),
    Record(29, "yaw_control", "-", TO, "0: yaw rate is demanded; 1: yaw torque"),
    *_each({1: 30, 2: 31, 3: 32}, "root_out_of_plane", "N m", TO, "out-of-plane moment, root of blade"),
    Record(33, "blade_pitch_2", "rad", TO, "pitch angle of blade 2"),
    Record(34, "blade_pitch_3", "rad", TO, "pitch angle of blade 3"),
    Record(35, "generator_contactor", "-", BOTH, "0: generator off; 1: on"),
    Record(36, "shaft_brake", "-", BOTH, "0: off; 1: on; 16: torque of record 107"),
    Record(37, "nacelle_direction", "rad", TO, "direction of the nacelle from north, about z"),
    Record(41, "yaw_torque_demand", "N m", FROM, "demanded torque of the yaw drive"),
    *_each({1: 42, 2: 43, 3: 44}, "pitch_demand", "rad", FROM, "demanded pitch angle of blade"),
    Record(45, "collective_pitch_demand", "rad", FROM, "demanded pitch angle of all blades"),
    Record(46, "collective_pitch_rate_demand", "rad/s", FROM, "demanded pitch rate of all blades"),
    Record(47, "generator_torque_demand", "N m", FROM, "demanded generator torque, high-speed shaft"),
    Record(48, "yaw_rate_demand", "rad/s", FROM, "demanded yaw rate of the nacelle"),
    Record(49, "message_size", "-", TO, "bytes of the message buffer with the final zero"),
    Record(50, "input_file_size", "-", TO, "bytes of the name of the input file with the final zero"),
    Record(51, "output_name_size", "-", TO, "bytes of the root name of outputs with the final zero"),
    Record(53, "tower_top_fore_aft_acceleration", "m/s2", TO, "acceleration of the tower top along x"),
    Record(54, "tower_top_side_side_acceleration", "m/s2", TO, "acceleration of the tower top along y"),
    Record(55, "pitch_override", "-", FROM, "other than 0: the simulator controls the pitch"),
    Record(56, "torque_override", "-", FROM, "other than 0: the simulator controls the torque"),
    Record(60, "azimuth", "rad", TO, "azimuth of blade 1, 0 where it points up"),
    Record(61, "blades", "-", TO, "number of blades"),
    Record(62, "most_logs", "-", TO, "largest number of values returned for logging"),
    Record(63, "log_start", "-", TO, "first record of values returned for logging"),
    Record(64, "output_name_capacity", "-", TO, "bytes of the buffer of OUTNAME, for names of logged values"),
    Record(65, "logs", "-", FROM, "number of values returned for logging"),
    Record(66, "platform_start", "-", TO, "first record of the platform's motion"),
    *_each({1: 69, 2: 70, 3: 71}, "root_in_plane", "N m", TO, "in-plane moment, root of blade"),
    Record(72, "start_up_resistance", "ohm", FROM, "start-up resistance of the generator"),
    Record(73, "rotating_hub_moment_y", "N m", TO, "moment at the hub about y, turning with the rotor"),
    Record(74, "rotating_hub_moment_z", "N m", TO, "moment at the hub about z, turning with the rotor"),
    Record(75, "hub_tilt_moment", "N m", TO, "moment at the hub about y, not turning"),
    Record(76, "hub_yaw_moment", "N m", TO, "moment at the hub about z, not turning"),
    Record(77, "yaw_bearing_tilt_moment", "N m", TO, "moment at the yaw bearing about y"),
    Record(78, "yaw_bearing_yaw_moment", "N m", TO, "moment at the yaw bearing about z"),
    Record(79, "load_request", "-", FROM, "loads that the library asks for"),
    Record(80, "slip_current", "-", FROM, "1: variable slip current is demanded"),
    Record(81, "slip_current_demand", "A", BOTH, "demanded variable slip current"),
    Record(82, "nacelle_roll_acceleration", "rad/s2", TO, "angular acceleration of the nacelle about x"),
    Record(83, "nacelle_nodding_acceleration", "rad/s2", TO, "angular acceleration of the nacelle about y"),
    Record(84, "nacelle_yaw_acceleration", "rad/s2", TO, "angular acceleration of the nacelle about z"),
    *_each({"x": 92, "y": 93, "z": 94}, "wind_change", "m/s", FROM, "demanded change of the wind along"),
    Record(95, "air_density", "kg/m3", TO, "density of the air"),
    Record(96, "mean_wind_speed", "m/s", TO, "mean wind speed of the run"),
    Record(98, "safety_system", "-", FROM, "number of the safety system to be activated"),
    Record(102, "yaw_control_flag", "-", FROM, "4: yaw torque of record 41 replaces the yaw rate"),
    Record(103, "yaw_stiffness", "N m/rad", FROM, "stiffness of the yaw drive"),
    Record(104, "yaw_damping", "N m s/rad", FROM, "damping of the yaw drive"),
    Record(107, "brake_torque_demand", "N m", FROM, "torque of the shaft brake, if record 36 is 16"),
    Record(108, "yaw_brake_torque_demand", "N m", FROM, "torque of the yaw brake"),
    Record(109, "shaft_torque", "N m", TO, "torque of the low-speed shaft"),
    Record(110, "thrust", "N", TO, "force of the rotor along the shaft"),
    Record(111, "shaft_force_y", "N", TO, "force on the low-speed shaft along y, not turning"),
    Record(112, "shaft_force_z", "N", TO, "force on the low-speed shaft along z, not turning"),
    Record(117, "controller_state", "-", TO, "always 0"),
    *_each({1: 120, 2: 121, 3: 122}, "airfoil_command", "-", FROM, "command to the airfoils of blade"),
    Record(129, "size", "-", TO, "number of records"),
    Record(1000, "extended_version", "-", TO, "version of the extended interface"),
    *_motion(PLATFORM_START, "displacement", "m", "rad"),
    *_motion(PLATFORM_START + 6, "velocity", "m/s", "rad/s"),
    *_motion(PLATFORM_START + 12, "acceleration", "m/s2", "rad/s2"),
)
# fmt: on
NUMBER = {record.name: record.number for record in RECORDS}
INDEX = {record.name: record.index for record in RECORDS}  # into an array that starts at 0
