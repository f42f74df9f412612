import numpy as np
import pytest
from naive import flexible_tower
from plant_helpers import leaning, random_state, rates

from fowt_env import Load, build_scene, load_kernel
from fowt_env.plant.state import N_RIGID, State
from fowt_env.plant.tower_modes import TowerModes
from fowt_env.scene.mass import with_masses

KINDS = {2: "modes", 4: "modes2"}
ALOFT, BELOW = np.array([3.0, -2.0, 91.0]), np.array([4.0, 3.0, -30.0])  # m, points of two loads
FORCES = np.array([[3e5, -2e5, 1e5, 2e6, -1e6, 3e6], [-5e5, 4e5, 8e4, 1e7, 2e7, -3e6]])  # N and N m there


@load_kernel
def constant_load(parameters, motion, force):
    for i in range(6):
        force[i] = parameters[i]


def bending_scene(n, platform, turbine, **options):
    """A turbine in empty space with n modes and two constant loads, in the axes of nacelle and platform."""
    loads = [
        Load(name, constant_load, point=point, parameters=force, axes="body")
        for name, point, force in zip(("aloft", "below"), (ALOFT, BELOW), FORCES, strict=True)
    ]
    return build_scene(
        platform, turbine=turbine, tower=KINDS[n], hydrodynamics=False, mooring=False, loads=loads, **options
    )


def lumps(n, rng, top, base=10.0):
    """A tower of nine uneven lumps, with shapes and matrices of no special form."""
    height, mass = np.linspace(base + 4.0, top, 9), rng.uniform(1e4, 5e4, 9)
    up = (height - base) / (top - base)
    powers = (2, 3, 4, 2)[:n]
    shape = np.stack([up**power * (1.0 + 0.3 * k * (1.0 - up)) for k, power in enumerate(powers)], axis=1)
    stiffness, damping, weight = (root @ root.T for root in rng.normal(size=(3, n, n)))
    return flexible_tower.Tower(
        height, mass, shape, rng.uniform(0.01, 0.04, n), top, 2e6 * stiffness, 1e5 * damping, 3e3 * weight
    )


def modes_of(tower, first):
    """TowerModes of lumps."""
    n = len(tower.slope)
    return TowerModes(
        first=first,
        fore_aft=np.array([1.0, 0.0] * (n // 2)),
        top_height=tower.top,
        slope=tower.slope,
        first_moment=tower.mass @ tower.shape,
        height_moment=(tower.mass * tower.height) @ tower.shape,
        mass=np.einsum("k,ki,kj->ij", tower.mass, tower.shape, tower.shape),
        stiffness=tower.stiffness,
        damping=tower.damping,
        weight_stiffness=tower.weight_stiffness,
        drag_shape=np.zeros((6, n)),
    )


def random_bending(rng, n, size):
    """(state, index of the first deflection) of a scene in wild motion."""
    first = N_RIGID
    x = random_state(rng, size, tilt=0.3, speed=3.0, turning=0.3)
    x[first : first + n] = 2.0 * rng.normal(size=n)
    x[first + n : first + 2 * n] = 3.0 * rng.normal(size=n)
    return x


@pytest.mark.parametrize("n", [2, 4])
def test_accelerations_are_those_of_particles_on_their_paths(platform, turbine, n):
    rng = np.random.default_rng(n)
    platform, turbine = leaning(platform, turbine)
    tower = lumps(n, rng, platform.tower.top_height)
    modes = modes_of(tower, N_RIGID)
    scene = bending_scene(2, platform, turbine).with_model(tower=with_masses(modes, platform, turbine))
    twin = flexible_tower.Turbine(platform, turbine, tower)
    forces = [(True, ALOFT, *FORCES[0].reshape(2, 3)), (False, BELOW, *FORCES[1].reshape(2, 3))]
    for _ in range(200):
        x = random_bending(rng, n, scene.n_state)
        dx = rates(scene, x, u=(2e4, 0.0))
        rate = slice(N_RIGID + n, N_RIGID + 2 * n)
        found = np.r_[dx[State.VX : State.WZ + 1], dx[rate], dx[State.ROTOR_SPEED]]
        expected = twin.accelerations(x, (N_RIGID, N_RIGID + n), 2e4, forces, np.zeros((6, 6)))
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
