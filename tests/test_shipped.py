"""Packs of compiled kernels: used with the same bits where they fit, and left alone where they do not."""

import io
import json
import os
import subprocess
import sys
import tarfile

import llvmlite.binding as llvm
import pytest

from fowt_env import shipped
from fowt_env.shipped import MANIFEST, VARIABLES
from fowt_env.warmup import compile_pack

SMALL = """
import sys
from pathlib import Path
import llvmlite.binding as llvm
from fowt_env.loop.sensing import law_index
from fowt_env.plant.hydro.waves import ramp_factor
from fowt_env.shipped import take_kernels
from fowt_env.warmup import write_pack

def run():  # one kernel of the plant, one of another package: their caches have other keys
    print(ramp_factor(1.3, 4.0).hex(), law_index(2, 3))
"""
MAKE = "run(); write_pack(sys.argv[1])"
USE = """
print(take_kernels(Path(sys.argv[1])))
run()
print(*(sum(kernel.twin.stats.cache_hits.values()) for kernel in (ramp_factor, law_index)))
print(take_kernels.__wrapped__(Path(sys.argv[1])))
"""
TAKEN, COMPILED = ["2", "1", "1", "0"], ["0", "0", "0", "0"]


def child(program, pack, cache, **variables):
    """Return the words that a fresh Python prints, with its own folder of compiled kernels."""
    variables = os.environ | {"FOWT_CACHE_DIR": str(cache)} | variables
    done = subprocess.run(
        [sys.executable, "-c", SMALL + program, str(pack)], env=variables, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def used(pack, cache, before="", **variables):
    """Return (what kernels gave, [taken, cache hits of both, taken again]) of a process with a pack."""
    count, value, index, *rest = child(before + USE, pack, cache, **variables)
    return [value, index], [count, *rest]


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    """Return the pack of two small kernels and what they give where it was made."""
    folder = tmp_path_factory.mktemp("pack")
    return folder / "kernels.tar.xz", child(MAKE, folder / "kernels.tar.xz", folder / "made", **VARIABLES)


def test_a_pack_is_used_once_with_the_bits_of_kernels_that_are_compiled_here(packed, tmp_path):
    pack, values = packed
    assert used(pack, tmp_path / "with") == (values, TAKEN)
    assert used(tmp_path / "none.tar.xz", tmp_path / "without") == (values, COMPILED)
    assert used(pack, tmp_path / "with")[1][0] == "0"  # it is there already


@pytest.mark.nightly
def test_a_pack_is_left_alone_on_a_processor_without_its_instructions(packed, tmp_path):
    lesser = "features = llvm.get_host_cpu_features(); features['fma'] = False\n"
    lesser += "llvm.get_host_cpu_features = lambda: features\n"
    assert used(packed[0], tmp_path / "a", lesser) == (packed[1], COMPILED)
    other = {"NUMBA_CPU_NAME": "generic"}  # a user who wants other code
    assert used(packed[0], tmp_path / "b", **other) == (packed[1], COMPILED)


@pytest.mark.parametrize(
    "key",
    ["numba", *(pytest.param(key, marks=pytest.mark.nightly) for key in ("python", "triple")), "sources"],
)
def test_a_pack_of_other_sources_or_versions_is_left_alone(key, packed, tmp_path):
    with tarfile.open(packed[0]) as archive:
        files = {member.name: archive.extractfile(member).read() for member in archive.getmembers()}
    facts = json.loads(files[MANIFEST])
    if key == "sources":
        facts["sources"]["plant/hydro/waves.py"] = "0"
    else:
        facts[key] += "0"
    files[MANIFEST] = json.dumps(facts).encode()
    with tarfile.open(tmp_path / "other.tar.xz", "w:xz") as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    assert used(tmp_path / "other.tar.xz", tmp_path / "cache") == (packed[1], COMPILED)


def test_a_broken_pack_is_no_worse_than_none(packed, tmp_path):
    whole = packed[0].read_bytes()
    (tmp_path / "broken.tar.xz").write_bytes(whole[: len(whole) // 2])
    assert used(tmp_path / "broken.tar.xz", tmp_path / "cache") == (packed[1], COMPILED)


def test_this_processor_is_named_as_llvm_names_it():
    assert set(shipped.INSTRUCTIONS) <= set(llvm.get_host_cpu_features())


@pytest.mark.nightly
def test_with_the_pack_of_a_wheel_the_readme_s_runs_compile_nothing(tmp_path):
    pack = compile_pack(tmp_path / "kernels")
    assert pack.stat().st_size < 8e6
    program = f"""
from pathlib import Path
import fowt_env, gymnasium
from fowt_env import shipped
from fowt_env.plant.compile.notice import compilation_reported
assert shipped.take_kernels(Path({str(pack)!r})) > 20
said = []
with compilation_reported(said.append):
    scene = fowt_env.build_scene(wind="ntm:18:B", sea="jonswap:7.5:10:3.3")
    fowt_env.simulate(scene, "pi", duration=1.0)
    for settings in ({{}}, {{"action_mode": "residual"}}):
        env = gymnasium.make("fowt_env/OC3Hywind-v2", task="above_rated", **settings)
        env.reset(seed=1)
        env.step(env.action_space.sample())
print(said)
"""
    variables = os.environ | {"FOWT_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run([sys.executable, "-c", program], env=variables, capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr
