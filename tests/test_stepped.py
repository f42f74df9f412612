"""Runs advanced by single control periods have the rows of simulate."""

import numpy as np
import pandas as pd
import pytest
from served import small_scene

import fowt_env
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.loop.protection import Stop
from fowt_env.run.stepped import SteppedRun

PERIODS = 60


class Replay:
    """A Python controller that replays commands (kN m, deg) row by row."""

    information = ()

    def __init__(self, commands):
        self.commands = commands
        self.individual = commands.shape[1] == 4

    def reset(self, measurement):
        self.left = iter(self.commands.tolist())

    def act(self, measurement):
        torque, *pitches = next(self.left)
        return torque * 1e3, *(pitch * DEGREE for pitch in pitches)


def run_of(scene, commands, **settings):
    """(SteppedRun at its end, channels at every instant) under commands."""
    run = SteppedRun(scene, 0.1 * len(commands), 0.1, **settings)
    shown = []
    for command in commands.tolist():
        shown.append(run.channels())
        run.advance(command)
    return run, np.array([*shown, run.channels()])


@pytest.mark.parametrize(
    ("platform", "options"),
    [
        ("oc3_hywind", {"wind": "ntm:18:B", "sea": "jonswap:6:10"}),
        pytest.param(
            "iea15_volturnus_s",
            {"wind": "ntm:14:B", "sea": "jonswap:4:9", "tower": "modes2", "pitch": "individual"},
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_the_rows_are_those_of_simulate_under_the_same_commands_bit_for_bit(platform, options):
    scene = fowt_env.build_scene(platform, seed=3, **options)
    rng, rated = np.random.default_rng(0), scene.turbine.torque_law.rated_torque * 1e-3
    pitches = rng.normal(12.0, 2.0, (PERIODS, 3 if scene.model.pitches is not None else 1))
    commands = np.column_stack([rng.normal(rated, 0.02 * rated, PERIODS), pitches])
    run, shown = run_of(scene, commands, protection="turbine")
    expected = fowt_env.simulate(scene, Replay(commands), 0.1 * PERIODS, protection="turbine")
    rows = run.frame()
    np.testing.assert_array_equal(rows, expected)
    assert rows.attrs == expected.attrs
    # what does not depend on the new torque at once is shown before the command as the row has it
    motions = [expected.columns.get_loc(name) for name in expected.columns if name.startswith("PtfmT")]
    motions = [i for i in motions if "TA" not in expected.columns[i]]
    at = [
        *motions,
        *(expected.columns.get_loc(name) for name in ("Time_[s]", "GenSpeed_[rpm]", "Azimuth_[deg]")),
    ]
    np.testing.assert_array_equal(shown[:, at], expected.to_numpy()[:, at])
    torque = expected.columns.get_loc("GenTq_[kN-m]")
    np.testing.assert_array_equal(shown[1:-1, torque], expected.to_numpy()[:-2, torque])


def test_an_ordered_stop_feathers_from_the_next_period_on():
    run = SteppedRun(small_scene(), 4.0, 0.1)
    command = run.command
    for period in range(40):
        if period == 10:
            run.stop(Stop.EMERGENCY)
        assert run.is_stopping == (period > 10)
        run.advance(command)
    assert run.has_ended and run.time == pytest.approx(4.0)
    frame = run.frame()
    assert frame.attrs["stop"] == "emergency"
    assert (frame["GenTq_[kN-m]"][:11] == frame["GenTq_[kN-m]"][0]).all()
    assert (frame["GenTq_[kN-m]"][11:] == 0.0).all()
    rates = np.diff(frame["BldPitch1_[deg]"])[-10:] / 0.1
    np.testing.assert_allclose(rates, 8.0, rtol=0.01)  # the emergency rate, once the actuator follows it


@pytest.mark.parametrize("command", [(40.0,), (40.0, 14.0, 14.0), (float("nan"), 14.0), (40.0, float("inf"))])
def test_a_command_that_is_not_one_finite_number_a_column_is_refused(command):
    run = SteppedRun(small_scene(), 1.0, 0.1)
    with pytest.raises(InputError, match=r"GenTq_\[kN-m\], BlPitchC1_\[deg\]"):
        run.advance(command)
    assert run.time == 0.0


def test_nothing_follows_the_end_of_the_run_or_its_frame():
    for duration in (0.1, 1.0):
        run = SteppedRun(small_scene(), duration, 0.1)
        run.advance(run.command)
        run.frame()
        with pytest.raises(InputError, match="the run has ended"):
            run.advance(run.command)


def test_a_capsize_leaves_the_rows_before_it():
    run = SteppedRun(small_scene(), 4.0, 0.1, initial={"start": "zero", "PtfmRVyi": 60.0})
    with pytest.raises(SimulationStopped, match="capsize") as stopped:
        while True:
            run.advance((0.0, 90.0))
    pd.testing.assert_frame_equal(run.frame(), stopped.value.frame)
    assert run.frame()["PtfmRVyi_[deg/s]"].iloc[0] == pytest.approx(60.0)
