"""Compares semi-submersible and barge with the frequency domain: natural periods, responses to small waves.

Simulations have a sea of a few small components and no quadratic drag; motions are fitted by frequency.
"""

import tomllib
from functools import partial

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

from fowt_env.analysis.trim import trim
from fowt_env.descriptions.files import DATA
from fowt_env.descriptions.units import DEGREE
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.training.validation import frequency_domain
from fowt_env.training.validation.comparison import TIME, Channel, name_and_unit, phase

BODIES = {
    "nrel5mw_iti_barge": frequency_domain.iti_barge,
    "nrel5mw_oc4_semi": frequency_domain.oc4_semi,
}
OMEGA = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3, 1.5])  # rad/s
AMPLITUDE = 0.02  # m, of each component
RAMP, BEGIN, END = 100.0, 200.0, 900.0  # s, of the waves; of the fitted interval
STEP = 0.05  # s
CHANNELS = {Channel.SURGE: 0, Channel.HEAVE: 2, Channel.PITCH: 4}
DECAYING = (  # coupled motions: their channels
    {"surge": Channel.SURGE, "heave": Channel.HEAVE, "pitch": Channel.PITCH},
    {"sway": "PtfmSway_[m]", "roll": "PtfmRoll_[deg]", "yaw": "PtfmYaw_[deg]"},
)
OFFSET = 0.1  # m and deg from equilibrium, start of all six motions
SETTLING, DECAY = 5.0, 400.0  # s
SMALL = 0.02  # of the largest response: errors of smaller ones are relative to this fraction of it


def body_of(name):
    """Return the FloatingBody of a built-in platform, with the coefficients named in the platform file."""
    path = DATA / "platforms" / f"{name}.toml"
    table = tomllib.loads(path.read_text())["potential_flow"]
    return BODIES[name](frequency_domain.read_arrays(path.parent / table["coefficients"]))


def without_drag(scene):
    """Return the scene without the quadratic drag of matrices and members."""
    hydro, parts = scene.model.hydro, {}
    if hydro.matrices is not None:
        zero = np.zeros_like(hydro.matrices.quadratic_damping)
        parts["hydro.matrices"] = hydro.matrices._replace(quadratic_damping=zero)
    if getattr(hydro, "members", None) is not None:
        parts["hydro.members"] = None
    return scene.with_model(parts)


def _decaying(time, rates):
    """Return a list of series: ones, then cosine and sine of the decaying modes of complex rates (1/s)."""
    columns = [np.ones_like(time)]
    for rate in rates:
        envelope = np.exp(-rate.real * (time - time[0]))
        columns += [envelope * np.cos(rate.imag * time), envelope * np.sin(rate.imag * time)]
    return columns


def fitted(time, value, omega, slow):
    """Return complex amplitudes (n,) of value ~ Re(sum c exp(i omega t)) plus modes of rates slow."""
    waves = [wave for w in omega for wave in (np.cos(w * time), -np.sin(w * time))]
    one, *modes = _decaying(time, slow)
    solution = np.linalg.lstsq(np.column_stack([one, *waves, *modes]), value, rcond=None)[0]
    return solution[1 : 2 * len(omega) : 2] + 1j * solution[2 : 2 * len(omega) + 1 : 2]


def sea(omega):
    """Return the sea specification of the small components, with phases that spread their crests."""
    phase = 2.0 * np.pi * np.arange(len(omega)) ** 2 / (2.0 * len(omega))
    return {
        "kind": "components", "omega": omega, "amplitude": np.full(len(omega), AMPLITUDE), "phase": phase,
        "ramp": RAMP,
    }  # fmt: skip


def modal_rates(time, values, guess):
    """Return complex rates (n,), 1/s and rad/s, of the decaying modes in values (m, k).

    values ~ c + sum Re(a_j exp(s_j t)) with common s_j = -rate.real + i rate.imag in all columns.
    """
    scale = values.std(axis=0)

    def misfit(rates):
        columns = np.column_stack(_decaying(time, [complex(*pair) for pair in rates.reshape(-1, 2)]))
        solution = np.linalg.lstsq(columns, values, rcond=None)[0]
        return ((columns @ solution - values) / scale).ravel()

    start = np.array([[rate.real, rate.imag] for rate in guess]).ravel()
    rates = least_squares(misfit, start, x_scale=np.abs(np.repeat(start[1::2], 2))).x.reshape(-1, 2)
    return rates[:, 0] + 1j * rates[:, 1]


