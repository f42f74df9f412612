"""Compares short runs with and without the compiler, which must agree to rounding.

Run as a program (arguments IN OUT, environment NUMBA_DISABLE_JIT=1), the module runs the jobs of a pickle.
"""

import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

import numba
import numpy as np

import fowt_env
from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.errors import InputError
from fowt_env.plant.advance import advance, output_row
from fowt_env.plant.integrators import INTEGRATORS, build_integrator
from fowt_env.plant.state import State
from fowt_env.scene.build import build_scene

STEPS_PER_SCENE = 5
ENV_STEPS = 3
SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}
ENV = {"rotor": "bem", "wind": 18.0, "wave_components": 8}
SCENES = {
    "look-up rotor, fast waves": dict(wind=18.0, sea=SEA, fidelity="standard", wave_components=12),
    "BEM rotor, exact waves": dict(wind=18.0, sea=SEA, wave_components=12),
    "table rotor": dict(wind=18.0, sea=SEA, fidelity="fast", wave_components=12),
    "skewed wake, dynamic inflow, current": dict(
        wind={"kind": "steady", "speed": 14.0, "direction": 20.0}, sea=SEA, skewed_wake=True,
        dynamic_inflow=True, current=0.5, wave_components=12,
    ),
    "no wind": dict(sea=SEA, wave_components=12),
    "still water": dict(),
    "no mooring": dict(wind=18.0, mooring=False),
    "empty space": dict(hydrodynamics=False, mooring=False),
}  # fmt: skip


def start(scene):
    """Return a state with large motions."""
    x = np.zeros(scene.n_state)
    x[:6] = 4.0, -3.0, 0.5, 0.05, 0.08, -0.1
    x[7:13] = 0.5, -0.3, 0.2, 0.01, 0.02, -0.02
    x[State.AZIMUTH], x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = 0.7, 1.2, 0.2
    x[State.INTERNAL :] = 1.0
    return x


def jobs(scenes=SCENES, environments=True):
    """Return jobs {name: (None or (environment, mode), scene or snapshot)}.

    Scenes and snapshots are made with the compiler: trims and tables would take long without it.
    """
    runs = {}
    for name, options in scenes.items():
        scene = build_scene(**{"fidelity": "reference"} | options)
        for integrator in INTEGRATORS:
            made = scene.with_model(integrator=build_integrator(integrator))
            runs[f"{name}, {integrator}"] = (None, made)
    for mode in ("direct", "residual") if environments else ():
        for name in ("environment", "vector environment"):
            env = environment(name, mode)
            env.reset(seed=5)
            runs[f"{name}, {mode}"] = ((name, mode), env.get_state())
    return runs


def environment(name, mode):
    """Return an environment, or a vector environment of two, with an action mode."""
    options = ENV | {"action_mode": mode}
    return FowtEnv(**options) if name == "environment" else FowtVectorEnv(2, threads=1, **options)


def result(job):
    """Run a job and return its results as an array (n,)."""
    kind, begin = job
    if kind is None:
        x, handle, u = start(begin), begin.handle(), np.array([4.0e4, 0.25])
        status = advance(handle, x, u, 100, STEPS_PER_SCENE, 0.05)
        row = output_row(begin.handle(), x, u, 5.0 + STEPS_PER_SCENE * 0.05, len(begin.channels))
        return np.r_[status, x, row]
    env, rng, values = environment(*kind), np.random.default_rng(3), []
    env.set_state(begin)
    for _ in range(ENV_STEPS):
        action = rng.uniform(-1.0, 1.0, env.action_space.shape)
        values += [np.ravel(part).astype(float) for part in env.step(action)[:3]]
    return np.concatenate(values)


def differences(given=None):
    """Return {job: largest |a - b| / max(1, |a|)} of compiled (a) and plain runs. Raises: InputError."""
    given = jobs() if given is None else given
    with tempfile.TemporaryDirectory() as folder:
        ask, answer = Path(folder) / "ask.pickle", Path(folder) / "answer.npz"
        ask.write_bytes(pickle.dumps(given))
        root = Path(fowt_env.__file__).resolve().parents[1]
        path = os.pathsep.join(filter(None, (str(root), os.environ.get("PYTHONPATH"))))
        done = subprocess.run(
            [sys.executable, "-m", __name__, str(ask), str(answer)],
            env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path}, cwd=root,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            raise InputError(f"run without the compiler failed: {done.stderr[-800:]}")
        with np.load(answer) as stored:
            plain = dict(stored)
    compiled = {name: result(job) for name, job in given.items()}
    return {
        name: float(np.max(np.abs(a - plain[name]) / np.maximum(1.0, np.abs(a))))
        for name, a in compiled.items()
    }


def main():
    """Run the jobs of a pickle and store their results."""
    if not numba.config.DISABLE_JIT:
        raise SystemExit("the environment variable NUMBA_DISABLE_JIT=1 must be set")
    todo = pickle.loads(Path(sys.argv[1]).read_bytes())
    np.savez(sys.argv[2], **{name: result(job) for name, job in todo.items()})


if __name__ == "__main__":
    main()
