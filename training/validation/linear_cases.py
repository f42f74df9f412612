"""Compares linear models of fowt_env with those of OpenFAST for the same turbine, above rated wind.

The OpenFAST models are from the ROSCO repository and belong to an older deck of the IEA 15 MW on VolturnUS-S,
which `old_deck` builds: lighter tower, other nacelle, hub and generator, blade radii 0.97 m smaller,
g = 9.80665. HydroDyn linearises with steps of 0.02 deg times the depth in translation and 2 deg in rotation
(HydroDyn.f90, HD_Perturb_u); the damping that its quadratic drag has at such a velocity is added here.
Remaining differences in OpenFAST: radiation by the state-space fit of the deck, potential flow around the
tower at the blades, and fixed sway, roll and yaw.
"""

from dataclasses import replace

import numpy as np

from fowt_env.analysis.linear_model import linearize
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import DEGREE
from fowt_env.scene.build import build_scene
from fowt_env.training.validation.comparison import phase
from fowt_env.training.validation.openfast_cases import table

PLATFORM = "iea15_volturnus_s"
WINDS = (13.0, 15.0, 18.0, 21.0, 24.0)  # m/s, constant generator torque in the OpenFAST models
SHEAR = 0.12
OUTPUTS = {"rotor_speed": ("rotor_speed", "rad/s"), "pitch": ("platform_pitch", "rad")}
SHOWN = (0.05, 0.1, 0.2, 0.3, 0.5)  # rad/s, of the responses
# values of the older deck, kg, m, kg m2
TOWER = {
    "mass": 1262976.4, "cm_height": 55.9245, "inertia": (1.3972144e9, 1.3972144e9, 0.0),
    # TwrCd 1.0 on the diameters of AeroDyn; this taper has the same area
    "base_diameter": 10.0, "top_diameter": 6.5, "drag_coefficient": 0.9974,
}  # fmt: skip
TOWER_TOP = 144.495
YAW_BEARING, NACELLE = 100000.0, 507275.0
NACELLE_PLACE = (-4.985, TOWER_TOP + 4.358)
NACELLE_YAW_INERTIA = 1.96179e7  # about the yaw axis
HUB_MASS, HUB_INERTIA, GENERATOR_INERTIA = 190000.0, 1.37347e6, 8.00865e6
BLADE_MASS, BLADE_CENTRE, BLADE_SQUARE = 64708.82, 26.892437, 9.2644705e7  # about the root, 20 lumps
OVERHANG, TILT, CONE = 11.075, np.radians(6.0), np.radians(4.0)
HUB_RADIUS, TIP_RADIUS, TWR2SHFT = 3.0, 120.0, 4.3478
PLATFORM_DEPTH = 14.94
TORQUE = 1.962e7  # N m
HEAVE_STIFFNESS = 445.0687 * 1025.0 * 9.80665  # N/m
GRAVITY = 9.80665
DRAG_STEPS = np.radians([0.02 * 200.0] * 3 + [2.0] * 3)  # m/s and rad/s, perturbations in HydroDyn


def old_deck():
    """Return Platform and Turbine with the values of the older deck."""
    platform = read_platform(PLATFORM)
    turbine = read_turbine(platform.turbine)
    flow = platform.potential_flow
    gravity = platform.environment.gravity
    stiffness = flow.stiffness * (GRAVITY / gravity)
    stiffness[2, 2] = HEAVE_STIFFNESS
    changes = {
        "environment": {"gravity": GRAVITY},
        "ballast": {"cm_depth": PLATFORM_DEPTH},
        "tower": {**TOWER, "top_height": TOWER_TOP, "modes": None},
    }
    parts = {name: getattr(platform, name).model_copy(update=update) for name, update in changes.items()}
    parts["potential_flow"] = replace(flow, stiffness=stiffness)
    parts["lines"] = tuple(
        line.model_copy(update={"wet_weight": line.wet_weight * GRAVITY / gravity}) for line in platform.lines
    )
    return platform.model_copy(update=parts), _turbine(turbine)


def _turbine(turbine):
    """Return the Turbine with the masses and radii of the older deck."""
    mass = 3.0 * BLADE_MASS + HUB_MASS
    along = BLADE_MASS * (HUB_RADIUS + BLADE_CENTRE)  # first moment about the apex
    square = BLADE_SQUARE + 2.0 * HUB_RADIUS * BLADE_MASS * BLADE_CENTRE + HUB_RADIUS**2 * BLADE_MASS
    about_shaft = 3.0 * square * np.cos(CONE) ** 2
    offset = -3.0 * along * np.sin(CONE) / mass  # upwind
    about_apex = 0.5 * about_shaft + 3.0 * square * np.sin(CONE) ** 2
    top = YAW_BEARING + NACELLE
    reduced = NACELLE * YAW_BEARING / top
    gap_x, gap_z = NACELLE_PLACE[0], NACELLE_PLACE[1] - TOWER_TOP
    yawing = NACELLE_YAW_INERTIA - NACELLE * NACELLE_PLACE[0] ** 2
    law, ratio = turbine.torque_law, turbine.drivetrain.gear_ratio
    changes = {
        "rotor": {
            "mass": mass,
            "overhang": OVERHANG * np.cos(TILT),
            "hub_height": TOWER_TOP + TWR2SHFT + OVERHANG * np.sin(TILT),
            "hub_radius": HUB_RADIUS,
            "tip_radius": TIP_RADIUS,
            "inertia": about_shaft + HUB_INERTIA,
            "inertia_diameter": about_apex - mass * offset**2,
            "cm_offset": offset,
        },
        "nacelle": {
            "mass": top,
            "cm_downwind": NACELLE * NACELLE_PLACE[0] / top,
            "cm_height": (NACELLE * NACELLE_PLACE[1] + YAW_BEARING * TOWER_TOP) / top,
            "inertia": (reduced * gap_z**2, reduced * (gap_x**2 + gap_z**2), yawing + reduced * gap_x**2),
        },
        "torque_law": {
            "rated_torque": TORQUE,
            "rated_power": TORQUE * (turbine.rated_rotor_speed * ratio),
            "max_torque": max(TORQUE, law.max_torque),
            # not compared below rated: the curve only has to end at the other rated torque
            "region2_constant": law.region2_constant * TORQUE / law.rated_torque,
        },
        "drivetrain": {"generator_inertia": GENERATOR_INERTIA / ratio**2},
        "blade": {"radius": turbine.blade.radius - (turbine.rotor.hub_radius - HUB_RADIUS)},
    }
    parts = {name: getattr(turbine, name).model_copy(update=update) for name, update in changes.items()}
    return turbine.model_copy(update=parts)


