"""The payload of a Handle against numba's own unboxing of the same tuple."""

import gc
import subprocess
import sys
from typing import NamedTuple

import numba
import numpy as np
import pytest

from fowt_env.plant.compile.decorators import entry, kernel
from fowt_env.plant.compile.handle import Handle, by_reference, data_of, model_of


class Inner(NamedTuple):
    on: bool
    count: int
    pair: tuple
    rows: np.ndarray


@by_reference
class Outer(NamedTuple):
    first: bool
    small: np.float32
    missing: None
    inner: Inner
    mixed: tuple
    law: object
    bits: np.ndarray


@numba.cfunc("float64(float64)")
def law(x):
    return 3.0 * x


def outer(seed):
    generator = np.random.default_rng(seed)
    rows = generator.normal(size=(4, 6))[::2, 1:]  # strides that are not those of a contiguous array
    inner = Inner(True, -7 + seed, (1.5, 2.5, seed + 0.25), rows)
    bits = np.arange(5, dtype=np.int32)
    return Outer(False, np.float32(0.1), None, inner, (True, 2**40, 0.5, (1.0, None)), law, bits)


@kernel
def fill(o, out):
    out[0], out[1], out[2] = o.first, o.small, o.inner.on
    out[3], out[4], out[5] = o.inner.count, o.inner.pair[2], o.inner.rows[1, 4]
    out[6], out[7], out[8] = o.mixed[0], o.mixed[1], o.mixed[3][0]
    out[9], out[10], out[11] = o.law(2.0), o.bits.sum(), o.inner.rows.shape[0]


@entry
def by_value(model, data, out):
    fill(model, out[0])
    fill(data, out[1])


@entry
def by_handle(handle, out):
    fill(model_of(handle), out[0])
    fill(data_of(handle), out[1])


def test_a_kernel_reads_what_numba_unboxes():
    got, wanted = np.zeros((2, 12)), np.ones((2, 12))
    by_value(outer(0), outer(1), wanted)
    handle = Handle(outer(0), outer(1))
    gc.collect()  # the handle alone refers to the arrays
    by_handle(handle, got)
    assert np.array_equal(got, wanted) and wanted[0, 5] == outer(0).inner.rows[1, 4] and wanted[0, 9] == 6.0


def test_a_handle_may_come_before_anything_is_compiled():
    code = "from fowt_env.plant.compile.handle import Handle; Handle(1.0, None)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


@pytest.mark.parametrize("value", [1j, "text", np.float64], ids=["complex", "text", "class"])
def test_a_value_without_a_layout_is_refused(value):
    with pytest.raises(TypeError, match="a model cannot hold"):
        Handle((1.0, value), None)
