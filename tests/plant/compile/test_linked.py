"""Kernels that are linked into their callers: no machine code of their own, and the same figures."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from copied_code import copied_code
from numba.core.registry import CPUDispatcher

from fowt_env.layout import PACKAGE
from fowt_env.plant.compile.decorators import (
    entry,
    inlined_kernel,
    kernel,
    separate_kernel,
    shared_kernel,
)
from fowt_env.plant.compile.linked import LinkedLibrary


@kernel
def cubic(x):
    return x * x * x - 0.1 * x


@kernel
def slope(x):
    return (cubic(x + 1e-3) - cubic(x - 1e-3)) / 2e-3


@entry
def slopes(x, out):
    for i in range(x.shape[0]):
        out[i] = slope(x[i])


def test_a_kernel_is_linked_into_its_caller_without_machine_code():
    x = np.linspace(-2.0, 2.0, 9)
    out = np.empty(9)
    slopes(x, out)
    for function in (slope, cubic):
        (result,) = function.overloads.values()
        assert isinstance(result.library, LinkedLibrary)
        assert not result.library._codegen._engine.is_symbol_defined(result.fndesc.mangled_name)
    assert np.array_equal(out, [slope.py_func(value) for value in x])


@shared_kernel
def square(x):
    return x * x


@inlined_kernel
def squares(x):
    return square(x) + square(x + 1.0)


@entry
def both(x):
    return slope(x) + squares(x) - squares(2.0 * x)


def test_a_caller_has_one_copy_of_a_shared_kernel_and_of_others_as_many_as_it_calls():
    """An inlined kernel hands its option down to what it calls, so that LLVM inlines even the largest."""
    assert both(1.5) == slope(1.5) + (square(1.5) + square(2.5)) - (square(3.0) + square(4.0))
    (compiled,) = both.overloads.values()
    code = compiled.library.get_asm_str()
    defined = [line for line in code.splitlines() if line.startswith("_Z") and line.endswith(":")]
    assert sum("square" in name and "squares" not in name for name in defined) == 1
    assert not any("squares" in name or "slope" in name or "cubic" in name for name in defined)


@separate_kernel
def summed(values):
    total = 0.0
    for value in values:
        total += squares(value)
    return total


@entry
def twice_summed(values):
    return 2.0 * summed(values)


def test_a_caller_has_no_copy_of_a_separate_kernel():
    values = np.linspace(0.0, 1.0, 5)
    assert twice_summed(values) == 2.0 * summed.py_func(values) == 2.0 * summed(values)
    (result,), (compiled,) = summed.overloads.values(), twice_summed.overloads.values()
    assert f"{result.fndesc.mangled_name}:" in result.library.get_asm_str().splitlines()
    code = compiled.library.get_asm_str()
    assert f"{result.fndesc.mangled_name}:" not in code.splitlines() and result.fndesc.mangled_name in code


def test_python_calls_it_with_the_same_bits():
    values = np.random.default_rng(0).normal(size=50)
    out = np.empty(50)
    slopes(values, out)
    assert [slope(value) for value in values] == out.tolist()
    assert slope.twin.signatures and slope(2) == slope.py_func(2)  # of another type: compiled for it


def test_a_thread_that_compiles_a_caller_leaves_python_its_function(monkeypatch):
    @kernel
    def halved(x):
        return 0.5 * x

    @entry
    def quartered(x):
        return 0.5 * halved(x)

    compile_for_args, threads = CPUDispatcher._compile_for_args, []

    def interrupted(self, *args, **options):
        if self is halved:
            threads.append(threading.Thread(target=quartered, args=(8.0,)))
            threads[0].start()
            threads[0].join(2.0)
        return compile_for_args(self, *args, **options)

    monkeypatch.setattr(CPUDispatcher, "_compile_for_args", interrupted)
    assert halved(8.0) == 4.0
    threads[0].join()
    assert quartered(8.0) == 2.0


def test_a_kernel_may_print_for_whoever_looks_for_a_fault(tmp_path):
    code = (
        "from fowt_env.plant.compile.decorators import entry, kernel\n"
        "@kernel\ndef loud(t):\n    print('at', t)\n    return 2.0 * t\n"
        "@entry\ndef caller(t):\n    return loud(t)\n"
        "print(caller(1.5))\n"
    )
    (tmp_path / "loud.py").write_text(code)  # numba reads the source
    done = subprocess.run(
        [sys.executable, "loud.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.split("\n")[:2] == ["at 1.5", "3.0"], done.stderr


RUN = """
from fowt_env import build_scene, simulate
scene = build_scene(wind=14.0, sea="jonswap:4:9:2", seed=1, duration=5.0)
print(simulate(scene, "pi", duration=5.0).to_numpy().tobytes().hex())
"""


def simulated(root, cache=None):
    """Bits of a short run in a fresh process, by the package in a folder."""
    environment = os.environ | {"PYTHONPATH": str(root)} | ({"FOWT_CACHE_DIR": str(cache)} if cache else {})
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(
        command, env=environment, cwd=root, capture_output=True, text=True, timeout=1800, check=True
    )
    return done.stdout


@pytest.mark.nightly
@pytest.mark.parametrize(
    "changes",
    [
        {
            "linked=LinkedCompiler": "linked=None",
            "linked=SharedCompiler": "linked=None",
            "linked=SeparateCompiler": "linked=None",
        },
        {"_nrt=False": "_nrt=True"},
    ],
    ids=["not linked", "with counted references"],
)
def test_a_scene_compiled_otherwise_has_the_same_bits(changes, tmp_path):
    """Without what this project adds to numba's compiling: the way out of it if a new version breaks it."""
    code = copied_code(tmp_path)
    sources = {path: path.read_text() for path in (code / "fowt_env" / "plant" / "compile").glob("*.py")}
    for old, new in changes.items():
        assert any(old in text for text in sources.values())
        sources = {path: text.replace(old, new) for path, text in sources.items()}
    for path, text in sources.items():
        path.write_text(text)
    assert simulated(code, tmp_path / "cache") == simulated(PACKAGE.parent)