def named_poles(matrix, states):
    """Return {motion: pole with positive imaginary part, rotor: real pole} by participation factors.

    Factor of a state in a mode: product of right and left eigenvector; of a motion: sum over its states.
    """
    value, right = np.linalg.eig(matrix)
    participation = np.abs(right.T * np.linalg.inv(right))  # (mode, state)
    poles, used = {}, set()
    pairs = {"surge": ("surge", "vx"), "heave": ("heave", "vz"), "pitch": ("platform_pitch", "wy")}
    for name, motion in {"rotor": ("rotor_speed",), **pairs}.items():
        fits = np.abs(value.imag) < 1e-9 if name == "rotor" else value.imag > 0.0
        order = np.argsort(-participation[:, [states.index(state) for state in motion]].sum(axis=1))
        mode = next(m for m in order if fits[m] and m not in used)
        poles[name] = value[mode]
        used.add(mode)
    return poles


def linear(study):
    """Compare linear models above rated wind: frequencies 3 %, damping and rotor pole 10 %."""
    poles = table(f"{PLATFORM}/linear_poles.csv.gz", study.folder)
    gains = table(f"{PLATFORM}/linear_responses.csv.gz", study.folder)
    gains = gains[gains["omega_rad_s"].isin(SHOWN)]
    platform, turbine = old_deck()
    for wind in WINDS:
        study.say(f"linear model at {wind:g} m/s")
        scene = build_scene(
            platform, wind={"kind": "steady", "speed": wind}, turbine=turbine, rotor="bem", skewed_wake=True,
            shear_exponent=SHEAR, radiation="state_space", fidelity="reference",
        )  # fmt: skip
        drag = scene.model.hydro.matrices  # add the damping that results from the perturbations in HydroDyn
        damping = drag.linear_damping + drag.quadratic_damping * DRAG_STEPS
        model = linearize(scene.with_model({"hydro.matrices.linear_damping": damping}))
        theirs = poles[np.isclose(poles["wind_mps"], wind)].iloc[0]
        case = f"linear model at {wind:g} m/s (against OpenFAST)"
        for name, unit, column in (
            ("BldPitch1", "deg", "blade_pitch_rad"), ("PtfmSurge", "m", "surge_m"),
            ("PtfmHeave", "m", "heave_m"), ("PtfmPitch", "deg", "pitch_rad"),
        ):  # fmt: skip
            there = theirs[column] / (DEGREE if unit == "deg" else 1.0)
            study.add(case, f"operating point, {name}", unit, there, model.point[name])
        # blade pitch becomes an input; the azimuth is dropped
        states = [name for name in model.states if name not in ("blade_pitch", "azimuth")]
        kept = [model.states.index(name) for name in states]
        matrix = model.A[np.ix_(kept, kept)]
        ours = named_poles(matrix, states)
        for name in ("surge", "heave", "pitch"):
            there, here = complex(theirs[f"{name}_real"], theirs[f"{name}_imag"]), ours[name]
            study.add(case, f"{name} mode, frequency", "rad/s", there.imag, here.imag, allowed=3.0)
            ratios = [-pole.real / abs(pole) for pole in (there, here)]
            study.add(case, f"{name} mode, damping ratio", "-", *ratios, allowed=10.0)
        study.add(case, "rotor pole", "1/s", theirs["rotor_real"], ours["rotor"].real, allowed=10.0)
        inputs = {
            "wind": ("hub wind", "m/s", model.B[kept, model.inputs.index("wind_speed")]),
            "blade_pitch": ("blade pitch", "rad", model.A[kept, model.states.index("blade_pitch")]),
        }
        for row in gains[np.isclose(gains["wind_mps"], wind)].to_dict("records"):
            omega, there = row["omega_rad_s"], complex(row["real"], row["imag"])
            state, unit = OUTPUTS[row["output"]]
            source, per, column = inputs[row["input"]]
            solved = np.linalg.solve(1j * omega * np.eye(len(matrix)) - matrix, column)
            here, what = solved[states.index(state)], state.replace("_", " ")
            study.add(
                f"responses at {wind:g} m/s (against OpenFAST)", f"{what} per {source} at {omega:g} rad/s",
                f"{unit} per {per}", abs(there), abs(here), note=phase(here, there, 1),
            )  # fmt: skip
