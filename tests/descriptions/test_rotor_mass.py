"""Mass properties of a rotor against its point masses summed one by one, and published totals."""

import numpy as np
import pytest

from fowt_env.descriptions.rotor_mass import blade_mass, rotor_mass_properties


def points(blade, blades, cone, prebend, sweep):
    """(position (m, 3), mass (m,)) of every lump of a rotor at rest, shaft downwind along x."""
    place = []
    for number in range(blades):
        turn = 2.0 * np.pi * number / blades
        out = np.array([0.0, -np.sin(turn), np.cos(turn)])
        left = np.array([0.0, np.cos(turn), np.sin(turn)])
        shaft = np.array([1.0, 0.0, 0.0])
        axis, normal = np.cos(cone) * out - np.sin(cone) * shaft, np.cos(cone) * shaft + np.sin(cone) * out
        place.append(np.outer(blade.radius, axis) + np.outer(prebend, normal) + np.outer(sweep, left))
    return np.concatenate(place), np.tile(blade.mass, blades)


def test_a_rotor_has_the_mass_properties_of_its_points():
    blade = blade_mass([0.0, 0.3, 1.0], [900.0, 400.0, 30.0], 2.0, 80.0, 40)
    x = (blade.radius - 2.0) / 78.0
    prebend, sweep = -3.0 * x**2, 0.4 * np.sin(3.0 * x)
    place, mass = points(blade, 3, 0.07, prebend, sweep)
    hub = np.array([-0.6, 0.0, 0.0])
    place, mass = np.vstack([place, hub]), np.append(mass, 5e4)
    found = rotor_mass_properties(
        blade, cone=0.07, hub_mass=5e4, hub_inertia=1e5, hub_inertia_diameter=7e4, hub_cm=-0.6,
        prebend=prebend, sweep=sweep,
    )  # fmt: skip
    centre = mass @ place / mass.sum()
    arm = place - centre
    inertia = (mass * (arm**2).sum(axis=1)).sum() * np.eye(3) - (arm.T * mass) @ arm
    assert found.mass == pytest.approx(mass.sum(), rel=1e-12)
    assert found.cm_offset == pytest.approx(centre[0], rel=1e-12)
    assert found.inertia == pytest.approx(inertia[0, 0] + 1e5, rel=1e-12)
    assert found.inertia_diameter == pytest.approx(inertia[1, 1] + 7e4, rel=1e-12)
    assert found.inertia_diameter == pytest.approx(inertia[2, 2] + 7e4, rel=1e-12)


def test_blades_that_lean_upwind_move_the_centre_of_mass_upwind():
    blade = blade_mass([0.0, 1.0], [100.0, 100.0], 0.0, 50.0, 200)
    found = rotor_mass_properties(blade, cone=0.1)
    assert found.cm_offset == pytest.approx(-25.0 * np.sin(0.1), rel=1e-12)
    # closed form of a rod, within the error of its middle points
    assert found.inertia == pytest.approx(3 * 100.0 * 50.0**3 / 3 * np.cos(0.1) ** 2, rel=1e-4)
