"""Computes the first-order wave force on a hull over frequency, and fits a causal state-space model.

The strip force is not a causal function of the elevation at the hull, because the force at depth depends on
earlier and later elevations. The input of the state-space model is therefore the elevation some seconds ahead
(the lead). The elevation is taken at the hull's mean position (for a potential-flow body at the undisplaced
position), because no low-order model fits the dispersion from the origin.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.linalg import block_diag

from fowt_env.analysis.statics import rotation_of
from fowt_env.descriptions.sea_state import SeaState, sea_state_of
from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.hydro.member_series import N_WATER, motion_amplitudes
from fowt_env.plant.hydro.members import AREA, AX, AXIAL_ADDED, FROUDE
from fowt_env.plant.hydro.morison import morison_load
from fowt_env.plant.state import State, pose_of
from fowt_env.weather.excitation import OUT_OF_PLANE, excitation_at
from fowt_env.weather.waves import build_waves

BAND = (0.15, 2.0)  # rad/s, of the fit: periods of 3.1 to 42 s
GRID = 150  # frequencies of the fit
AMPLITUDE = 1e-3  # m; the force without drag is an odd function of amplitude: first order to 1e-6
PAIRS = 8  # pairs of poles: 16 states
POLE_DAMPING = 0.5  # so that neighbouring poles overlap
LEADS = np.arange(0.0, 12.01, 0.5)  # s, candidates
# for a potential-flow body, where waves interfere between columns
BODY_PAIRS, BODY_POLE_DAMPING, BODY_LEADS = 24, 0.25, np.arange(0.0, 18.01, 0.5)
NOISE = 1e-6  # of the largest force or moment: numerical noise of a symmetric body's other components
WEIGHT_FLOOR = 0.1  # fraction of a component's largest force below which errors count as absolute
BANDS = ((0.2, 0.4), (0.4, 0.8), (0.8, 1.2), (1.2, 1.8))  # rad/s, for the report of the fit


@entry
def _strip_force(strips, waves, x, t, kinematics, out):
    """Fill out (6,) with the strip wrench at a state."""
    load = morison_load(t, pose_of(x), strips, waves, None, kinematics).wrench
    out[0], out[1], out[2] = load.fx, load.fy, load.fz
    out[3], out[4], out[5] = load.mx, load.my, load.mz


def wave_force(scene, state, omega):
    """Return the complex wave force (n, 6) per elevation at the hull, N/m and N m/m, body axes and origin.

    Force and elevation are the real parts of these amplitudes times exp(i omega t), for waves travelling
    along x past the hull at rest in `state`. The force of strips is the scene's strip load in a small regular
    wave, without quadratic drag; members use that load at the undisplaced nodes, and a potential-flow body
    the excitation table, interpolated as in the plant. omega: (n,) rad/s. Zero without hydrodynamics.
    """
    omega = np.atleast_1d(np.asarray(omega, dtype=float))
    result = np.zeros((omega.size, 6), dtype=complex)
    hydro, body = scene.model.hydro, scene.platform.potential_flow
    if hydro is None:
        return result
    if hydro.strips is not None:
        result += _strip_forces(scene, state, omega, hydro.strips.shape)
    if hydro.members is not None and hydro.members.inertial:
        result += _member_forces(scene, state, omega, hydro.members)
    if body is not None:
        force = excitation_at(body, omega, 0.0)
        if scene.options["planar"]:
            force[:, OUT_OF_PLANE] = 0.0
        rotation = rotation_of(pose_of(state))
        result[:, :3] += force[:, :3] @ rotation
        result[:, 3:] += force[:, 3:] @ rotation
    return result


def _waves(scene, sea):
    """Return the Waves of a regular sea or of components at the site of a scene."""
    site = scene.platform.environment
    water = {"depth": site.water_depth, "density": site.water_density, "gravity": site.gravity}
    return build_waves(sea, **water, seed=0, duration=1.0)


def _strip_forces(scene, state, omega, strips):
    """Return the complex force (n, 6) of the strips."""
    result = np.zeros((omega.size, 6), dtype=complex)
    strips = strips._replace(drag_coefficient=0.0, axial_drag_coefficient=0.0)
    x = np.zeros_like(state)
    x[: State.AZIMUTH] = state[: State.AZIMUTH]
    x[State.SURGE] = x[State.SWAY] = 0.0  # the wave phase is relative to the hull
    kinematics, quarters = np.zeros((7, strips.nodes)), np.zeros((4, 6))
    for i, frequency in enumerate(omega):
        sea = sea_state_of({"kind": "regular", "H": 2.0 * AMPLITUDE, "T": 2.0 * pi / frequency})
        waves = _waves(scene, sea)._replace(ramp=0.0)
        for quarter in range(4):
            t = quarter * 0.5 * pi / frequency
            _strip_force(strips, waves, x, t, kinematics, quarters[quarter])
        change = (quarters[0] - quarters[2]) - 1j * (quarters[1] - quarters[3])
        result[i] = change / (2.0 * AMPLITUDE)
    return result


def _member_forces(scene, state, omega, members):
    """Return the complex force (n, 6) of the members' fluid inertia and pressure."""
    nodes, rotation = members.nodes, rotation_of(pose_of(state))
    still = np.zeros(omega.size)
    sea = SeaState(kind="components", omega=omega, amplitude=still + 1.0, phase=still, heading=still)
    waves = _waves(scene, sea)
    position = nodes[:, :3]
    if members.instantaneous_position:
        position = position @ rotation.T + [0.0, 0.0, state[State.HEAVE]]
    # amplitudes A of Re(A exp(-i omega t)), from the longest wave to the shortest
    motion = motion_amplitudes(waves, position, N_WATER).conj().reshape(len(nodes), N_WATER, -1)
    acceleration = np.einsum("ji,njk->nik", rotation, motion[:, 3:6])
    axis = nodes[:, AX : AX + 3]
    along = np.einsum("ni,nik->nk", axis, acceleration)
    push = nodes[:, AXIAL_ADDED, None] * along + nodes[:, AREA, None] * motion[:, 6]
    force = nodes[:, FROUDE, None, None] * (acceleration - axis[:, :, None] * along[:, None])
    force += axis[:, :, None] * push[:, None]
    moment = np.cross(nodes[:, :3, None], force, axis=1)
    result = np.zeros((omega.size, 6), dtype=complex)
    result[np.argsort(omega, kind="stable")] = np.concatenate([force.sum(axis=0), moment.sum(axis=0)]).T
    return result


