"""Moments of single blades, hub and yaw bearing against lumps, and where outputs have them."""

import numpy as np
import pytest
from naive import blade_loads
from numba import njit
from plant_helpers import random_state

import fowt_env
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.rotor_mass import BladeMass, rotor_mass_properties
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant import blade_outputs
from fowt_env.plant.advance import observe, output, output_row
from fowt_env.plant.channels import BLADE_CHANNELS
from fowt_env.plant.elastic.tower import Twist
from fowt_env.plant.measurement import N_MEASUREMENTS
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import N_RIGID, State, Wrench, pose_of
from fowt_env.scene.mass import build_layout, build_rigid_body

GRAVITY = 9.80665
LUMPS = ((3.0, 900.0), (12.0, 4000.0), (27.0, 6000.0), (44.0, 3000.0), (58.0, 700.0))
HUB = (-0.8, 5e4)  # m downwind of the rotor centre, kg
SHELL = (((1.5, 0.4, 91.0), 9e4), ((3.5, -2.0, 88.0), 6e4), ((-1.0, 1.5, 89.5), 7e4))


def lumped_turbine():
    """A tilted and coned turbine that is nothing but LUMPS, HUB and SHELL."""
    turbine = read_turbine("nrel5mw_tilted")
    rotor = turbine.rotor
    distance, mass = np.array(LUMPS).T
    whole = rotor_mass_properties(BladeMass(distance, mass), cone=rotor.cone, hub_mass=HUB[1], hub_cm=HUB[0])
    span = distance - rotor.hub_radius
    own = {
        f"blade_{name}": float(mass @ span**k)
        for k, name in enumerate(("mass", "first_moment", "second_moment"))
    }
    rotor = rotor.model_copy(update=whole._asdict() | own)
    places, weights = np.array([at for at, _ in SHELL]), np.array([mass for _, mass in SHELL])
    centre = weights @ places / weights.sum()
    apart = places - centre
    tensor = sum(m * (d @ d * np.eye(3) - np.outer(d, d)) for m, d in zip(weights, apart, strict=True))
    nacelle = turbine.nacelle.model_copy(
        update={
            "mass": weights.sum(), "cm_downwind": centre[0], "cm_left": centre[1], "cm_height": centre[2],
            "inertia": tensor,
        }
    )  # fmt: skip
    shaft = turbine.drivetrain.model_copy(update={"generator_inertia": 0.0})
    return turbine.model_copy(update={"rotor": rotor, "nacelle": nacelle, "drivetrain": shaft})


@njit
def moments(pose, rates, azimuth, speed, rate, blades, rotor, body, layout, out):
    """Fill out (11,) with root moments, in and out of plane of each blade, hub and bearing moments."""
    hub = blade_outputs.hub_motion(pose, rates, speed, rate, body.gravity, layout)
    masses = layout.blade_masses
    for blade in range(3):
        load = blade_outputs.blade_load(blade, blades)
        psi = azimuth + 2.0 * np.pi * blade / 3.0
        root = blade_outputs.root_moments(psi, load, hub, masses, layout)
        out[2 * blade], out[2 * blade + 1] = root.in_plane, root.out_of_plane
    out[6], out[7] = blade_outputs.hub_moments(azimuth, hub, masses, layout, blades)
    out[8], out[9], out[10] = blade_outputs.bearing_moments(
        pose, rates, speed, rate, rotor, masses, body, layout
    )


@pytest.mark.parametrize("seed", range(4))
def test_moments_are_those_of_lumps_that_move_with_nacelle_and_rotor(seed):
    turbine, platform = lumped_turbine(), read_platform("oc3_hywind")
    rotor, t = turbine.rotor, 3.0
    layout = build_layout(platform, turbine, individual=True)
    body = build_rigid_body(platform, turbine)._replace(gravity=GRAVITY)
    motion, rng = blade_loads.Motion(seed, 1.1), np.random.default_rng(seed)
    loads = rng.uniform(-1.0, 1.0, (3, 6)) * [3e5, 3e4, 1e5, 1e6, 3e5, 1e7]
    x = np.zeros(N_RIGID)
    at, velocity, rates = motion.at(t), motion.velocity(t), motion.rates(t)
    x[: State.VX], x[State.VX : State.BLADE_PITCH] = at, velocity
    place, axes = motion.frame(t)
    centre, x_axis, *_ = motion.blade_axes(t, 0, rotor)
    # the air's load of the whole rotor about the body origin, from those of the blades
    force, moment = np.zeros(3), np.zeros(3)
    for blade, load in enumerate(loads):
        own = axes.T @ np.column_stack(motion.blade_axes(t, blade, rotor)[1:])
        force += own @ load[:3]
        moment += own @ load[3:] + np.cross(axes.T @ (centre - place), own @ load[:3])
    found = np.zeros(11)
    moments(
        pose_of(x), Twist(*rates[:6]), at[6], velocity[6], rates[6], loads, Wrench(*force, *moment), body,
        layout, found,
    )  # fmt: skip
    expected = [
        value
        for blade in range(3)
        for value in blade_loads.root_moments(motion, t, blade, loads[blade], rotor, LUMPS, GRAVITY)
    ]
    shaft = axes @ blade_loads.about_y(rotor.shaft_tilt)
    hub = blade_loads.rotor_moment(motion, t, centre, loads, rotor, LUMPS, HUB, GRAVITY)
    expected += list(shaft.T[1:] @ hub)
    top = place + axes @ [0.0, 0.0, platform.tower.top_height]
    whole = blade_loads.rotor_moment(motion, t, top, loads, rotor, LUMPS, HUB, GRAVITY)
    whole += blade_loads.nacelle_moment(motion, t, top, SHELL, GRAVITY)
    expected += list(axes.T @ whole)
    assert found == pytest.approx(np.array(expected), rel=1e-6, abs=1e-6 * np.abs(expected).max())


