"""Calls a loaded library with the Bladed interface as a control law inside the compiled loop.

The addresses of the library's function and of its five arguments are in the memory of the law, so that its
machine code holds none of them and can be kept on disk. What the library prints during a call goes to the
null device, as ROSCO reports every estimate of the wind outside its table.
"""

import ctypes
from enum import IntEnum
from math import nan

import numba
import numpy as np
from numba import carray

from fowt_env.controllers.bladed.library import FAILURE_AT, MESSAGE_AT, RECORDS
from fowt_env.controllers.bladed.records import INDEX, START, STEP
from fowt_env.controllers.bladed.swap import fill_records, take_demands
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.plant.state import N_INDIVIDUAL_COMMANDS

STDOUT = 1  # file descriptor
NODDING = INDEX["nacelle_nodding_acceleration"]


class Parameter(IntEnum):
    """Enumerates the law's parameter array."""

    CONTROL_DT = 0  # s
    EFFICIENCY = 1  # electrical over mechanical power
    INDIVIDUAL = 2  # 1: the library demands a pitch for each blade
    DIFFERENCED = 3  # 1: the nodding acceleration is the slope of the measured rate of platform pitch


class Memory(IntEnum):
    """Enumerates the law's memory array. Addresses are below 2^53 and thus exact in float64."""

    STATUS = 0  # of the next call: START or STEP
    FIRST = 1  # s, time of the first call, whose command the law returns again at this time; NaN: never
    RATE = 2  # rad/s, of platform pitch at the last call
    FUNCTION = 3  # address of the library's function
    ARGUMENTS = 4  # five addresses: avrSWAP, aviFAIL, INFILE, OUTNAME, MESSAGE
    FLUSH = 9  # address of a function that flushes the library's output, given a null pointer
    NULL_DEVICE = 10  # file descriptor
    LOCK = 11  # address of the lock of the process's standard output
    COMMAND = 12  # demands of the last call, NaN if it failed; to the end


N_MEMORY = Memory.COMMAND + N_INDIVIDUAL_COMMANDS

if numba.config.DISABLE_JIT:
    _c = ctypes.CDLL(None)
    dup, dup2, close = _c.dup, _c.dup2, _c.close

    def lock(address):
        """Lock a pthread mutex at an address."""
        return _c.pthread_mutex_lock(ctypes.c_void_p(address))

    def unlock(address):
        """Unlock a pthread mutex at an address."""
        return _c.pthread_mutex_unlock(ctypes.c_void_p(address))

    def pointer(address):
        """Return the pointer to an address."""
        return ctypes.c_void_p(address)

    def call_at(function, addresses):
        """Call the C function at an address with a tuple of addresses as its arguments."""
        ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(addresses))(function)(*addresses)

else:
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    # functions of the C library, found by their names when machine code is loaded
    dup = types.ExternalFunction("dup", types.int32(types.int32))
    dup2 = types.ExternalFunction("dup2", types.int32(types.int32, types.int32))
    close = types.ExternalFunction("close", types.int32(types.int32))
    lock = types.ExternalFunction("pthread_mutex_lock", types.int32(types.int64))
    unlock = types.ExternalFunction("pthread_mutex_unlock", types.int32(types.int64))

    @intrinsic
    def pointer(typing_context, address):
        """Return the pointer to an address."""

        def build(context, builder, signature, arguments):
            return builder.inttoptr(arguments[0], cgutils.voidptr_t)

        return types.voidptr(types.int64), build

    @intrinsic
    def call_at(typing_context, function, addresses):
        """Call the C function at an address with a tuple of addresses as its arguments."""
        count = len(addresses)

        def build(context, builder, signature, arguments):
            place, packed = arguments
            given = cgutils.unpack_tuple(builder, packed, count)
            kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t] * count)
            called = builder.inttoptr(place, kind.as_pointer())
            builder.call(called, [builder.inttoptr(each, cgutils.voidptr_t) for each in given])
            return context.get_dummy_value()

        return types.void(types.int64, types.UniTuple(types.int64, count)), build


@kernel
def _call_quietly(memory):
    """Call the library on its arguments with its output on the null device."""
    mutex, null = int(memory[Memory.LOCK]), int(memory[Memory.NULL_DEVICE])
    first = Memory.ARGUMENTS
    arguments = (
        int(memory[first]), int(memory[first + 1]), int(memory[first + 2]), int(memory[first + 3]),
        int(memory[first + 4]),
    )  # fmt: skip
    lock(mutex)
    shown = dup(STDOUT)
    dup2(null, STDOUT)
    call_at(int(memory[Memory.FUNCTION]), arguments)
    if memory[Memory.FLUSH] != 0.0:
        call_at(int(memory[Memory.FLUSH]), (0,))
    dup2(shown, STDOUT)
    close(shown)
    unlock(mutex)


@kernel
def _fill(records, parameters, memory, measurement):
    """Fill the records of a call from a measurement."""
    status = memory[Memory.STATUS]
    fill_records(records, measurement, N_MEASUREMENTS, status, parameters[Parameter.EFFICIENCY])
    if parameters[Parameter.DIFFERENCED] == 1.0:
        rate, slope = measurement[Measure.PLATFORM_PITCH_RATE], 0.0
        if status != START:
            slope = (rate - memory[Memory.RATE]) / parameters[Parameter.CONTROL_DT]
        records[NODDING] = slope
        memory[Memory.RATE] = rate


@control_kernel
def library_law(parameters, memory, measurement, command):
    """Call the library, unless this is the time of its first call; NaN if it reports a failure."""
    if memory[Memory.STATUS] == START or measurement[Measure.TIME] != memory[Memory.FIRST]:
        start = int(memory[Memory.ARGUMENTS])
        records = carray(pointer(start), (RECORDS,), np.float32)
        failure = carray(pointer(start + FAILURE_AT), (1,), np.int32)
        _fill(records, parameters, memory, measurement)
        failure[0] = 0
        carray(pointer(start + MESSAGE_AT), (1,), np.uint8)[0] = 0
        _call_quietly(memory)
        demands = memory[Memory.COMMAND :]
        take_demands(records, parameters[Parameter.INDIVIDUAL] == 1.0, demands)
        if failure[0] < 0:
            demands[:] = nan
        memory[Memory.STATUS] = STEP
    memory[Memory.FIRST] = nan
    for i in range(command.shape[0]):
        command[i] = memory[Memory.COMMAND + i]
