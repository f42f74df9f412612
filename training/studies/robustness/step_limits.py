"""Computes the largest stable step of each integrator and kind of scene, by simulation and linear theory.

Theory uses the amplification matrix of the schemes of fowt_env/plant/integrators.py on the linear model:
exact blade pitch and, for the Adams methods, positions by Adams-Moulton from the new velocities.
"""

from dataclasses import dataclass, field
from functools import partial
from math import exp, log

import numpy as np
import pandas as pd

from fowt_env.analysis.linear_model import MOTIONS, linearize
from fowt_env.analysis.trim import OperatingPoint, trim
from fowt_env.plant.advance import RUNNING, advance, forget
from fowt_env.plant.integrators import INTEGRATORS, feathering
from fowt_env.plant.state import STATE_INDEX, STATES, State
from fowt_env.scene.build import build_scene
from fowt_env.training.benchmarks.speed import silent
from fowt_env.training.studies.robustness.random_cases import with_integrator

DURATION = 300.0  # s of each run, a hundred of the largest steps
FINE_STEP = 0.0125  # s, step of the reference run
GROWTH = 2.0  # a run is unstable if a later peak exceeds that of the fine run by this factor
LARGEST_STEP = 3.0  # s; the search ends here
SCAN = 1.15  # ratio of successive steps of the scan
RESOLUTION = 0.01  # relative, of the bisection
MARGIN = 2.0  # required ratio of largest stable to default step
# initial displacement that excites every mode; SI and radians, order of linear_model.STATES
EXCITATION = np.array([1.0, 1.0, 0.3, 0.01, 0.01, 0.03, 0.05, 0.05, 0.05, 1e-3, 1e-3, 1e-3, 0.02, 2e-3])
# added to the peak of the fine run as the smallest relevant motion, in the same order
FLOOR = np.array([0.1, 0.1, 0.1, 2e-3, 2e-3, 2e-3, 0.02, 0.02, 0.02, 5e-4, 5e-4, 5e-4, 5e-3, 5e-4])
BASHFORTH = np.array([55.0, -59.0, 37.0, -9.0]) / 24.0  # of the derivatives, latest first
MOULTON = np.array([9.0, 19.0, -5.0, 1.0]) / 24.0  # of the new derivative and the latest three
N = len(STATES)
PITCH = STATES.index("blade_pitch")
SEA = {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}
STORM = {"kind": "jonswap", "Hs": 15.0, "Tp": 16.0}


@dataclass(frozen=True)
class LimitScene:
    """Describes a kind of scene: arguments of build_scene, and whether platform and rotor are fixed."""

    wind: object = 18.0
    sea: object = field(default_factory=lambda: dict(SEA))
    fidelity: str = "standard"
    options: dict = field(default_factory=dict)
    platform_fixed: bool = False
    rotor_fixed: bool = False
    rotor_samples: int = 1  # of ab4

    def scene(self, integrator="rk4"):
        """Return a scene of this kind with one of INTEGRATORS."""
        options = {"fidelity": self.fidelity, "integrator": integrator, **self.options}
        scene = build_scene(wind=self.wind, sea=self.sea, seed=1, **options)
        fixed = {name: getattr(self, name) for name in ("platform_fixed", "rotor_fixed")}
        return scene.with_model({f"rigid_body.{name}": value for name, value in fixed.items()})

    def point(self, scene):
        """Return the OperatingPoint of the start of runs and of the linear model.

        Without moorings nothing balances the thrust: the upright platform is used, which drifts.
        """
        if not self.platform_fixed and self.options.get("mooring", True):
            return trim(scene)
        fixed = trim(scene, platform="fixed")
        if self.platform_fixed:
            return fixed
        return OperatingPoint(dict(fixed), fixed.state, fixed.command, fixed.wind_speed, platform="floating")


LIMIT_SCENES = {
    "full, look-up rotor": LimitScene(),
    "full, rotor sampled thrice a step": LimitScene(rotor_samples=3),  # as in a turbulence box
    "full, BEM rotor": LimitScene(fidelity="reference", options={"wave_components": 40}),
    "full, table rotor": LimitScene(fidelity="fast"),
    "full, rated wind": LimitScene(wind=11.4),
    "full, cut-out wind": LimitScene(wind=25.0),
    "no wind, waves": LimitScene(wind=None),
    "still water, wind": LimitScene(sea=None),
    "parked, 50 m/s, Hs 15 m": LimitScene(wind=50.0, sea=STORM, rotor_fixed=True),
    "idling feathered, 26 m/s": LimitScene(wind=26.0),
    "idling feathered, 50 m/s, Hs 15 m": LimitScene(wind=50.0, sea=STORM),
    "idling feathered, 70 m/s, Hs 15 m": LimitScene(wind=70.0, sea=STORM),
    "no mooring": LimitScene(options={"mooring": False}),
    "platform fixed": LimitScene(platform_fixed=True),
}