@pytest.fixture(scope="module")
def scene():
    """OC3-Hywind in steady wind with a pitch for each blade, as tests/conftest.py has it for one pitch."""
    return fowt_env.build_scene(wind=14.0, fidelity="standard", pitch="individual")


def row_of(scene, x):
    """{channel: value in SI} of a state."""
    row = output_row(scene.handle(), x, np.zeros(scene.n_commands), 0.0, len(scene.channels))
    return dict(zip((channel.name for channel in scene.channels), row, strict=True))


def turning(scene, *pitches):
    x = random_state(np.random.default_rng(5), scene.n_state, speed=1.0, turning=0.02)
    x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = 1.2, pitches[0]
    x[scene.model.pitches.first : scene.model.pitches.first + 2] = pitches[1:]
    return x


def test_outputs_are_the_moments_under_the_loads_of_the_last_evaluation(scene):
    x = turning(scene, 0.15, 0.12, 0.19)
    found, dx, data = row_of(scene, x), np.zeros_like(x), scene.data()
    output(scene.handle(data), x, np.zeros(scene.n_commands), 0.0, dx, np.empty(len(scene.channels)))
    expected = np.zeros(11)
    moments(
        pose_of(x), Twist(*dx[State.VX : State.ROTOR_SPEED]), x[State.AZIMUTH], x[State.ROTOR_SPEED],
        dx[State.ROTOR_SPEED], data.blades, Wrench(*data.cache[LoadCache.ROTOR : LoadCache.ROTOR + 6]),
        scene.model.rigid_body, scene.model.layout, expected,
    )  # fmt: skip
    names = [f"Root{part}{blade}" for blade in (1, 2, 3) for part in ("Mxc", "Myc")]
    names += ["LSSTipMys", "LSSTipMzs", "YawBrMxp", "YawBrMyp", "YawBrMzp"]
    assert [found[name] for name in names] == pytest.approx(list(expected), rel=1e-12)
    assert (found["BldPitch1"], found["BldPitch2"], found["BldPitch3"]) == (0.15, 0.12, 0.19)
    assert data.blades[:, 3].sum() == pytest.approx(found["RtFldMxh"], rel=1e-12)
    assert tuple(scene.channels[-len(BLADE_CHANNELS) :]) == BLADE_CHANNELS


def test_a_measurement_has_the_moments_of_the_outputs(scene):
    x, u, m = turning(scene, 0.15, 0.12, 0.19), np.zeros(scene.n_commands), np.empty(scene.n_measurements)
    x[State.AZIMUTH] += 2.0 * np.pi
    found = row_of(scene, x)
    observe(scene.handle(), x, u, 0.0, np.zeros_like(x), m)
    names = ["Azimuth", *(f"BldPitch{k}" for k in (1, 2, 3)), *(f"RootMyc{k}" for k in (1, 2, 3))]
    names += [*(f"RootMxc{k}" for k in (1, 2, 3)), "LSSTipMys", "LSSTipMzs", "YawBrMyp", "YawBrMzp"]
    assert list(m[N_MEASUREMENTS:]) == [found[name] for name in names]


def test_a_turbine_without_blade_masses_is_refused():
    turbine = read_turbine("nrel5mw")
    without = dict.fromkeys(("blade_mass", "blade_first_moment", "blade_second_moment"))
    turbine = turbine.model_copy(update={"rotor": turbine.rotor.model_copy(update=without)})
    with pytest.raises(InputError, match="rotor.blade_mass: is missing in the turbine 'nrel5mw'"):
        fowt_env.build_scene(
            turbine=turbine, wind=14.0, pitch="individual", rotor="bem", fidelity="reference"
        )
