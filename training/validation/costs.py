"""What the cheaper modelling choices cost: the same run with the dearer and the cheaper one, compared."""

import numpy as np
import pandas as pd

from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.validation.openfast_cases import PLATFORM, RUNS, box_wind
from fowt_env.training.validation.signal_errors import normalised_rms
from fowt_env.weather.turbulence import turbulence
from fowt_env.weather.wind_field import read_box, rotor_average

STEP = 0.025  # s; half of it changes deviations by less than 0.1 % here
GENERATOR_SEEDS = 8
BANDS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.5)  # Hz
INSTANTANEOUS = {
    "kinematics_position": "instantaneous",
    "surface": "instantaneous",
    "stretching": "wheeler",
}


def cheaper_choices(study):
    """Add the rows of every choice to the study, and their runs for the plots."""
    from fowt_env.training.validation.validate import (
        PITCH,
        SETTLED,
        SPEED,
        SURGE,
        TENSION_CHANNELS,
        THRUST,
        _name,
        _since,
    )

    def frame(key, case, **changes):
        if key not in study.runs:
            study.say(f"costs: {key}")
            study.runs[key] = (RUNS[case].frame(study.folder, study.bts, dt=STEP, **changes), None)
        return study.runs[key][0]

    def compare(choice, dearer, cheaper):
        dear, cheap = _since((dearer, cheaper), SETTLED)
        for channel in (PITCH, SURGE, SPEED, THRUST, TENSION_CHANNELS[0]):
            name, unit = _name(channel)
            study.add(choice, f"{name}, mean", unit, dear[channel].mean(), cheap[channel].mean())
            study.add(choice, f"{name}, standard deviation", unit, dear[channel].std(), cheap[channel].std())
            error = 100.0 * normalised_rms(cheap[channel], dear[channel])
            quantity = f"{name}, normalised rms error"
            study.add(choice, quantity, unit, dear[channel].std(), cheap[channel].std(), error)

    uniform, box = "turb_18mps_Hs7.5_uniform", "turb_18mps_Hs7.5_box"
    full = frame("uniform wind", uniform)
    straight = frame("uniform wind, no skewed wake", uniform, skewed_wake=False)
    compare("skewed wake off (against on)", full, straight)
    table = frame("uniform wind, rotor table", uniform, skewed_wake=False, rotor="table")
    compare("tabulated rotor (against BEM, both without skewed wake)", straight, table)
    moved = frame("uniform wind, instantaneous wave kinematics", uniform, **INSTANTANEOUS)
    compare("fixed wave kinematics up to still water (against instantaneous, Wheeler)", moved, full)
    inflow = frame("uniform wind, dynamic inflow", uniform, dynamic_inflow=True)
    compare("quasi-steady wake (against dynamic inflow)", inflow, full)
    field = frame("full-field wind", box)
    disk = _disk(study)
    mean = frame("rotor-averaged wind", box, wind=disk["spec"])
    compare("rotor-averaged wind with gradients (against full field)", field, mean)
    both = frame("rotor-averaged wind, rotor table", box, rotor="table", skewed_wake=False)
    compare("rotor-averaged wind and tabulated rotor (against full field and BEM)", field, both)
    compare("hub wind blown uniformly (against full field)", field, full)
    _generator(study, disk)


def _rotor():
    """(hub height, diameter, (radius, chord)) of the validation turbine."""
    turbine = read_turbine(read_platform(PLATFORM).turbine)
    blade = (np.asarray(turbine.blade.radius), np.asarray(turbine.blade.chord))
    return turbine.rotor.hub_height, 2.0 * turbine.rotor.tip_radius, blade


def _disk(study):
    """Rotor averages of the box, and the wind specification that blows them."""
    hub, diameter, blade = _rotor()
    box = read_box(box_wind(study.folder, study.bts), hub_height=hub, rotor_diameter=diameter)
    time, value = rotor_average(box, hub, diameter)
    _, chord = rotor_average(box, hub, diameter, "chord", blade)
    keys = ("speed", "v", "w", "vertical_shear", "horizontal_shear")
    spec = {"kind": "series", "time": time, **dict(zip(keys, value.T, strict=True)), "shear_exponent": 0.0}
    return {"box": box, "time": time, "value": value, "chord": chord, "spec": spec}


def _densities(step, values):
    """(frequency, mean density) of the columns of (n, m) values, mean removed, Hann window."""
    window = np.hanning(len(values))[:, None]
    transform = np.fft.rfft((values - values.mean(axis=0)) * window, axis=0)
    density = 2.0 * step * np.abs(transform) ** 2 / np.sum(window**2)
    return np.fft.rfftfreq(len(values), step), density.mean(axis=1)


def _generator(study, disk):
    """The generator of normal turbulence against the rotor average of the box: deviation and spectrum.

    One box of one seed: its own point deviation differs from sigma_1 of the standard: fractions of the point
    variance are compared.
    """
    hub, diameter, _ = _rotor()
    box, step = disk["box"], disk["box"].dt
    y, z = np.meshgrid(box.y, box.z)
    inside = np.hypot(y, z - hub) <= 0.5 * diameter
    points = box.velocity[:, inside, 0].astype(float)
    frequency, point = _densities(step, points)
    _, mean = _densities(step, disk["value"][:, :1])
    _, chord = _densities(step, disk["chord"][:, :1])
    sigma = ntm_sigma(18.0, "B")
    series = {"rotor": [], "point": []}
    for average in series:
        for seed in range(GENERATOR_SEEDS):
            period = len(points) * step
            _, value = turbulence(
                18.0, sigma, height=hub, diameter=diameter, period=period, seed=seed, average=average
            )
            series[average].append(value[:-1])
    made_frequency, made_rotor = _densities(step, np.stack([v[:, 0] for v in series["rotor"]], axis=1))
    _, made_point = _densities(step, np.stack([v[:, 0] for v in series["point"]], axis=1))
    case = "generator of normal turbulence (against the rotor average of the TurbSim box)"
    theirs = disk["value"][:, 0].std() / np.sqrt(points.var(axis=0).mean())
    ours = np.mean([r[:, 0].std() / p[:, 0].std() for r, p in zip(*series.values(), strict=True)])
    study.add(case, "u: std of the rotor average over that of a point", "-", theirs, ours)
    theirs = disk["chord"][:, 0].std() / np.sqrt(points.var(axis=0).mean())
    study.add(case, "the same, box averaged with chord weights", "-", theirs, ours)
    deviation = np.sqrt(points.var(axis=0).mean())
    study.add(case, "u at a point, std (the box: one seed; here sigma_1)", "m/s", deviation, sigma)
    for column, name in ((3, "vertical"), (4, "horizontal")):
        theirs = disk["value"][:, column].std() / np.sqrt(points.var(axis=0).mean())
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
