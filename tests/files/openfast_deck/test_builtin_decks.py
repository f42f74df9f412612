"""The built-in platforms that were converted from decks, against other programs and reports."""

import numpy as np
import pytest

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine


def test_oc4_with_its_ballast_water_is_the_platform_of_the_definition():
    """NREL/TP-5000-60601 gives mass, centre and inertia of platform and water together, to four digits."""
    platform = read_platform("nrel5mw_oc4_semi")
    ballast, said = platform.ballast, platform.published
    assert ballast.mass == pytest.approx(said["platform_mass"], rel=3e-4)
    assert ballast.cm_depth == pytest.approx(said["platform_cm_depth"], abs=0.005)
    assert ballast.inertia == pytest.approx(said["platform_inertia"], rel=4e-4)


def test_oc4_s_excitation_and_damping_obey_haskind_s_relation():
    """B = k/(8 pi rho g c_g) times the integral of |X|^2 over the headings, in deep water; of two sources."""
    platform = read_platform("nrel5mw_oc4_semi")
    body, site = platform.potential_flow, platform.environment
    assert len(body.heading) == 37
    # of RAFT's test data, then of a panel method whose panels are coarse for short waves
    for omega, tolerance in ((0.5655, 0.02), (0.7540, 0.02), (1.0681, 0.02), (1.3823, 0.04), (1.885, 0.12)):
        k = int(np.argmin(np.abs(body.excitation_omega - omega)))
        omega = body.excitation_omega[k]
        group = site.gravity / (2.0 * omega)
        scale = omega**2 / site.gravity / (8.0 * np.pi * site.water_density * site.gravity * group)
        radiated = scale * np.trapezoid(np.abs(body.excitation[k]) ** 2, body.heading, axis=0)
        for mode in range(6):
            damping = np.interp(omega, body.omega, body.damping[:, mode, mode])
            assert radiated[mode] == pytest.approx(damping, rel=tolerance)


def test_the_tilted_5_mw_turbine_differs_from_the_plain_one_by_tilt_and_cone():
    tilted, plain = read_turbine("nrel5mw_tilted"), read_turbine("nrel5mw_openfast")
    assert np.degrees([tilted.rotor.shaft_tilt, tilted.rotor.cone]) == pytest.approx([5.0, 2.5])
    assert tilted.rotor.mass == pytest.approx(plain.rotor.mass, abs=0.1)
    assert tilted.rotor.hub_height == pytest.approx(90.0, abs=1e-5)  # NREL/TP-500-38060, Table 1-1
    assert tilted.rotor.overhang == pytest.approx(5.0, abs=1e-5)
    # of the blades alone, the hub's 115926 kg m2 being about the shaft
    cone = np.cos(np.radians(2.5)) ** 2
    assert tilted.rotor.inertia == pytest.approx((plain.rotor.inertia - 115926.0) * cone + 115926.0, rel=1e-6)
    assert tilted.torque_law.region2_constant == plain.torque_law.region2_constant
    assert tilted.gains == plain.gains


@pytest.mark.parametrize("name", ["iea15_volturnus_s", "nrel5mw_iti_barge", "nrel5mw_oc4_semi"])
def test_weight_and_the_pull_of_the_lines_are_near_the_buoyancy(name):
    platform = read_platform(name)
    turbine, site = read_turbine(platform.turbine), platform.environment
    mass = platform.ballast.mass + platform.tower.mass + turbine.nacelle.mass + turbine.rotor.mass
    spare = site.water_density * platform.potential_flow.volume - mass
    longest = sum(line.wet_weight * line.length for line in platform.lines) / site.gravity
    assert -0.02 * longest < spare < longest


def test_oc4_s_excitation_is_of_one_piece_where_its_sources_meet():
    """A cubic through two points of either source, 0.063 rad/s apart, gives the point between them."""
    body = read_platform("nrel5mw_oc4_semi").potential_flow
    k = int(np.argmin(np.abs(body.excitation_omega - 1.2566)))
    places = [k - 4, k - 2, k + 1, k + 2]
    assert body.excitation_omega[places] - body.excitation_omega[k] == pytest.approx(
        0.0628319 * np.array([-2.0, -1.0, 1.0, 2.0]), abs=1e-5
    )
    between = np.tensordot([-1.0, 4.0, 4.0, -1.0], body.excitation[places], 1) / 6.0
    scale = np.abs(body.excitation).max(axis=(0, 1))
    # within either source the cubic itself misses by up to 0.085
    assert (np.abs(between - body.excitation[k]) < 0.07 * scale).all()
    assert np.abs(body.excitation[body.excitation_omega >= 2.6]).max() == 0.0
