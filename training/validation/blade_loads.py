"""Moments of single blades, hub and tower of the IEA 15 MW against OpenFAST: the platform held, steady wind.

Sheared wind with one pitch for all blades, and even wind with three unlike pitches. OpenFAST's runs have a
skewed wake, which the look-up of the rotor does not have: both rotors are compared with them, and the look-up
also with `bem` without it. Blades as masses are those of the turbine file.
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
STANDING = ("YawBrMyp", "YawBrMzp", "TwrBsMyt", "TwrBsMxt")  # in axes that do not turn with the rotor
MEAN, HARMONIC = 2.0, 5.0  # %, allowed
OWN = 1.0  # %, of the look-up against what it tabulates


def harmonics_of(values, azimuth):
    """Return (mean, first, third harmonic) of values over evenly spread azimuths (rad); complex."""
    waves = [2.0 * np.exp(-1j * k * azimuth) for k in (1, 3)]
    return values.mean(), *(np.mean(values * wave) for wave in waves)


def turn(rotor, wind, shear, rotor_speed, pitches, **options):
    """Return {channel: harmonics_of} of a rotor held at a speed (rad/s) and three pitches (rad), in kN m."""
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
    return {name: harmonics_of(values[:, names.index(name)], azimuth) for name in ROOTS + STANDING}


def blades(study):
    """Compare steady wind, platform held: means of the moments 2 %, first (tower: third) harmonics 5 %."""
    for case, rows in table(REFERENCE, study.folder).groupby("case", sort=False):
        first = rows.iloc[0]
        state = (
            float(first["wind_mps"]),
            float(first["shear_exponent"]),
            first["rotor_speed_rpm"] * RPM,
            np.array([first[f"blade_pitch{k}_deg"] for k in (1, 2, 3)]) * DEGREE,
        )
        for rotor, options in ROTORS.items():
            study.say(f"blades, {case}, {rotor}")
            found = turn(rotor, *state, **options)
            for row in rows.to_dict("records"):
                _add_rows(study, f"blades, {case}, {rotor}", row, found[row["channel"]])
        study.say(f"blades, {case}, lookup against bem")
        plain = turn("bem", *state)
        for name in ROOTS + STANDING:
            there, here = plain[name][0], found[name][0]
            study.add(f"blades, {case}, lookup (against bem, no skewed wake)", f"{name}, mean", "kN-m", there,
                      here, allowed=OWN)  # fmt: skip


def _add_rows(study, case, row, found):
    """Add the rows of a channel: its mean, and the harmonics that its axes make large."""
    name = row["channel"]
    study.add(case, f"{name}, mean", "kN-m", row["mean_kNm"], found[0], allowed=MEAN)
    alike = row["blade_pitch1_deg"] == row["blade_pitch3_deg"]
    # loads that a balanced rotor turns with have no first harmonic where nothing turns, and one with unlike
    # pitches in even wind no third
    orders = (1,) if name in ROOTS or not alike else (3,)
    for order in orders:
        there = complex(row[f"cos{order}_kNm"], -row[f"sin{order}_kNm"])
        here = found[1 if order == 1 else 2]
        quantity = f"{name}, {'first' if order == 1 else 'third'} harmonic over the azimuth"
        study.add(case, quantity, "kN-m", abs(there), abs(here), allowed=HARMONIC, note=phase(here, there))
