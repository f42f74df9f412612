"""Errors of cheaper modelling choices: the same run with the costlier and the cheaper one, compared."""

import numpy as np
import pandas as pd

from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.validation.comparison import SETTLED, Channel, since
from fowt_env.training.validation.openfast_cases import PLATFORM, RUNS, box_wind
from fowt_env.weather.turbulence import turbulence
from fowt_env.weather.wind_field import read_box, rotor_average

STEP = 0.025  # s; half of it changes deviations by less than 0.1 % here
GENERATOR_SEEDS = 8
BANDS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.5)  # Hz
INSTANTANEOUS = {
    "kinematics_position": "instantaneous", "surface": "instantaneous", "stretching": "wheeler",
}  # fmt: skip
UNIFORM, BOX = "turb_18mps_Hs7.5_uniform", "turb_18mps_Hs7.5_box"
RUN_CHANGES = {  # name of a run: (case, changes)
    "uniform wind": (UNIFORM, {}),
    "uniform wind, no skewed wake": (UNIFORM, {"skewed_wake": False}),
    "uniform wind, rotor table": (UNIFORM, {"skewed_wake": False, "rotor": "table"}),
    "uniform wind, instantaneous wave kinematics": (UNIFORM, INSTANTANEOUS),
    "uniform wind, dynamic inflow": (UNIFORM, {"dynamic_inflow": True}),
    "full-field wind": (BOX, {}),
    "rotor-averaged wind": (BOX, {}),  # with the wind of _disk
    "rotor-averaged wind, rotor table": (BOX, {"rotor": "table", "skewed_wake": False}),
}
CHOICES = {  # cheaper choice: (run with the costlier one, run with the cheaper one)
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
    """Compare each cheaper choice with the costlier one on the same run; keep the runs for the plots."""
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
    """Return the rotor averages of the box, and the wind specification that has them."""
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
    """Return (frequency, mean density) of the columns of (n, m) values, mean removed, Hann window."""
    window = np.hanning(len(values))[:, None]
    transform = np.fft.rfft((values - values.mean(axis=0)) * window, axis=0)
    density = 2.0 * step * np.abs(transform) ** 2 / np.sum(window**2)
    return np.fft.rfftfreq(len(values), step), density.mean(axis=1)


def _generator(study, disk):
    """Compare the generator of normal turbulence with the rotor average of the box: deviation, spectrum.

    Fractions of the point variance are compared: that of one box of one seed differs from sigma_1.
    """
    hub, diameter, box, step = disk["hub"], disk["diameter"], disk["box"], disk["box"].dt
    y, z = np.meshgrid(box.y, box.z)
    inside = np.hypot(y, z - hub) <= 0.5 * diameter
    points = box.velocity[:, inside, 0].astype(float)
    frequency, point = _densities(step, points)
    _, mean = _densities(step, disk["value"][:, :1])
    _, chord = _densities(step, disk["chord"][:, :1])
    sigma = ntm_sigma(18.0, "B")
    period, series = len(points) * step, {}
    for average in ("rotor", "point"):
        settings = {"height": hub, "diameter": diameter, "period": period, "average": average}
        values = [turbulence(18.0, sigma, seed=seed, **settings)[1] for seed in range(GENERATOR_SEEDS)]
        series[average] = [value[:-1] for value in values]
    made_frequency, made_rotor = _densities(step, np.stack([v[:, 0] for v in series["rotor"]], axis=1))
    _, made_point = _densities(step, np.stack([v[:, 0] for v in series["point"]], axis=1))
    case = "generator of normal turbulence (against the rotor average of the TurbSim box)"
    deviation = np.sqrt(points.var(axis=0).mean())
    theirs = disk["value"][:, 0].std() / deviation
    ours = np.mean([r[:, 0].std() / p[:, 0].std() for r, p in zip(*series.values(), strict=True)])
    study.add(case, "u: std of the rotor average over that of a point", "-", theirs, ours)
    theirs = disk["chord"][:, 0].std() / deviation
    study.add(case, "the same, box averaged with chord weights", "-", theirs, ours)
    study.add(case, "u at a point, std (the box: one seed; here sigma_1)", "m/s", deviation, sigma)
    for column, name in ((3, "vertical"), (4, "horizontal")):
        theirs = disk["value"][:, column].std() / deviation
        ours = np.mean([r[:, column].std() for r in series["rotor"]]) / sigma
        study.add(case, f"u: std of the {name} gradient per diameter over that of a point", "-", theirs, ours)
    for low, high in zip(BANDS[:-1], BANDS[1:], strict=True):
        band = (frequency >= low) & (frequency < high)
        made = (made_frequency >= low) & (made_frequency < high)
        theirs = np.sqrt(mean[band].sum() / point[band].sum())
        ours = np.sqrt(made_rotor[made].sum() / made_point[made].sum())
        quantity = f"u: amplitude of the rotor average over that of a point, {low:g} to {high:g} Hz"
        study.add(case, quantity, "-", theirs, ours)
    study.runs["spectra of the wind"] = (
        pd.DataFrame({"frequency": frequency, "point": point, "rotor": mean, "chord": chord}),
        pd.DataFrame({"frequency": made_frequency, "point": made_point, "rotor": made_rotor}),
    )
