"""Largest stable step of each integrator and kind of scene: measured on the plant, and as theory has it.

Theory is the amplification matrix of the very scheme of fowt_env/plant/integrators.py applied to the linear
model of the scene: blade pitch exact and, for the Adams methods, positions by Adams-Moulton from the new
velocities.
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
from fowt_env.training.studies.robustness.random_cases import with_integrator

DURATION = 300.0  # s of each run: hundreds of steps even at the largest
FINE_STEP = 0.0125  # s, of the run that others are judged by
GROWTH = 2.0  # a run has blown up where a state's later peak is more than this times the fine run's
LARGEST_STEP = 3.0  # s; the search ends here
SCAN = 1.15  # ratio of one step to the next until the first blow-up
RESOLUTION = 0.01  # relative, of the bisection after it
MARGIN = 2.0  # that the default step must keep
# moved from the operating point, so that every mode is excited; SI and radians, order of linear_model.STATES
EXCITATION = np.array([1.0, 1.0, 0.3, 0.01, 0.01, 0.03, 0.05, 0.05, 0.05, 1e-3, 1e-3, 1e-3, 0.02, 2e-3])
# what counts as motion at all beside the fine run's peak, in the same order
FLOOR = np.array([0.1, 0.1, 0.1, 2e-3, 2e-3, 2e-3, 0.02, 0.02, 0.02, 5e-4, 5e-4, 5e-4, 5e-3, 5e-4])
BASHFORTH = np.array([55.0, -59.0, 37.0, -9.0]) / 24.0  # of the derivatives, latest first
MOULTON = np.array([9.0, 19.0, -5.0, 1.0]) / 24.0  # of the new derivative and the latest three
N = len(STATES)
PITCH = STATES.index("blade_pitch")
SEA = {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}
STORM = {"kind": "jonswap", "Hs": 15.0, "Tp": 16.0}


@dataclass(frozen=True)
class LimitScene:
    """A kind of scene of the map: arguments of build_scene, and what is fixed."""

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
        fixed = {"platform_fixed": self.platform_fixed, "rotor_fixed": self.rotor_fixed}
        return scene.with_model({f"rigid_body.{name}": value for name, value in fixed.items()})

    def point(self, scene):
        """Return the OperatingPoint about which runs start and theory is linear.

        Without moorings nothing balances the thrust: then the upright platform, which drifts from there.
        """
        if not self.platform_fixed and self.options.get("mooring", True):
            return trim(scene)
        fixed = trim(scene, platform="fixed")
        if self.platform_fixed:
            return fixed
        return OperatingPoint(dict(fixed), fixed.state, fixed.command, fixed.wind_speed, platform="floating")


LIMIT_SCENES = {
    "full, look-up rotor": LimitScene(),
    "full, rotor sampled thrice a step": LimitScene(rotor_samples=3),  # as in a box of wind
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


def exact_pitch(a, h):
    """Return the factor by which the blade pitch decays in a step h."""
    return exp(a[PITCH, PITCH] * h)


def with_pitch(matrix, factor):
    """Return the matrix (N, N) with this factor as its row of the blade pitch."""
    matrix[PITCH] = 0.0
    matrix[PITCH, PITCH] = factor
    return matrix


def runge_kutta(a, h):
    """Return the (N, N) matrix of a Runge-Kutta 4 step of x' = a x, blade pitch exact at every stage."""
    half, whole = exact_pitch(a, 0.5 * h), exact_pitch(a, h)
    k1 = a
    k2 = a @ with_pitch(np.eye(N) + 0.5 * h * k1, half)
    k3 = a @ with_pitch(np.eye(N) + 0.5 * h * k2, half)
    k4 = a @ with_pitch(np.eye(N) + h * k3, whole)
    return with_pitch(np.eye(N) + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), whole)


def trapezoid(a, h):
    """Return the (N, N) matrix of one step of heun: explicit trapezoidal rule, blade pitch exact."""
    pitch = exact_pitch(a, h)
    predicted = with_pitch(np.eye(N) + h * a, pitch)
    return with_pitch(np.eye(N) + 0.5 * h * (a + a @ predicted), pitch)


def adams(a, h, corrector):
    """Return the (4 N, 4 N) matrix of one Adams step of the state and its three latest derivatives.

    The present derivative is a x; carried are x and the derivatives one, two and three steps ago.
    """
    now = np.zeros((N, 4 * N))
    now[:, :N] = np.eye(N)
    past = [a @ now, *(np.roll(now, k * N, axis=1) for k in range(1, 4))]
    pitch = np.zeros(4 * N)
    pitch[PITCH] = exact_pitch(a, h)
    moved = now + h * sum(c * f for c, f in zip(BASHFORTH, past, strict=True))
    moved[PITCH] = pitch
    if corrector:
        new = a @ moved
        speeds = now + h * (MOULTON[0] * new + sum(c * f for c, f in zip(MOULTON[1:], past[:3], strict=True)))
        moved[len(MOTIONS) :] = speeds[len(MOTIONS) :]
        moved[PITCH] = pitch
    new = a @ moved
    places = now + h * (MOULTON[0] * new + sum(c * f for c, f in zip(MOULTON[1:], past[:3], strict=True)))
    moved[: len(MOTIONS)] = places[: len(MOTIONS)]
    return np.vstack([moved, *past[:3]])


