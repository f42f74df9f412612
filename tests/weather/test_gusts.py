"""Gusts against numbers worked out by hand from IEC 61400-1 for the NREL 5 MW: D 126 m, hub 90 m, I-B."""

import numpy as np
import pytest

from fowt_env.descriptions.iec import extreme_speed
from fowt_env.weather import gusts

pytestmark = pytest.mark.installation

SITE = {"turbulence_class": "B", "height": 90.0, "diameter": 126.0}
# 1 + 0.1 * 126/42 = 1.3 divides the standard deviation in EOG and EDC


def test_extreme_speeds_of_the_classes():
    # Ve50 = 1.4 Vref, Ve1 = 0.8 Ve50
    assert [extreme_speed(c, 50) for c in ("I", "II", "III")] == pytest.approx([70.0, 59.5, 52.5])
    assert [extreme_speed(c, 1) for c in ("I", "II", "III")] == pytest.approx([56.0, 47.6, 42.0])
    assert extreme_speed("I", 50, turbulent=True) == pytest.approx(50.0)
    assert extreme_speed("I", 1, turbulent=True) == pytest.approx(40.0)


@pytest.mark.parametrize(
    "speed, gust",
    [
        (11.4, 3.3 * 1.981 / 1.3),  # 5.0287 m/s, sigma_1 = 0.14 (0.75 * 11.4 + 5.6) = 1.981
        (25.0, 3.3 * 3.409 / 1.3),  # 8.6536 m/s
        (52.0, 1.35 * (56.0 - 52.0)),  # 5.4 m/s: near the one-year extreme the other limit rules
    ],
)
def test_operating_gust_speed(speed, gust):
    _, value = gusts.operating_gust(speed, turbine_class="I", **SITE)
    assert value[:, 0].max() - speed == pytest.approx(0.74 * gust, rel=1e-12)


def test_operating_gust_dips_rises_and_returns():
    duration, value = gusts.operating_gust(11.4, turbine_class="I", **SITE)
    u = value[:, 0]
    gust = 3.3 * 1.981 / 1.3
    assert duration == 10.5
    assert u[0] == u[-1] == pytest.approx(11.4, abs=1e-12)
    # at T/2 the sine is -1 and 1 - cos is 2: the peak is 0.74 V_gust
    assert u.max() == pytest.approx(11.4 + 0.74 * gust, rel=1e-12)
    assert u[len(u) // 2] == u.max()
    # at T/4, sin(3 pi/4) = 0.7071 and 1 - cos = 1
    assert u[round(0.25 * (len(u) - 1))] == pytest.approx(11.4 - 0.37 * gust * np.sqrt(0.5), abs=2e-3)
    np.testing.assert_allclose(u, u[::-1], atol=1e-12)
    assert np.all(value[:, 1:] == 0.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_direction_change_ends_at_its_angle(sign):
    # 4 atan(1.981/(11.4 * 1.3)) = 4 atan(0.133671) = 0.531538 rad = 30.455 deg
    duration, value = gusts.direction_change(11.4, sign=sign, **SITE)
    angle = np.degrees(np.arctan2(value[:, 1], value[:, 0]))
    assert duration == 6.0
    assert angle[0] == 0.0 and angle[-1] == pytest.approx(sign * 30.455, abs=1e-3)
    assert angle[len(angle) // 2] == pytest.approx(sign * 30.455 / 2, abs=1e-3)
    np.testing.assert_allclose(np.hypot(value[:, 0], value[:, 1]), 11.4, rtol=1e-12)


def test_coherent_gust_rises_15_mps_and_turns_720_over_the_speed():
    duration, value = gusts.coherent_gust(12.0, sign=-1)
    speed = np.hypot(value[:, 0], value[:, 1])
    angle = np.degrees(np.arctan2(value[:, 1], value[:, 0]))
    middle = len(value) // 2
    assert duration == 10.0
    assert speed[[0, middle, -1]] == pytest.approx([12.0, 19.5, 27.0], rel=1e-12)
    assert angle[[0, middle, -1]] == pytest.approx([0.0, -30.0, -60.0], abs=1e-9)


def test_coherent_gust_turns_around_in_light_wind():
    _, value = gusts.coherent_gust(3.0, sign=1)
    assert value[-1, :2] == pytest.approx([-18.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("orientation, column", [("vertical", 3), ("horizontal", 4)])
def test_wind_shear_peaks_in_the_middle_and_vanishes(orientation, column):
    # (2.5 + 0.2 * 6.4 * 1.981 * (126/42)^0.25) * 2 = (2.5 + 2.53568 * 1.316074) * 2 = 11.6743 m/s over D
    duration, value = gusts.wind_shear(11.4, orientation=orientation, sign=-1, **SITE)
    assert duration == 12.0
    assert value[len(value) // 2, column] == pytest.approx(-11.6743, abs=1e-3)
    assert value[[0, -1], column] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.all(value[:, 0] == 11.4)
    rest = [i for i in (1, 2, 3, 4) if i != column]
    assert np.all(value[:, rest] == 0.0)


def test_samples_follow_the_formula_between_them():
    duration, value = gusts.operating_gust(25.0, turbine_class="I", **SITE)
    t = np.random.default_rng(0).uniform(0.0, duration, 2000)
    gust = 3.3 * 3.409 / 1.3
    exact = 25.0 - 0.37 * gust * np.sin(3 * np.pi * t / 10.5) * (1 - np.cos(2 * np.pi * t / 10.5))
    found = np.interp(t, np.linspace(0.0, duration, len(value)), value[:, 0])
    assert np.abs(found - exact).max() < 1e-4  # m/s
