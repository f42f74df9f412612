"""A controller in a host with the Bladed interface acts as in simulate."""

import numpy as np
import pytest
from bladed_host import InHost, changed, series

from fowt_env import build_scene, simulate
from fowt_env.control import CheckedController, make
from fowt_env.controllers.bladed.records import PLATFORM_START, RECORDS
from fowt_env.controllers.export.hosted import LAST_EXTENDED, RECORD_OF, Hosted, fields_of
from fowt_env.controllers.export.library import hosted
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import ControllerError, InputError
from fowt_env.plant.measurement import BLADES_MEASURED, MEASURED

TURBINE = read_turbine("nrel5mw")
DT = 0.1


class Feathering:
    """A controller in Python that reads all sensors of a turbine."""

    def reset(self, m):
        self.torque = m.generator_torque

    def act(self, m):
        pitch = m.blade_pitch + 0.02 * (m.rotor_speed - 1.267) + 0.1 * m.platform_pitch_rate
        return self.torque, max(pitch, 0.0)


@pytest.mark.parametrize("name", ["gspi_oc3", Feathering])
def test_a_run_through_the_records_of_a_host_is_the_run_of_simulate(name):
    scene = build_scene("oc3_hywind", wind=16.0, sea="paper_wind_wave", duration=700.0)
    controller = make(name, scene.turbine, DT)
    host = InHost(Hosted(controller, scene.turbine, DT).call, scene.turbine, DT)
    there = simulate(scene, controller=host, duration=30.0)
    here = simulate(scene, controller=name, duration=30.0)
    for channel in ("RotSpeed_[rpm]", "BldPitch1_[deg]", "GenTq_[kN-m]", "PtfmPitch_[deg]"):
        np.testing.assert_allclose(there[channel], here[channel], rtol=1e-6, atol=1e-6)  # records: float32
    assert here["BldPitch1_[deg]"].std() > 0.1


def test_each_field_is_read_from_the_record_with_its_unit():
    units = {record.number: record.unit for record in RECORDS}
    table = MEASURED | BLADES_MEASURED
    assert set(table) - set(RECORD_OF) == {"wave_elevation"}  # what no host sends
    for name, number in RECORD_OF.items():
        if number > 0:
            assert units[number] == table[name].unit
    assert RECORD_OF["platform_pitch"] == 1005 and RECORD_OF["platform_pitch_rate"] == 1011
    assert RECORD_OF["surge"] == PLATFORM_START and RECORD_OF["yaw_rate"] == LAST_EXTENDED == 1012
    assert RECORD_OF["yaw"] == 37 and RECORD_OF["generator_speed"] == 20
    assert RECORD_OF["nacelle_pitch_acceleration"] == 83  # as ROSCO, in any host


def test_information_that_no_host_sends_is_refused_by_name():
    for name in ("mpc_preview", "preview"):
        with pytest.raises(InputError, match="wind_preview"):
            fields_of(make(name, TURBINE, DT))

    class Waves(Feathering):
        information = ("wave_elevation",)

    with pytest.raises(InputError, match="wave_elevation"):
        fields_of(CheckedController(Waves()))


def test_a_controller_that_declares_nothing_runs_in_a_plain_host_until_it_reads_the_platform():
    class Holding:
        def reset(self, m):
            self.command = m.generator_torque, m.blade_pitch

        def act(self, m):
            return self.command

    plain = [changed(swap, extended_version=0.0) for swap in series(TURBINE, instants=3)]
    one = Hosted(make(Holding, TURBINE, DT), TURBINE, DT)
    assert [one.call(swap) for swap in plain][2][0] > 0.0
    with pytest.raises(ControllerError, match="platform_pitch_rate"):
        Hosted(make(Feathering, TURBINE, DT), TURBINE, DT).call(plain[0])


def test_the_blade_pitch_is_the_mean_over_the_blades():
    def mean(m):
        return m.generator_torque, m.blade_pitch

    array = changed(series(TURBINE, instants=1)[0], blade_pitch_1=0.1, blade_pitch_2=0.2, blade_pitch_3=0.6)
    assert Hosted(make(mean, TURBINE, DT), TURBINE, DT).call(array)[1] == pytest.approx(0.3)


def test_the_nacelle_s_velocity_is_the_integral_of_its_acceleration():
    seen = []

    class Reading:
        information = ("nacelle_velocity", "generator_torque", "blade_pitch")

        def reset(self, m):
            pass

        def act(self, m):
            seen.append(m.nacelle_velocity)
            return m.generator_torque, m.blade_pitch

    arrays = series(TURBINE, instants=100)
    one = Hosted(make(Reading, TURBINE, DT), TURBINE, DT)
    for swap in arrays:
        one.call(swap)
    velocity, expected = 0.0, [0.0]
    for swap in arrays[1:]:
        velocity = np.exp(-0.01 * DT) * velocity + DT * float(swap[52])
        expected.append(velocity)
    np.testing.assert_allclose(seen, expected, rtol=1e-12)


def test_limits_of_generator_and_pitch_drive_hold_for_any_controller():
    class Wild:
        def reset(self, m):
            self.calls = 0

        def act(self, m):
            self.calls += 1
            sign = 1.0 if self.calls // 120 % 2 else -1.0
            return 1e9 * sign, 9.0 * sign

    one = Hosted(make(Wild, TURBINE, DT), TURBINE, DT)
    commands = np.array([one.call(swap) for swap in series(TURBINE, instants=240)])
    law, drive = TURBINE.torque_law, TURBINE.pitch_drive
    assert np.abs(np.diff(commands[:, 0])).max() == pytest.approx(DT * law.max_torque_rate)
    assert np.abs(np.diff(commands[:, 1])).max() == pytest.approx(DT * drive.rate_limit)
    assert (commands[:, 0].min(), commands[:, 0].max()) == (0.0, law.max_torque)
    assert (commands[:, 1].min(), commands[:, 1].max()) == (drive.minimum, drive.maximum)


def test_a_start_below_the_period_of_the_host_and_a_command_that_is_no_number_are_refused():
    arrays, name = series(TURBINE, instants=2), "gspi_oc3"
    for interval in (0.03, 0.2, 0.0):
        with pytest.raises(InputError, match="must divide the control period of 0.1 s"):
            hosted(name, "oc3_hywind", DT).call(changed(arrays[0], communication_interval=interval))
    with pytest.raises(InputError, match="the first call must have 0"):
        hosted(name, "oc3_hywind", DT).call(arrays[1])
    with pytest.raises(InputError, match="generator_speed is not a finite number"):
        hosted(name, "oc3_hywind", DT).call(changed(arrays[0], generator_speed=np.inf))
