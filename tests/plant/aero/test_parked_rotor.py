"""A parked rotor in wind from any direction against the sum over its blade sections in NumPy."""

import numpy as np
import pytest
from naive.rotor import coefficients, span_integrals

import fowt_env
from fowt_env.controllers.constant import Constant

SPEED = 40.0


@pytest.mark.parametrize("direction", [0.0, -8.0, 20.0, 60.0, 90.0, 135.0, 180.0, -90.0])
def test_wind_from_any_direction_loads_a_parked_rotor_by_its_polars(direction):
    """Without induction: at rest a rotor has no wake (yaw errors of DLC 6.2 and 7.1)."""
    wind = {"kind": "steady", "speed": SPEED, "direction": direction}
    scene = fowt_env.build_scene("oc3_hywind", wind=wind, fidelity="standard")
    initial = {"start": "zero", "RotSpeed": 0.0, "BldPitch1": 90.0, "Azimuth": 0.0}
    frame = fowt_env.simulate(scene, Constant(0.0, np.pi / 2), duration=0.1, initial=initial)
    rotor, blade, site = scene.turbine.rotor, scene.turbine.blade, scene.platform.environment
    thrust = 0.0
    for azimuth in 2.0 * np.pi / 3.0 * np.arange(3):
        line = []
        for radius, chord, twist, foil in zip(
            blade.radius, blade.chord, blade.twist, blade.airfoil, strict=True
        ):
            height = rotor.hub_height + radius * np.cos(azimuth)
            speed = SPEED * (height / rotor.hub_height) ** site.shear_exponent
            normal = speed * np.cos(np.radians(direction))
            along = speed * np.sin(np.radians(direction)) * np.cos(azimuth)  # against the rotation
            flow = np.arctan2(normal, along)
            cl, cd = coefficients(flow - twist - np.pi / 2, blade.polars[foil])
            pressure = 0.5 * site.air_density * chord * (normal**2 + along**2)
            line.append(pressure * (cl * np.cos(flow) + cd * np.sin(flow)))
        thrust += span_integrals(np.array(blade.radius), np.array(line), rotor)[0]
    assert frame["RtFldFxh_[N]"].iloc[0] == pytest.approx(thrust, rel=2e-3)
    assert not frame.attrs["events"]
