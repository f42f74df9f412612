"""Computes linear models over the wind, their modes and zeros of blade pitch to rotor speed; sweeps lqr.

Used by fowt model linearize and fowt design; every function returns a table that can be written unchanged.
"""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.linalg import eigvals

from fowt_env.analysis.linear_model import FORCES, linearize, modes
from fowt_env.analysis.reduced_model import platform_frequency, platform_mode
from fowt_env.controllers.design.closed_loop import closed_loop_matrix
from fowt_env.controllers.gains import with_gains
from fowt_env.controllers.lqr.design import LQGSettings, scene_at, winds_above_rated
from fowt_env.controllers.lqr.law import LQR
from fowt_env.controllers.pi import PISettings
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.cases import named_cases
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.metrics import PAID
from fowt_env.training.evaluation.seeds import VALIDATION

INFINITE = 1e3  # rad/s: larger generalised eigenvalues are zeros at infinity
MODEL_SUFFIXES = (".json", ".npz")
SHOWN = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]", *PAID)
KEPT = (*SHOWN, "RotSpeed_max_[rpm]", "GenPwr_mean_[kW]", "TwrBsMyt_DEL_[kN-m]")


def models_over(scene, winds, progress=None):
    """Return {wind m/s: LinearModel} of a scene in steady winds; the pitch lag is at least LEAST_LAG."""
    models = {}
    for number, wind in enumerate(winds, 1):
        models[float(wind)] = linearize(scene_at(scene, wind))
        if progress is not None:
            progress(number, len(winds))
    return models


def mode_table(models):
    """Return a DataFrame of the modes at constant pitch and torque: wind, mode, period (s), damping ratio."""
    rows = [
        (wind, mode.name, mode.period, mode.damping_ratio)
        for wind, model in models.items()
        for mode in model.modes()
    ]
    return pd.DataFrame(rows, columns=["wind_[m/s]", "mode", "period_[s]", "damping_[-]"])


def transmission_zeros(model, source="blade_pitch_command", output="rotor_speed"):
    """Return the finite zeros (rad/s, complex) from an input of LinearModel.inputs to one of its outputs."""
    b = model.B[:, [model.inputs.index(source)]]
    row = model.output_index(output)
    c, d = model.C[[row]], model.D[[row]][:, [model.inputs.index(source)]]
    n = b.shape[0]
    left = np.block([[model.A, b], [c, d]])
    right = np.zeros_like(left)
    right[:n, :n] = np.eye(n)
    values = eigvals(left, right)
    return values[np.isfinite(values) & (np.abs(values) < INFINITE)]


def _right_half(model):
    """Return the right-half-plane zeros of blade pitch to rotor speed, one of each pair."""
    return [z for z in transmission_zeros(model) if z.real > 1e-6 and z.imag >= 0.0]


def zero_table(models):
    """Return a DataFrame of the right-half-plane zeros: wind, real and imaginary part (rad/s).

    Winds at which the blade pitch is at its minimum are omitted: there is no pitch control.
    """
    moving = {wind: model for wind, model in models.items() if not model.pitch_rests}
    rows = [(wind, z.real, z.imag) for wind, model in moving.items() for z in _right_half(model)]
    return pd.DataFrame(rows, columns=["wind_[m/s]", "real_[rad/s]", "imag_[rad/s]"])