def periods(name, study):
    """Compare damped natural periods of small free decays with Cummins' equation in numpy: 1 %."""
    study.say("natural periods")
    scene = without_drag(build_scene(name, fidelity="reference"))
    point, channels = trim(scene), [channel for group in DECAYING for channel in group.values()]
    initial = {channel: point[name_and_unit(channel)[0]] + OFFSET for channel in channels}
    frame = simulate(scene, None, duration=DECAY, dt=STEP, output_dt=0.1, initial=initial)
    body = body_of(name)
    modes = body.natural_modes()
    offset = OFFSET * np.array([1.0, 1.0, 1.0, *[DEGREE] * 3])
    _, motion = body.free_decay(offset, DECAY, STEP)
    kept = frame[frame[TIME] >= SETTLING]
    time, theirs = kept[TIME].to_numpy(), motion[:: round(0.1 / STEP)][-len(kept) :]
    for group in DECAYING:
        guess = [complex(modes[m][1] * modes[m][0], modes[m][0]) for m in group]
        columns = [frequency_domain.NAMES.index(m) for m in group]
        here = modal_rates(time, kept[list(group.values())].to_numpy(), guess)
        there = modal_rates(time, theirs[:, columns], guess)
        for label, *pair in zip(group, there, here, strict=True):
            ratios = [rate.real / abs(rate) for rate in pair]
            note = f"damping ratio {ratios[0]:.3g}, here {ratios[1]:.3g}"
            both = [2.0 * np.pi / rate.imag for rate in pair]
            case = "natural periods (against the frequency domain)"
            study.add(case, label, "s", *both, allowed=1.0, note=note)


def rao(name, study):
    """Compare responses to small waves from 0.2 to 1.5 rad/s with the frequency domain: amplitude 1 %."""
    study.say("responses to small waves")
    body = body_of(name)
    known = body.coefficients["excitation_omega"]
    omega = OMEGA[(OMEGA >= known[0]) & (known[-1] >= OMEGA)]  # excitation is zero outside the table
    waves = sea(omega)
    scene = without_drag(build_scene(name, sea=waves, duration=END, fidelity="reference"))
    frame = simulate(scene, None, duration=END, dt=STEP, output_dt=0.1)
    modes = body.natural_modes()
    slow = [complex(ratio * w / np.sqrt(1.0 - ratio**2), w) for w, ratio in modes.values()]
    theirs = body.responses(omega)
    kept = frame[frame[TIME] >= BEGIN]
    time = kept[TIME].to_numpy()
    fine = np.arange(omega[0], omega[-1], 0.002)
    curves = np.abs(body.responses(fine))
    ours, smooth = {"omega": omega}, {"omega": fine}
    for channel, motion in CHANNELS.items():
        label, unit = name_and_unit(channel)
        factor = 1.0 / DEGREE if unit == "deg" else 1.0
        # elevation at the origin is a cos(omega t - e): subtract the phase e
        here = fitted(time, kept[channel].to_numpy(), omega, slow) / AMPLITUDE * np.exp(1j * waves["phase"])
        there = theirs[:, motion] * factor
        largest = np.abs(there).max()
        for w, mine, exact in zip(omega, here, there, strict=True):
            error = 100.0 * (abs(mine) - abs(exact)) / max(abs(exact), SMALL * largest)
            quantity = f"{label} per metre of wave at {w:g} rad/s"
            study.add(
                "responses to small waves (against the frequency domain)", quantity, f"{unit}/m", abs(exact),
                abs(mine), error, 1.0, phase(mine, exact),
            )  # fmt: skip
        ours[label], smooth[label] = np.abs(here), factor * curves[:, motion]
    study.runs["responses"] = (pd.DataFrame(ours), pd.DataFrame(smooth))


def groups(name):
    """Return {group: (function, number of runs)} of a platform."""
    return {"periods": (partial(periods, name), 1), "responses": (partial(rao, name), 1)}
