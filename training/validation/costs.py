"""Computes errors of cheaper modelling options: one run is repeated with the costlier and the cheaper one."""

import numpy as np
import pandas as pd
from scipy.signal import periodogram

from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.validation.comparison import SETTLED, Channel, since
from fowt_env.training.validation.openfast_cases import PLATFORM, RUNS, box_wind
from fowt_env.weather.turbulence import turbulence
from fowt_env.weather.wind_field import read_box, rotor_average

STEP = 0.025  # s; halving the step changes standard deviations by less than 0.1 %
GENERATOR_SEEDS = 8
BANDS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.5)  # Hz
INSTANTANEOUS = {
    "kinematics_position": "instantaneous", "surface": "instantaneous", "stretching": "wheeler",
}  # fmt: skip
UNIFORM, BOX = "turb_18mps_Hs7.5_uniform", "turb_18mps_Hs7.5_box"
NO_SKEW = {"skewed_wake": False}
RUN_CHANGES = {  # name of a run: (case, changed options)
    "uniform wind": (UNIFORM, {}),
    "uniform wind, no skewed wake": (UNIFORM, NO_SKEW),
    "uniform wind, rotor table": (UNIFORM, {**NO_SKEW, "rotor": "table"}),
    "uniform wind, instantaneous wave kinematics": (UNIFORM, INSTANTANEOUS),
    "uniform wind, dynamic inflow": (UNIFORM, {"dynamic_inflow": True}),
    "full-field wind": (BOX, {}),
    "rotor-averaged wind": (BOX, {}),  # wind of _disk
    "rotor-averaged wind, rotor table": (BOX, {"rotor": "table", **NO_SKEW}),
}
CHOICES = {  # cheaper option: (run with the costlier option, run with the cheaper one)
    "skewed wake off (against on)": ("uniform wind", "uniform wind, no skewed wake"),
    "tabulated rotor (against BEM, both without skewed wake)": (
        "uniform wind, no skewed wake", "uniform wind, rotor table",
    ),
    "fixed wave kinematics up to still water (against instantaneous, Wheeler)": (
        "uniform wind, instantaneous wave kinematics", "uniform wind",
    ),
    "quasi-steady wake (against dynamic inflow)": ("uniform wind, dynamic inflow", "uniform wind"),
    "rotor-averaged wind with gradients (against full field)": ("full-field wind", "rotor-averaged wind"),
    "rotor-averaged wind and tabulated rotor (against full field and BEM)": (
        "full-field wind", "rotor-averaged wind, rotor table",
    ),
    "hub wind blown uniformly (against full field)": ("full-field wind", "uniform wind"),
}  # fmt: skip


def cheaper_choices(study):
    """Compare the cheaper with the costlier options on the same run; store the runs for the plots."""
    disk = _disk(study)
    for name, (case, changes) in RUN_CHANGES.items():
        if name not in study.runs:
            study.say(f"costs: {name}")
            wind = {"wind": disk["spec"]} if name == "rotor-averaged wind" else {}
            frame = RUNS[case].frame(study.folder, study.bts, dt=STEP, **changes, **wind)
            study.runs[name] = (frame, None)
    channels = (Channel.PITCH, Channel.SURGE, Channel.SPEED, Channel.THRUST, Channel.TENSIONS[0])
    for choice, (costlier, cheaper) in CHOICES.items():
        pair = since((study.runs[cheaper][0], study.runs[costlier][0]), SETTLED)
        study.add_statistics(choice, channels, ("mean", "std", "rms"), pair=pair)
    _generator(study, disk)


def _disk(study):
    """Return the rotor averages of the box and the wind specification made from them."""
    turbine = read_turbine(read_platform(PLATFORM).turbine)
    hub, diameter = turbine.rotor.hub_height, 2.0 * turbine.rotor.tip_radius
    blade = (np.asarray(turbine.blade.radius), np.asarray(turbine.blade.chord))
    box = read_box(box_wind(study.folder, study.bts), hub_height=hub, rotor_diameter=diameter)
    time, value = rotor_average(box, hub, diameter)
    _, chord = rotor_average(box, hub, diameter, chord=blade)
    keys = ("speed", "v", "w", "vertical_shear", "horizontal_shear")
    spec = {"kind": "series", "time": time, **dict(zip(keys, value.T, strict=True)), "shear_exponent": 0.0}
    return {"hub": hub, "diameter": diameter, "box": box, "value": value, "chord": chord, "spec": spec}


def _densities(step, values):
    """Return (frequency, power density averaged over columns) of values (n, m); Hann window, mean removed."""
    frequency, density = periodogram(values, 1.0 / step, np.hanning(len(values)), axis=0)
    return frequency, density.mean(axis=1)


def _generator(study, disk):
    """Compare the generator of normal turbulence with the rotor average of the box: deviation and spectrum.

    Values are divided by those at a point, as the standard deviation of one box (one seed) is not sigma_1.
    """
    hub, diameter, box, step = disk["hub"], disk["diameter"], disk["box"], disk["box"].dt
    y, z = np.meshgrid(box.y, box.z)
    points = box.velocity[:, np.hypot(y, z - hub) <= 0.5 * diameter, 0].astype(float)
    frequency, point = _densities(step, points)
    mean, chord = (_densities(step, disk[name][:, :1])[1] for name in ("value", "chord"))
    sigma, winds = ntm_sigma(18.0, "B"), {}
    for average in ("rotor", "point"):  # (seed, time, component)
        settings = {"height": hub, "diameter": diameter, "period": len(points) * step, "average": average}
        seeds = range(GENERATOR_SEEDS)
        winds[average] = np.array([turbulence(18.0, sigma, seed=s, **settings)[1][:-1] for s in seeds])
    spectra = {average: _densities(step, values[:, :, 0].T) for average, values in winds.items()}
    rotor_std, (made_frequency, made_rotor), (_, made_point) = winds["rotor"].std(axis=1), *spectra.values()
    case = "generator of normal turbulence (against the rotor average of the TurbSim box)"
    deviation = np.sqrt(points.var(axis=0).mean())
    ours = np.mean(rotor_std[:, 0] / winds["point"].std(axis=1)[:, 0])
    theirs = disk["value"].std(axis=0) / deviation
    study.add(case, "u: std of the rotor average over that of a point", "-", theirs[0], ours)
    chorded = disk["chord"][:, 0].std() / deviation
    study.add(case, "the same, box averaged with chord weights", "-", chorded, ours)
    study.add(case, "u at a point, std (the box: one seed; here sigma_1)", "m/s", deviation, sigma)
    for column, name in ((3, "vertical"), (4, "horizontal")):
        quantity = f"u: std of the {name} gradient per diameter over that of a point"
        study.add(case, quantity, "-", theirs[column], rotor_std[:, column].mean() / sigma)
    for low, high in zip(BANDS[:-1], BANDS[1:], strict=True):
        band = (frequency >= low) & (frequency < high)
        inside = (made_frequency >= low) & (made_frequency < high)
        there = np.sqrt(mean[band].sum() / point[band].sum())
        here = np.sqrt(made_rotor[inside].sum() / made_point[inside].sum())
        quantity = f"u: amplitude of the rotor average over that of a point, {low:g} to {high:g} Hz"
        study.add(case, quantity, "-", there, here)
    study.runs["spectra of the wind"] = (
        pd.DataFrame({"frequency": frequency, "point": point, "rotor": mean, "chord": chord}),
        pd.DataFrame({"frequency": made_frequency, "point": made_point, "rotor": made_rotor}),
    )
