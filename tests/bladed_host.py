"""A small host with the Bladed interface: its records, libraries called by ctypes, runs through both."""

import ctypes
import shutil
from _ctypes import dlclose

import numpy as np
import pytest

from fowt_env.control import whole_view
from fowt_env.controllers.bladed.library import MEMORY_SIZE
from fowt_env.controllers.bladed.records import INDEX
from fowt_env.controllers.bladed.swap import Swap
from fowt_env.plant.measurement import BLADES_MEASURED, MEASURED, BladeMeasurement, Measurement

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler is installed"
)
COMMANDS = ("generator_torque_demand", "pitch_demand_1", "pitch_demand_2", "pitch_demand_3")
DEMANDS = [INDEX[name] for name in COMMANDS]


def records(turbine, values, status, interval, individual=False):
    """Return the array of a host, as for libraries that this package runs, from {measured field: value}."""
    swap = Swap(bytearray(MEMORY_SIZE), turbine, interval, individual=individual)
    fields = (*Measurement._fields, *(BladeMeasurement._fields if individual else ()))
    measured = whole_view([values.get(name, 0.0) for name in fields])
    for call in range(status + 1):  # the first call of a run settles which readings there are
        swap.fill(call, measured)
    return swap.records.copy()


def series(turbine, individual=False, instants=300, interval=0.1, seed=0):
    """Return arrays of a host whose readings wander over all operating regions, seed by seed the same."""
    rng = np.random.default_rng(seed)
    time = interval * np.arange(instants)

    def wandering(low, high):
        phases, periods = rng.uniform(0.0, 2.0 * np.pi, 4), rng.uniform(3.0, 40.0, 4)
        waves = sum(np.sin(2.0 * np.pi * time / t + p) for t, p in zip(periods, phases, strict=True))
        return low + (high - low) * (0.5 + 0.17 * waves)

    speed, torque = wandering(0.5, 1.25) * turbine.rated_rotor_speed, turbine.torque_law.rated_torque
    moment = torque * turbine.drivetrain.gear_ratio
    values = {
        "time": time,
        "rotor_speed": speed,
        "generator_speed": turbine.drivetrain.gear_ratio * speed,
        "generator_torque": wandering(0.0, 1.1) * torque,
        "platform_pitch": wandering(-0.05, 0.12),
        "platform_pitch_rate": wandering(-0.02, 0.02),
        "nacelle_acceleration": wandering(-1.0, 1.0),
        "azimuth": np.cumsum(speed * interval) % (2.0 * np.pi),
        "blade_pitch": wandering(-0.05, 0.4),
    }
    for blade in (1, 2, 3):
        values[f"blade_pitch_{blade}"] = wandering(-0.05, 0.4)
        values[f"root_out_of_plane_{blade}"] = wandering(0.5, 2.5) * moment
        values[f"root_in_plane_{blade}"] = wandering(-1.0, 2.0) * moment
    return [
        records(turbine, {name: value[k] for name, value in values.items()}, min(k, 1), interval, individual)
        for k in range(instants)
    ]


class Library:
    """Calls DISCON of a library; a path must be loaded once, as a library is one controller."""

    def __init__(self, path):
        self.library = ctypes.CDLL(str(path))
        self.library.DISCON.argtypes = [ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_char_p] * 3]
        self.library.DISCON.restype = None
        self.message = ctypes.create_string_buffer(400)

    def call(self, swap):
        """Return the command (torque, three pitches) of a call. Raises: RuntimeError with the message."""
        swap, failed = np.array(swap), ctypes.c_int(7)
        self.library.DISCON(swap.ctypes.data, ctypes.addressof(failed), b"", b"", self.message)
        if failed.value:
            raise RuntimeError(self.message.value.decode())
        self.swap = swap
        return tuple(float(value) for value in swap[DEMANDS])

    def close(self):
        dlclose(self.library._handle)


class InHost:
    """Controls a run of simulate through the records of a host."""

    name = "in a host"

    def __init__(self, call, turbine, interval, individual=False):
        self.answer, self.turbine, self.interval, self.individual = call, turbine, interval, individual
        self.information = (*Measurement._fields, *(BladeMeasurement._fields if individual else ()))
        self.arrays = []

    def reset(self, measurement):
        self.arrays = []

    def act(self, measurement):
        values = {name: getattr(measurement, name) for name in MEASURED}
        if self.individual:
            values |= {name: getattr(measurement.blades, name) for name in BLADES_MEASURED}
        status = min(len(self.arrays), 1)
        self.arrays.append(records(self.turbine, values, status, self.interval, self.individual))
        command = self.answer(self.arrays[-1])
        return command if self.individual else command[:2]


def changed(swap, **values):
    """Return a copy of an array with records changed by name."""
    swap = swap.copy()
    for name, value in values.items():
        swap[INDEX[name]] = value
    return swap