def amplification(a, h, integrator):
    """Return the matrix of one step h of an integrator on x' = a x, a (N, N) of linear_model.STATES."""
    if integrator == "rk4":
        return runge_kutta(a, h)
    if integrator == "heun":
        return trapezoid(a, h)
    return adams(a, h, integrator == "abm4")


def stable(a, h, integrator, duration=DURATION):
    """Return whether errors grow no more than GROWTH times as much as the plant itself over the duration."""
    radius = np.abs(np.linalg.eigvals(amplification(a, h, integrator))).max()
    own = max(0.0, np.linalg.eigvals(a).real.max())
    return duration / h * log(radius) <= own * duration + log(GROWTH)


def limiting_state(a, h, integrator):
    """Return the name of the state that participates most, in EXCITATION, in the fastest-growing vector."""
    values, vectors = np.linalg.eig(amplification(a, h, integrator))
    participation = np.abs(vectors[:N, np.argmax(np.abs(values))]) / EXCITATION
    return STATES[int(np.argmax(participation))]


def first_unstable(holds, start):
    """Return the largest step (s) below the first that does not hold: scan by SCAN, then bisection.

    inf: all hold; 0.0: the start itself does not.
    """
    low, high = 0.0, start
    while holds(high):
        low, high = high, high * SCAN
        if high > LARGEST_STEP:
            return float("inf")
    if low == 0.0:
        return 0.0
    while high / low > 1.0 + RESOLUTION:
        middle = (low * high) ** 0.5
        if holds(middle):
            low = middle
        else:
            high = middle
    return low


def excursions(scene, point, dt, duration=DURATION):
    """Return (peaks over the run, peaks over its second half): largest |state - operating point|, (N,).

    The run starts off the operating point by EXCITATION and keeps its command. inf once it has stopped.
    """
    x, u = point.state.copy(), point.command.copy()
    rows = np.array(STATE_INDEX)
    moved = EXCITATION.copy()
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
    peaks, late = np.zeros(N), np.zeros(N)
    steps = round(duration / dt)
    for i in range(steps):
        if advance(handle, x, u, i, 1, dt) != RUNNING:
            return np.full(N, np.inf), np.full(N, np.inf)
        np.maximum(peaks, np.abs(x[rows] - centre), out=peaks)
        if i == steps // 2:
            late = np.abs(x[rows] - centre)
        elif i > steps // 2:
            np.maximum(late, np.abs(x[rows] - centre), out=late)
    return peaks, late


def stays(scene, point, fine, dt, duration=DURATION):
    """Return whether a run with steps dt does not blow up; fine: peaks of the fine run."""
    return bool(np.all(excursions(scene, point, dt, duration)[1] <= GROWTH * (fine + FLOOR)))


def stability_map(kinds=None, integrators=INTEGRATORS, duration=DURATION, progress=None):
    """Return a DataFrame with a row per kind of scene and integrator.

    Columns: kind, integrator, default_s, measured_s, theory_s (largest steps; inf above LARGEST_STEP),
    margin (measured over default), mode (state that grows first), fastest_1_per_s (largest eigenvalue
    of the plant but for the blade-pitch actuator).
    """
    names = list(kinds or LIMIT_SCENES)
    rows = []
    for done, name in enumerate(names):
        if progress is not None:
            progress(f"stability map: {name}", done, len(names))
        kind = LIMIT_SCENES[name]
        base = kind.scene()
        point = kind.point(base)
        model = linearize(base, point)
        fine, _ = excursions(base, point, FINE_STEP, duration)
        others = [i for i in range(N) if i != PITCH]
        fastest = np.abs(np.linalg.eigvals(model.A[np.ix_(others, others)])).max()
        for integrator in integrators:
            if kind.rotor_samples > 1 and integrator != "ab4":
                continue
            scene = with_integrator(base, integrator, kind.rotor_samples)
            default = INTEGRATORS[integrator].dt
            found = first_unstable(partial(stays, scene, point, fine, duration=duration), default)
            scheme = "abm4" if integrator == "ab4" and feathering(point.state, base.model) else integrator
            theory = first_unstable(partial(stable, model.A, integrator=scheme, duration=duration), default)
            mode = limiting_state(model.A, theory * SCAN, scheme) if theory < np.inf else ""
            rows.append({
                "kind": name, "integrator": integrator, "default_s": default, "measured_s": found,
                "theory_s": theory, "margin": found / default, "mode": mode, "fastest_1_per_s": fastest,
            })  # fmt: skip
    return pd.DataFrame(rows)
