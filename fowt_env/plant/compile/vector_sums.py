"""Computes sums of products in eight lanes by vector instructions, and the square root for vector loops.

LLVM may not reorder a floating-point sum, so a plain loop adds one product after another. With fastmath
the order depends on each caller's copy, and last bits then differ from process to process. Here the
order is fixed: lane l adds the products l, l + 8, l + 16, ..., and the lanes are added in pairs. Each
compiled sum has a Python twin with the same order, for runs with the JIT off.
"""

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from fowt_env.plant.compile.decorators import kernel

SUM_LANES = 8
PAIR_LANES = SUM_LANES // 2  # poles whose states, real and imaginary parts, fill the lanes of a sum
CROSSED = ((0, 2), (0, 3), (1, 2), (1, 3))  # of rows v, g, c, s


def add_lanes(lanes):
    """Return the sum of eight lanes, added in pairs in the order of the compiled form."""
    four = [lanes[i] + lanes[i + 4] for i in range(4)]
    two = [four[0] + four[2], four[1] + four[3]]
    return float(two[0] + two[1])


def _sums_twin(rows, pairs, n):
    """Return the sums of _lane_sums, computed in Python in the same order."""
    rows = [np.asarray(row[:n]).reshape(-1, SUM_LANES) for row in rows]
    totals = np.zeros((len(pairs), SUM_LANES))
    for k in range(n // SUM_LANES):
        for total, (i, j) in zip(totals, pairs, strict=True):
            total += rows[i][k] * rows[j][k]
    return tuple(add_lanes(total) for total in totals)


VECTOR = ir.VectorType(ir.DoubleType(), SUM_LANES)


def _reduce(builder, vector):
    """Generate code for the sum of a vector's lanes in the order of add_lanes."""
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
    """Generate code that sums args[i][k] args[j][k] over k < n, a multiple of 8, for (i, j) in pairs."""
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
            address = builder.bitcast(builder.gep(pointer, [index]), VECTOR.as_pointer())
            loaded.append(builder.load(address, align=8))
        for (i, j), total in zip(pairs, totals, strict=True):
            builder.store(builder.fadd(builder.load(total), builder.fmul(loaded[i], loaded[j])), total)
    return context.make_tuple(
        builder, signature.return_type, [_reduce(builder, builder.load(total)) for total in totals]
    )


@intrinsic
def _square_root(typing_context, value):
    def generate(context, builder, signature, args):
        root_of = builder.module.declare_intrinsic("llvm.sqrt", [ir.DoubleType()])
        return builder.call(root_of, args)

    return types.float64(types.float64), generate


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


@intrinsic
def _advance(typing_context, x, y, factors, first, start, begin, count, old, new):
    """Generate the loop of advance_pairs over four poles at a time, which fill 256 bits."""

    def generate(context, builder, signature, args):
        source, target, table = (
            context.make_array(kind)(context, builder, array)
            for kind, array in zip(signature.args[:3], args[:3], strict=True)
        )
        first, start, begin, count, old, new = args[3:]
        width = cgutils.unpack_tuple(builder, table.shape, 2)[1]
        vector = ir.VectorType(ir.DoubleType(), PAIR_LANES)

        def at(base, index):
            return builder.bitcast(builder.gep(base, [index]), vector.as_pointer())

        def spread(value):
            undefined, zero = ir.Constant(vector, ir.Undefined), ir.Constant(ir.IntType(32), 0)
            one = builder.insert_element(undefined, value, zero)
            lanes = ir.Constant(ir.VectorType(ir.IntType(32), PAIR_LANES), [0] * PAIR_LANES)
            return builder.shuffle_vector(one, undefined, lanes)

        before, after = spread(old), spread(new)
        step = ir.Constant(count.type, PAIR_LANES)
        zero = ir.Constant(count.type, 0)
        with cgutils.for_range_slice(builder, zero, count, step, count.type) as (index, _):
            real_part = builder.add(start, index)
            imaginary_part = builder.add(real_part, count)
            real, imaginary = (builder.load(at(source.data, k), align=8) for k in (real_part, imaginary_part))
            column, rows = builder.add(begin, index), []
            for k in range(6):
                row = builder.mul(builder.add(first, ir.Constant(first.type, k)), width)
                rows.append(builder.load(at(table.data, builder.add(row, column)), align=8))
            er, ei, sr, si, nr, ni = rows

            def sum_of(a, p, b, q):
                return builder.fadd(builder.fmul(a, p), builder.fmul(b, q))

            rotated = builder.fsub(builder.fmul(er, real), builder.fmul(ei, imaginary))
            builder.store(
                builder.fadd(rotated, sum_of(sr, before, nr, after)), at(target.data, real_part), align=8
            )
            rotated = sum_of(er, imaginary, ei, real)
            builder.store(
                builder.fadd(rotated, sum_of(si, before, ni, after)), at(target.data, imaginary_part), align=8
            )
        return context.get_dummy_value()

    counts = (types.intp,) * 4
    return types.void(x, y, factors, *counts, types.float64, types.float64), generate


if numba.config.DISABLE_JIT:

    def root(value):
        """Return the square root of a number; NaN below zero."""
        return float(np.sqrt(value))

    def advance_pairs(x, y, factors, first, start, begin, count, old, new):
        """Advance the states of pole pairs from x to y; see the compiled form."""
        real, imaginary = x[start : start + count].copy(), x[start + count : start + 2 * count].copy()
        er, ei, sr, si, nr, ni = factors[first : first + 6, begin : begin + count]
        y[start : start + count] = (er * real - ei * imaginary) + (sr * old + nr * new)
        y[start + count : start + 2 * count] = (er * imaginary + ei * real) + (si * old + ni * new)

    def lane_dot(a, b, n):
        """Return the sum of a[k] b[k] over k < n, a multiple of SUM_LANES."""
        return _sums_twin((a, b), ((0, 1),), n)[0]

    def crossed_sums(v, g, c, s, n):
        """Return the sums over k < n, a multiple of SUM_LANES, of v c, v s, g c and g s."""
        return _sums_twin((v, g, c, s), CROSSED, n)

else:

    @kernel
    def root(value):
        """Return the square root of a number, NaN below zero, by an instruction that loops can vectorise."""
        return _square_root(value)

    @kernel
    def advance_pairs(x, y, factors, first, start, begin, count, old, new):
        """Advance the complex states z of `count` poles by one step: z = e z + s old + n new.

        x, y: from index `start` the real parts of the states, then the imaginary parts; read from x, written
        to y, which may be x. count: a multiple of PAIR_LANES. factors: from row `first` and column `begin`
        the real and imaginary parts of e, s and n.
        """
        _advance(x, y, factors, first, start, begin, count, old, new)

    @kernel
    def lane_dot(a, b, n):
        """Return the sum of a[k] b[k] over k < n, a multiple of SUM_LANES; contiguous float64 rows."""
        return _one_sum(a, b, n)[0]

    @kernel
    def crossed_sums(v, g, c, s, n):
        """Return the sums over k < n, a multiple of SUM_LANES, of v c, v s, g c and g s; float64 rows."""
        return _four_sums(v, g, c, s, n)
