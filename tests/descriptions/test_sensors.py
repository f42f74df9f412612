"""Chains of sensors: what they are made of, and what is refused."""

import numpy as np
import pytest

from fowt_env.descriptions.sensors import (
    EXACT,
    Sensor,
    SensorChain,
    built_in_chains,
    sensor_chain,
    sensors_of,
)
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.measurement import SENSOR_FIELDS
from fowt_env.weather.sensor_noise import draw_drift


@pytest.mark.parametrize("name", sorted(built_in_chains()))
def test_every_figure_of_a_built_in_chain_has_a_source_and_a_mark(name):
    chain = built_in_chains()[name]
    assert chain.name == name and chain.description
    for sensor in chain.sensors.values():
        assert sensor.source and sensor.confidence in tuple("ABCD")


def test_the_standard_chain_has_the_sensors_of_a_turbine_and_no_motion_that_none_measures():
    available = set(built_in_chains()["standard"].available)
    assert set(SENSOR_FIELDS) - available == {"time", "nacelle_pitch_acceleration"}
    assert available - set(SENSOR_FIELDS) == {"wind_speed"}


def test_a_name_a_chain_and_nothing_at_all_are_understood():
    own = SensorChain("own", {"rotor_speed": Sensor(noise=0.1)})
    assert sensor_chain(own) is own and sensor_chain("standard") is built_in_chains()["standard"]
    assert sensor_chain(None) is None and sensor_chain(EXACT) is None
    with pytest.raises(InputError, match="unknown sensor chain 'standart'. Did you mean 'standard'"):
        sensor_chain("standart")
    with pytest.raises(InputError, match="sensors = 0.02: must be the name"):
        sensor_chain(0.02)


@pytest.mark.parametrize(
    "key, value",
    [
        ("noise", -1.0),
        ("drift", -1.0),
        ("drift_time", 0.0),
        ("time_constant", -0.1),
        ("delay", 101.0),
        ("step", "x"),
    ],
)
def test_a_figure_out_of_range_is_named(key, value):
    with pytest.raises(InputError, match=f"{key} = "):
        Sensor(**{key: value})


@pytest.mark.parametrize(
    "sensors, message",
    [
        ({"rotor_sped": Sensor()}, "unknown field of sensor chain 'own'"),
        ({"time": Sensor()}, "unknown field of sensor chain 'own'"),
        ({"rotor_speed": 0.1}, "rotor_speed = 0.1: must be a Sensor"),
        ({"nacelle_velocity": Sensor(integral_of="nacelle_acceleration")}, "must be a field that the chain"),
        (
            {"surge": Sensor(), "surge_rate": Sensor(integral_of="surge", noise=0.1)},
            "surge_rate: an integral has integral_of and high_pass",
        ),
    ],
)
def test_a_chain_that_cannot_be_is_refused(sensors, message):
    with pytest.raises(InputError, match=message):
        SensorChain("own", sensors)


def test_a_drift_has_its_size_and_time_and_each_field_its_own():
    sensor, dt, n = Sensor(drift=3.0, drift_time=5.0), 0.1, 200_000
    drift, other = (draw_drift(sensor, field, dt, 7, n) for field in (20, 21))
    assert drift.std() == pytest.approx(3.0, rel=0.05)
    assert np.mean(drift[:-50] * drift[50:]) / 9.0 == pytest.approx(np.exp(-1.0), abs=0.05)
    assert abs(np.corrcoef(drift, other)[0, 1]) < 0.05
    np.testing.assert_array_equal(drift[:300], draw_drift(sensor, 20, dt, 7, 300))
    starts = [draw_drift(sensor, 20, dt, seed, 1)[0] for seed in range(2000)]
    assert np.std(starts) == pytest.approx(3.0, rel=0.05)


def test_noise_on_the_shafts_goes_with_the_rated_figures_of_the_turbine():
    plain, same = sensor_chain("standard"), sensors_of("standard", read_turbine("nrel5mw"))
    assert same is plain
    direct = read_turbine("iea15")
    found = sensors_of("standard", direct).sensors
    for name, rated in (
        ("rotor_speed", direct.rated_rotor_speed),
        ("generator_speed", direct.torque_law.rated_speed),
        ("generator_torque", direct.torque_law.rated_torque),
    ):
        assert 5e-4 < found[name].noise / rated < 3e-3  # as of the NREL 5 MW turbine: 0.1 to 0.2 %
    moments = [name for name in plain.sensors if name.startswith("root_")]
    shaft = direct.torque_law.rated_torque * direct.drivetrain.gear_ratio
    for name in moments:
        assert found[name].noise / shaft == pytest.approx(8.0e4 / 4.18e6, rel=1e-3)
    untouched = set(plain.sensors) - {"rotor_speed", "generator_speed", "generator_torque", *moments}
    assert all(found[name] == plain.sensors[name] for name in untouched)
    assert sensors_of(plain, direct) is plain  # given as a record: as it is
