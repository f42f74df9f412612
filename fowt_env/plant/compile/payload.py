"""Writes nested tuples of numbers and arrays to memory in the layout of numba's structures.

Numba can unbox such a tuple, in code that it compiles for each type: for a model of some hundred arrays that
took an eighth of the compile time of a scene. Here the same words are written from Python.
"""

import struct
from functools import partial

import numba
from llvmlite import ir
from numba import types
from numba.core.registry import cpu_target
from numba.experimental import function_type

SCALARS = {types.float64: "d", types.float32: "f", types.int64: "q", types.boolean: "?"}
ARRAYS = [struct.Struct(f"{5 + 2 * dimensions}q") for dimensions in range(9)]


def payload_writer(values):
    """Return (numba types, size in bytes, write) of a payload; write(memory, offset, values) fills it.

    The payload refers to the arrays' memory: the values must live as long as it does.
    Raises: TypeError for a value of a kind that is not supported.
    """
    context = cpu_target.target_context
    kinds = [types.unliteral(numba.typeof(value)) for value in values]
    models = [context.data_model_manager[kind].get_value_type() for kind in kinds]
    structure = ir.LiteralStructType(models)
    size, _, _ = _layout(structure)
    if size != context.get_abi_sizeof(structure):
        raise TypeError(f"{size} bytes instead of {context.get_abi_sizeof(structure)} for {kinds}")
    return kinds, size, _writer_of_fields(kinds, structure)


def _layout(kind):
    """Return (size, alignment, offsets of the elements) of an LLVM type, bytes; a number has no elements."""
    if isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        offsets, end, most = [], 0, 1
        for size, alignment, _ in map(_layout, kind.elements):
            offsets.append(_aligned(end, alignment))
            end, most = offsets[-1] + size, max(most, alignment)
        return _aligned(end, most), most, offsets
    if isinstance(kind, ir.IntType):
        size = (kind.width + 7) // 8
    else:
        size = 4 if isinstance(kind, ir.FloatType) else 8
    return size, size, []


def _aligned(offset, alignment):
    return -(-offset // alignment) * alignment


def _writer(kind, structure):
    """Return write(memory, offset, value) for a numba type and its LLVM type; None: nothing to write."""
    if isinstance(kind, types.NoneType):
        return None
    if isinstance(kind, types.Array):
        return _write_array
    if isinstance(kind, types.BaseTuple):
        return _writer_of_fields(list(kind), structure)
    if isinstance(kind, types.FunctionType):
        return partial(_write_function, kind.signature)
    if kind in SCALARS:
        return struct.Struct(SCALARS[kind]).pack_into
    raise TypeError(f"a model cannot hold a {kind}")


def _writer_of_fields(kinds, structure):
    _, _, offsets = _layout(structure)
    writers = map(_writer, kinds, structure.elements)
    fields = [(i, offsets[i], write) for i, write in enumerate(writers) if write is not None]

    def write_fields(memory, offset, values):
        for i, start, write in fields:
            write(memory, offset + start, values[i])

    return write_fields


def _write_array(memory, offset, array):
    """Write a numba array: no owner (two words), entries, bytes per entry, address, shape, strides."""
    address = array.__array_interface__["data"][0]
    pack = ARRAYS[array.ndim].pack_into
    pack(memory, offset, 0, 0, array.size, array.itemsize, address, *array.shape, *array.strides)


def _write_function(signature, memory, offset, function):
    """Write a first-class function: addresses of the C function, the Python object and numba's function."""
    address = function_type._get_wrapper_address(function, signature)
    own = function_type._get_jit_address(function, signature)
    struct.pack_into("3q", memory, offset, address, id(function), own)
