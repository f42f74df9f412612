"""A small host with the Bladed interface: records of measurements, and libraries called by ctypes."""

import ctypes
from _ctypes import dlclose

import numpy as np

from fowt_env.controllers.bladed.records import INDEX, SIZE
from fowt_env.controllers.export.hosted import RECORD_OF
from fowt_env.plant.measurement import MEASURED, BladeMeasurement, Measurement

DEMANDS = [INDEX[name] for name in ("generator_torque_demand", "pitch_demand_1", "pitch_demand_2", "pitch_demand_3")]


def records(measurement, status, interval, extended=True):
    """Return the array (SIZE,) float32 of a host for a Measurement."""
    swap = np.zeros(SIZE, dtype=np.float32)
    blades = getattr(measurement, "_blades", None)
    for name, number in RECORD_OF.items():
        if number > 0 and number != 1:
            value = getattr(measurement, name) if name in MEASURED else getattr(blades, name, 0.0)
            swap[number - 1] = value
    if blades is None:
        for name in ("blade_pitch_1", "blade_pitch_2", "blade_pitch_3"):
            swap[INDEX[name]] = measurement.blade_pitch
    swap[INDEX["status"]], swap[INDEX["communication_interval"]] = status, interval
    swap[INDEX["blades"]], swap[INDEX["message_size"]] = 3, 400
    swap[INDEX["pitch_control"]] = blades is not None
    swap[INDEX["size"]] = SIZE
    swap[INDEX["extended_version"]] = 1.0 if extended else 0.0
    return swap


class Library:
    """Calls DISCON of a library; the path must be new for each instance."""

    def __init__(self, path):
        self.library = ctypes.CDLL(str(path))
        self.library.DISCON.argtypes = [ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_char_p] * 3]
        self.library.DISCON.restype = None
        self.failed, self.message = ctypes.c_int(0), ctypes.create_string_buffer(400)

    def call(self, swap):
        """Return (torque, three pitches) of a call; raise RuntimeError with the message of a failure."""
        swap = swap.copy()
        self.library.DISCON(swap.ctypes.data, ctypes.addressof(self.failed), b"", b"", self.message)
        if self.failed.value < 0:
            raise RuntimeError(self.message.value.decode())
        self.swap = swap
        return tuple(float(value) for value in swap[DEMANDS])

    def close(self):
        dlclose(self.library._handle)


class InHost:
    """Controls a run through the records of a host, and keeps these and the commands."""

    name = "in a host"

    def __init__(self, call, control_dt, individual=False, extended=True):
        self.run, self.control_dt, self.individual, self.extended = call, control_dt, individual, extended
        self.information = (*Measurement._fields, *(BladeMeasurement._fields if individual else ()))
        self.series, self.commands = [], []

    def reset(self, measurement):
        self.status = 0

    def act(self, measurement):
        swap = records(measurement, self.status, self.control_dt, self.extended)
        self.status = 1
        self.series.append(swap)
        self.commands.append(self.run(swap))
        return self.commands[-1] if self.individual else self.commands[-1][:2]


def replay(call, series):
    """Return the commands (n, 4) of a controller to recorded arrays."""
    return np.array([call(swap) for swap in series])
