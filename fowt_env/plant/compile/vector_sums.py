"""Sums of products in eight lanes, written as vector instructions.

LLVM may not reorder a floating-point sum, so a plain loop adds one product after another. Allowing it
to (fastmath) leaves the order to each caller's copy, and bits then differ from process to process. Here
the order is fixed: lane l adds the products l, l + 8, l + 16, ..., and the lanes are added in pairs. The
Python twin beside each does the same, for runs with the JIT off.
"""

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from fowt_env.plant.compile.decorators import kernel

SUM_LANES = 8
CROSSED = ((0, 2), (0, 3), (1, 2), (1, 3))  # of rows v, g, c, s


def add_lanes(lanes):
    """Sum of eight lanes in pairs: the order that the compiled form has."""
    four = [lanes[i] + lanes[i + 4] for i in range(4)]
    two = [four[0] + four[2], four[1] + four[3]]
    return float(two[0] + two[1])


def _sums_twin(rows, pairs, n):
    """The sums of _lane_sums in Python, in the same order."""
    rows = [np.asarray(row[:n]).reshape(-1, SUM_LANES) for row in rows]
    totals = np.zeros((len(pairs), SUM_LANES))
    for k in range(n // SUM_LANES):
        for total, (i, j) in zip(totals, pairs, strict=True):
            total += rows[i][k] * rows[j][k]
    return tuple(add_lanes(total) for total in totals)


VECTOR = ir.VectorType(ir.DoubleType(), SUM_LANES)


def _reduce(builder, vector):
    """Sum of a vector's lanes in the order of add_lanes."""
    for half in (4, 2):
        undefined = ir.Constant(vector.type, ir.Undefined)
        low, high = (
            builder.shuffle_vector(
                vector, undefined, ir.Constant(ir.VectorType(ir.IntType(32), half), list(range(k, k + half)))
            )
            for k in (0, half)
        )
        vector = builder.fadd(low, high)
    index = [ir.Constant(ir.IntType(32), i) for i in range(2)]
    return builder.fadd(builder.extract_element(vector, index[0]), builder.extract_element(vector, index[1]))


def _lane_sums(context, builder, signature, args, pairs):
    """Code that sums args[i][k] * args[j][k] over k < n (a multiple of 8) for each (i, j) of pairs."""
    *rows, n = args
    pointers = [
        context.make_array(kind)(context, builder, row).data
        for kind, row in zip(signature.args[:-1], rows, strict=True)
    ]
    zero = ir.Constant(VECTOR, [0.0] * SUM_LANES)
    totals = [cgutils.alloca_once_value(builder, zero) for _ in pairs]
    step = ir.Constant(n.type, SUM_LANES)
    with cgutils.for_range_slice(builder, ir.Constant(n.type, 0), n, step, n.type) as (index, _):
        loaded = []
        for pointer in pointers:
            place = builder.bitcast(builder.gep(pointer, [index]), VECTOR.as_pointer())
            loaded.append(builder.load(place, align=8))
        for (i, j), total in zip(pairs, totals, strict=True):
            builder.store(builder.fadd(builder.load(total), builder.fmul(loaded[i], loaded[j])), total)
    return context.make_tuple(
        builder, signature.return_type, [_reduce(builder, builder.load(total)) for total in totals]
    )


@intrinsic
def _one_sum(typing_context, a, b, n):
    def generate(context, builder, signature, args):
        return _lane_sums(context, builder, signature, args, ((0, 1),))

    return types.UniTuple(types.float64, 1)(a, b, types.intp), generate


@intrinsic
def _four_sums(typing_context, v, g, c, s, n):
    def generate(context, builder, signature, args):
        return _lane_sums(context, builder, signature, args, CROSSED)

    return types.UniTuple(types.float64, 4)(v, g, c, s, types.intp), generate


if numba.config.DISABLE_JIT:

    def lane_dot(a, b, n):
        """Sum of a[k] b[k] over k < n, a multiple of SUM_LANES."""
        return _sums_twin((a, b), ((0, 1),), n)[0]

    def crossed_sums(v, g, c, s, n):
        """Sums over k < n, a multiple of SUM_LANES, of v c, v s, g c and g s."""
        return _sums_twin((v, g, c, s), CROSSED, n)

else:

    @kernel
    def lane_dot(a, b, n):
        """Sum of a[k] b[k] over k < n, a multiple of SUM_LANES; contiguous float64 rows."""
        return _one_sum(a, b, n)[0]

    @kernel
    def crossed_sums(v, g, c, s, n):
        """Sums over k < n, a multiple of SUM_LANES, of v c, v s, g c and g s; contiguous float64 rows."""
        return _four_sums(v, g, c, s, n)
