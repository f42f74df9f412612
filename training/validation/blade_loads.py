"""Compares moments of blades, hub and tower of the IEA 15 MW with OpenFAST: fixed platform, steady wind.

The OpenFAST runs have a skewed wake, which the `lookup` rotor lacks: `bem` and `lookup` are compared with
OpenFAST, and `lookup` also with `bem` without skewed wake. Blade masses are those of the turbine file.
"""

import numpy as np

from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.plant.advance import output_row
from fowt_env.plant.state import Command, State
from fowt_env.scene.build import build_scene
from fowt_env.training.validation.comparison import phase
from fowt_env.training.validation.openfast_cases import table

PLATFORM = "iea15_volturnus_s"
REFERENCE = f"{PLATFORM}/blade_loads.csv.gz"
AZIMUTHS = 36
ROTORS = {"bem": {"skewed_wake": True}, "lookup": {}}
ROOTS = ("RootMxc1", "RootMyc1", "RootMyc2", "RootMyc3")
STANDING = ("YawBrMyp", "YawBrMzp", "TwrBsMyt", "TwrBsMxt")  # in non-rotating axes
MEAN, HARMONIC = 2.0, 5.0  # allowed errors, %
OWN = 1.0  # allowed error of `lookup` against the tabulated `bem`, %


def turn(rotor, wind, shear, rotor_speed, pitches, **options):
    """Return {channel: (mean, first, third harmonic)} over a revolution, kN m; speed rad/s, pitches rad."""
    scene = build_scene(
        PLATFORM, wind={"kind": "steady", "speed": wind}, rotor=rotor, shear_exponent=shear,
        pitch="individual", hydrodynamics=False, mooring=False, **{"fidelity": "reference"} | options,
    )  # fmt: skip
    scene = scene.with_model({"rigid_body.platform_fixed": True, "rigid_body.rotor_fixed": True})
    handle, names = scene.handle(), [channel.name for channel in scene.channels]
    x, u = np.zeros(scene.n_state), np.zeros(scene.n_commands)
    x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = rotor_speed, pitches[0]
    first = scene.model.pitches.first
    x[first : first + 2], u[Command.BLADE_PITCH :] = pitches[1:], pitches
    azimuth, rows = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS, []
    for angle in azimuth:
        x[State.AZIMUTH] = angle
        rows.append(output_row(handle, x, u, 0.0, len(names)))
    values = scene.values(np.array(rows))
    waves = np.array([np.ones(AZIMUTHS), *(2.0 * np.exp(-1j * k * azimuth) for k in (1, 3))]) / AZIMUTHS
    return {name: waves @ values[:, names.index(name)] for name in ROOTS + STANDING}


def blades(study):
    """Compare moments on a fixed platform in steady wind: means 2 %, first (tower: third) harmonics 5 %."""
    for case, rows in table(REFERENCE, study.folder).groupby("case", sort=False):
        first = rows.iloc[0]
        pitches = first[[f"blade_pitch{k}_deg" for k in (1, 2, 3)]].to_numpy(float) * DEGREE
        wind, shear = map(float, first[["wind_mps", "shear_exponent"]])
        state = wind, shear, first["rotor_speed_rpm"] * RPM, pitches
        for rotor, options in ROTORS.items():
            study.say(f"blades, {case}, {rotor}")
            moments, words = turn(rotor, *state, **options), f"blades, {case}, {rotor}"
            for row in rows.to_dict("records"):
                name, (mean, *harmonics) = row["channel"], moments[row["channel"]]
                study.add(words, f"{name}, mean", "kN-m", row["mean_kNm"], mean.real, allowed=MEAN)
                # in non-rotating axes a balanced rotor gives no first harmonic, and a rotor with unequal
                # pitches in uniform wind gives no third one
                order = 1 if name in ROOTS or pitches[0] != pitches[2] else 3
                there, here = complex(row[f"cos{order}_kNm"], -row[f"sin{order}_kNm"]), harmonics[order // 2]
                quantity = f"{name}, {'first' if order == 1 else 'third'} harmonic over the azimuth"
                sizes, note = (abs(there), abs(here)), phase(here, there)
                study.add(words, quantity, "kN-m", *sizes, allowed=HARMONIC, note=note)
        study.say(f"blades, {case}, lookup against bem")
        plain, words = turn("bem", *state), f"blades, {case}, lookup (against bem, no skewed wake)"
        for name in ROOTS + STANDING:
            both = plain[name][0].real, moments[name][0].real
            study.add(words, f"{name}, mean", "kN-m", *both, allowed=OWN)
