"""Remembered signatures of built-in functions against numba's own resolution."""

import numba
import numpy as np
import pytest
from numba.core.registry import cpu_target
from numba.core.types import Function

from fowt_env.plant.compile import signatures
from fowt_env.plant.compile.decorators import kernel

NUMBAS = Function.get_call_type


@kernel
def mixed(a, i):
    """Numbers, booleans and an array of several types."""
    total = a[i] + i * 2 - abs(a[0]) // 3
    return total if total > a[i + 1] and i != 7 else a[-1] ** 2 / (i + 0.5) + max(a[0], i)


@kernel
def faulty(a):
    """No numbers of a text and an array."""
    return a + "text"


@numba.njit
def called_mixed(a, i):
    """Kernels called from Python are compiled by numba alone."""
    return mixed(a, i)


@numba.njit
def called_faulty(a):
    """As called_mixed."""
    return faulty(a)


def test_each_is_what_numba_finds_and_only_while_a_kernel_is_compiled():
    for kind in (np.float64, np.int64, np.float32):
        called_mixed(np.arange(9, dtype=kind), 3)
    assert Function.get_call_type is NUMBAS
    assert len(signatures._known) > 10
    for (function, args), signature in signatures._known.items():
        assert NUMBAS(function, cpu_target.typing_context, args, {}) == signature
        assert function.get_impl_key(signature) is function.key[0]


def test_numba_has_its_own_again_after_a_kernel_that_cannot_be_compiled():
    with pytest.raises(numba.TypingError, match="text"):
        called_faulty(np.zeros(2))
    assert Function.get_call_type is NUMBAS