@dataclass(frozen=True)
class WaveFilter:
    """Defines a state-space model of the wave force: dz/dt = A z + B eta(t + lead), force = C z.

    A (m, m), B (m,), C (6, m); lead in s; errors {(low, high) rad/s: largest relative error of the force
    vector in that band, with each component scaled by its maximum}.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    lead: float
    errors: dict

    def response(self, omega):
        """Return the complex force (n, 6) per elevation at the hull, with the lead removed."""
        omega = np.atleast_1d(np.asarray(omega, dtype=float))
        eye = np.eye(self.A.shape[0])
        filtered = np.array([np.linalg.solve(1j * w * eye - self.A, self.B) for w in omega])
        return filtered @ self.C.T * np.exp(1j * omega * self.lead)[:, None]


def fit_wave_filter(scene, state):
    """Return the WaveFilter fitted to wave_force over BAND, with the lead that fits best.

    Poles are fixed and evenly spread over the band, so the fit is linear least squares and the model stable:
    PAIRS pole pairs for strips, BODY_PAIRS for a potential-flow body.
    """
    omega = np.linspace(*BAND, GRID)
    force = wave_force(scene, state, omega)
    for kind in (slice(0, 3), slice(3, 6)):
        size = np.abs(force[:, kind]).max(axis=0)
        force[:, kind] *= size > NOISE * size.max()
    pairs, damping, leads = PAIRS, POLE_DAMPING, LEADS
    if scene.platform.potential_flow is not None:
        pairs, damping, leads = BODY_PAIRS, BODY_POLE_DAMPING, BODY_LEADS
    a, b = _resonators(np.linspace(BAND[0], 1.15 * BAND[1], pairs), damping)
    eye = np.eye(a.shape[0])
    basis = np.array([np.linalg.solve(1j * w * eye - a, b) for w in omega])
    size = np.abs(force)
    weight = 1.0 / (size + WEIGHT_FLOOR * size.max(axis=0) + (size.max(axis=0) == 0.0))
    best = None
    for lead in leads:
        target = force * np.exp(-1j * omega * lead)[:, None]
        c = np.zeros((6, b.size))
        for row, w in enumerate(weight.T):
            left, right = basis * w[:, None], target[:, row] * w
            both = (np.r_[left.real, left.imag], np.r_[right.real, right.imag])
            c[row] = np.linalg.lstsq(*both, rcond=1e-10)[0]
        miss = np.linalg.norm((basis @ c.T - target) * weight)
        if best is None or miss < best[0]:
            best = (miss, float(lead), c)
    model = WaveFilter(a, b, best[2], best[1], {})
    model.errors.update(_band_errors(omega, force, model.response(omega)))
    return model


def _resonators(frequencies, damping):
    """Return (A, B) of parallel second-order resonators."""
    a = block_diag(*([[0.0, w], [-w, -2.0 * damping * w]] for w in frequencies))
    return a, np.kron(frequencies, [0.0, 1.0])


def _band_errors(omega, force, fitted):
    """Return {band: largest relative error of the force vector}, each component scaled by its maximum."""
    scale = np.abs(force).max(axis=0)
    used = scale > 1e-9 * scale.max()
    if not used.any():
        return dict.fromkeys(BANDS, 0.0)
    force, fitted = force[:, used] / scale[used], fitted[:, used] / scale[used]
    error = np.linalg.norm(fitted - force, axis=1) / np.linalg.norm(force, axis=1)
    return {band: float(error[(omega >= band[0]) & (omega <= band[1])].max()) for band in BANDS}