def amplification(a, h, integrator):
    """Return the amplification matrix of a step h of an integrator for x' = a x; a (N, N), order of STATES.

    (N, N), or for the Adams methods (4 N, 4 N): x and the derivatives one, two and three steps ago.
    """
    one = np.eye(N)

    def moved(by, fraction=1.0):  # blade pitch exact
        matrix = one + by
        matrix[PITCH] = one[PITCH] * exp(a[PITCH, PITCH] * h * fraction)
        return matrix

    if integrator == "heun":
        return moved(0.5 * h * (a + a @ moved(h * a)))
    if integrator == "rk4":
        k2 = a @ moved(0.5 * h * a, 0.5)
        k3 = a @ moved(0.5 * h * k2, 0.5)
        k4 = a @ moved(h * k3)
        return moved(h / 6.0 * (a + 2.0 * k2 + 2.0 * k3 + k4))
    one = np.eye(N, 4 * N)
    past = [a @ one, *(np.roll(one, k * N, axis=1) for k in range(1, 4))]

    def corrected(new):
        return moved(h * (MOULTON[0] * new + sum(c * f for c, f in zip(MOULTON[1:], past[:3], strict=True))))

    after = moved(h * sum(c * f for c, f in zip(BASHFORTH, past, strict=True)))
    if integrator == "abm4":
        after[len(MOTIONS) :] = corrected(a @ after)[len(MOTIONS) :]
    after[: len(MOTIONS)] = corrected(a @ after)[: len(MOTIONS)]
    return np.vstack([after, *past[:3]])


def stable(a, h, integrator, duration=DURATION):
    """Return whether errors grow at most GROWTH times as much as the linear model over the duration."""
    radius = np.abs(np.linalg.eigvals(amplification(a, h, integrator))).max()
    growth = max(0.0, np.linalg.eigvals(a).real.max())
    return duration / h * log(radius) <= growth * duration + log(GROWTH)


def first_unstable(holds, start):
    """Return the largest step (s) below the first for which holds(step) is false: scan, then bisection.

    inf: true for all steps; 0.0: false at start.
    """
    low, high = 0.0, start
    while holds(high):
        low, high = high, high * SCAN
        if high > LARGEST_STEP:
            return float("inf")
    while low > 0.0 and high / low > 1.0 + RESOLUTION:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def excursions(scene, point, dt, duration=DURATION):
    """Return (peaks over the run, peaks over its second half): largest |state - operating point|, (N,).

    The run starts at the operating point plus EXCITATION with constant command. inf if the run stops.
    """
    x, u, rows, moved = point.state.copy(), point.command.copy(), np.array(STATE_INDEX), EXCITATION.copy()
    if scene.model.rigid_body.platform_fixed:
        moved[: 2 * len(MOTIONS)] = 0.0
    if scene.model.rigid_body.rotor_fixed:
        moved[STATES.index("rotor_speed")] = 0.0
    centre = x[rows].copy()
    x[rows] += moved
    if x[State.BLADE_PITCH] > scene.turbine.pitch_drive.maximum:
        x[State.BLADE_PITCH] -= 2.0 * EXCITATION[PITCH]
    handle = scene.handle()
    forget(handle)
    peaks, steps = np.zeros((2, N)), round(duration / dt)
    for i in range(steps):
        if advance(handle, x, u, i, 1, dt) != RUNNING:
            return np.full((2, N), np.inf)
        part = peaks[: 2 if i >= steps // 2 else 1]
        np.maximum(part, np.abs(x[rows] - centre), out=part)
    return peaks


def stays(scene, point, fine, dt, duration=DURATION):
    """Return whether a run with step dt is stable; fine: peaks of the fine run."""
    return bool(np.all(excursions(scene, point, dt, duration)[1] <= GROWTH * (fine + FLOOR)))


def stability_map(kinds=None, duration=DURATION, progress=silent):
    """Return a DataFrame with a row per kind of scene and integrator.

    default_s, measured_s, theory_s: steps, inf above LARGEST_STEP; margin: measured over default; mode: first
    unstable state; fastest_1_per_s: largest eigenvalue without the blade-pitch actuator.
    """
    names, rows = list(kinds or LIMIT_SCENES), []
    for done, name in enumerate(names):
        progress(f"stability map: {name}", done, len(names))
        kind = LIMIT_SCENES[name]
        base = kind.scene()
        point = kind.point(base)
        a = linearize(base, point).A
        fine, _ = excursions(base, point, FINE_STEP, duration)
        others = [i for i in range(N) if i != PITCH]
        fastest = np.abs(np.linalg.eigvals(a[np.ix_(others, others)])).max()
        for integrator in INTEGRATORS if kind.rotor_samples == 1 else ("ab4",):
            scene = with_integrator(base, integrator, kind.rotor_samples)
            default = INTEGRATORS[integrator].dt
            measured = first_unstable(partial(stays, scene, point, fine, duration=duration), default)
            scheme = "abm4" if integrator == "ab4" and feathering(point.state, base.model) else integrator
            theory = first_unstable(partial(stable, a, integrator=scheme, duration=duration), default)
            mode = ""
            if theory < np.inf:  # largest component, relative to EXCITATION, of the most unstable mode
                values, vectors = np.linalg.eig(amplification(a, theory * SCAN, scheme))
                mode = STATES[np.argmax(np.abs(vectors[:N, np.abs(values).argmax()]) / EXCITATION)]
            rows.append({
                "kind": name, "integrator": integrator, "default_s": default, "measured_s": measured,
                "theory_s": theory, "margin": measured / default, "mode": mode, "fastest_1_per_s": fastest,
            })  # fmt: skip
    return pd.DataFrame(rows)