def zeros_over(scene, winds=None, progress=None):
    """Return a DataFrame of the right-half-plane zero of blade pitch to rotor speed and loop modes per wind.

    winds      m/s; None: whole values above rated up to cut-out
    Columns: real and imaginary part of the zero (0 where there is none) and its period; period and damping of
    the platform's pitch with blades and torque held; under `pi` the least damping ratio of platform pitch and
    rotor speed, and that of surge: of the modes in the plane faster and slower than half the platform's
    frequency. Drag, quadratic in the motion, is neglected.
    Raises: InputError for winds at which the blade pitch is at its limit.
    """
    turbine = with_gains(scene)
    winds = winds_above_rated(turbine) if winds is None else winds
    settings, rows = PISettings.published(turbine), []
    for wind, model in models_over(scene, winds, progress).items():
        if model.pitch_rests:
            raise InputError(f"wind = {wind:g}: the blade pitch is at its limit")
        zero = max(_right_half(model), key=lambda z: z.real, default=0.0j)
        pitch_mode, frequency = platform_mode(model), platform_frequency(model)
        a, names = closed_loop_matrix(model, settings)
        # modes of platform and rotor: sway, roll and yaw are not in the loop
        moving = [
            mode for mode in modes(a, names, model.cm_height, model.arm)
            if mode.name in ("platform_pitch", "rotor_speed", "surge")
        ]  # fmt: skip
        fast, slow = (
            min((m.damping_ratio for m in moving if (m.frequency > 0.5 * frequency) is part), default=np.nan)
            for part in (True, False)
        )
        rows.append({
            "wind_[m/s]": wind,
            "zero_real_[rad/s]": float(zero.real),
            "zero_imag_[rad/s]": float(zero.imag),
            "zero_period_[s]": float(2.0 * np.pi / abs(zero)) if zero else np.nan,
            "platform_period_[s]": np.nan if pitch_mode is None else pitch_mode.period,
            "platform_damping_[-]": np.nan if pitch_mode is None else pitch_mode.damping_ratio,
            "pi_pitch_damping_[-]": float(fast),
            "pi_surge_damping_[-]": float(slow),
        })  # fmt: skip
    return pd.DataFrame(rows)


def save_models(models, path):
    """Write {wind: LinearModel} and return the path: .json or .npz, SI.

    winds (n,), states, inputs, outputs, forces (names), A (n, m, m), B, C, D, E, F as in LinearModel, and
    the operating points: x (n, m) in the order of states, u (n, 2) torque and blade pitch.
    Raises: InputError for another suffix.
    """
    path = Path(path)
    if path.suffix.lower() not in MODEL_SUFFIXES:
        raise InputError(f"models file {str(path)!r}: must end with {' or '.join(MODEL_SUFFIXES)}")
    first = next(iter(models.values()))
    content = {"winds": np.array(list(models))}
    content |= {key: np.array(getattr(first, key)) for key in ("states", "inputs", "outputs")}
    content["forces"] = np.array(FORCES)
    for key in "ABCDEF":
        content[key] = np.array([getattr(model, key) for model in models.values()])
    content["x"] = np.array([model.x0 for model in models.values()])
    content["u"] = np.array([model.point.command[:2] for model in models.values()])
    with replacing(path) as temporary:
        if path.suffix.lower() == ".npz":
            np.savez_compressed(temporary, **content)
        else:
            text = json.dumps({key: value.tolist() for key, value in content.items()}, allow_nan=False)
            temporary.write_text(text + "\n", encoding="utf-8")
    return path


def save_study(models, folder, title=None):
    """Write modes.csv, zeros.csv, models.json, models.npz and three plots into a folder; return the paths.

    title: of the plots.
    """
    from fowt_env.training.design.plots import plot_bode, plot_damping, plot_poles

    folder = Path(folder)
    written = [write_table(mode_table(models), folder / "modes.csv")]
    written.append(write_table(zero_table(models), folder / "zeros.csv"))
    written += [save_models(models, folder / f"models{suffix}") for suffix in MODEL_SUFFIXES]
    for name, plot in (("poles", plot_poles), ("damping", plot_damping), ("bode", plot_bode)):
        written.append(folder / f"{name}.png")
        plot(models, written[-1], title)
    return written


def sweep(variants, cases, seeds, out=None, progress=None, duration=660.0, skip=60.0, platform="oc3_hywind"):
    """Return a DataFrame of the runs of lqr with each variant of settings and of gspi_oc3, per seed.

    variants: list of {setting: value}; cases: names of cases and suites, scaled to the platform's turbine.
    Metrics are those of KEPT, NaN for failed runs. seeds: seeds.VALIDATION.start and above, as the others
    are for scoring. out: CSV.
    Raises: InputError for other seeds or unknown settings.
    """
    if min(seeds) < VALIDATION.start:
        raise InputError(f"seeds = {list(seeds)}: must be {VALIDATION.start} or more for tuning")
    laws = {"gspi_oc3": "gspi_oc3"}
    for variant in variants:
        settings = LQGSettings().changed(**variant)
        laws[str(variant or "default")] = partial(LQR, settings=settings)

    def report(done, total, row):
        if progress is not None and row is not None:
            progress(done, total)

    runs = evaluate(laws, named_cases(cases, platform), duration, skip, seeds, progress=report)
    table = runs.rename(columns={"controller": "variant"})[["variant", "case", "seed", *KEPT]]
    if out is not None:
        write_table(table, out)
    return table
