import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fresh_python import fresh_python
from laws import Delegate
from naive.faults import Overridden
from plant_helpers import random_state

import fowt_env
from fowt_env.controllers import make
from fowt_env.controllers.constant import Constant
from fowt_env.descriptions.faults import Fault
from fowt_env.errors import ControllerError, InputError, SimulationStopped
from fowt_env.plant.advance import advance
from fowt_env.plant.events import EVENTS, Counter
from fowt_env.plant.state import State, pose_of
from fowt_env.run import simulation
from fowt_env.run.initial_conditions import initial_state
from fowt_env.run.simulation import REPLACED

COLUMNS = ["PtfmSurge_[m]", "PtfmHeave_[m]", "PtfmPitch_[deg]", "PtfmYaw_[deg]"]


def run(scene, **options):
    return fowt_env.simulate(scene, **({"controller": None, "duration": 10.0} | options))


# Limits of the generator and of the rotor


def commands(torque, blade_pitch):
    """The same command in every period, from Python."""
    return lambda measurement: (torque, blade_pitch)


def followed(start, commands, maximum, step):
    """Torque of each period in plain Python: the command in [0, maximum], a step from the last at most."""
    torque, found = start, []
    for wanted in commands:
        wanted = min(max(wanted, 0.0), maximum)
        torque = min(max(wanted, torque - step), torque + step)
        found.append(torque)
    return np.array(found)


@pytest.mark.parametrize("torque", [90e3, -43e3, 20e3])
@pytest.mark.parametrize("compiled", [True, False])
def test_the_generator_keeps_its_range_and_rate_whatever_is_commanded(storm_scene, torque, compiled):
    law = storm_scene.turbine.torque_law
    controller = Constant(torque=torque, blade_pitch=0.26) if compiled else commands(torque, 0.26)
    frame = run(storm_scene, controller=controller, duration=5.0)
    start = 1e3 * fowt_env.trim(storm_scene)["GenTq"]
    expected = followed(start, [torque] * 50, law.max_torque, 0.1 * law.max_torque_rate)
    got = 1e3 * frame["GenTq_[kN-m]"].to_numpy()
    np.testing.assert_allclose(got[:50], expected, rtol=1e-12, atol=1e-6)
    np.testing.assert_array_equal(frame["GenTqLim_[-]"][:50], 1.0 * (np.abs(expected - torque) > 1.0))
    power = frame["GenPwr_[kW]"].to_numpy()
    assert power.min() >= 0.0 and power.max() < 7000.0
    np.testing.assert_allclose(
        power, 0.944 * 97.0 * got * frame["RotSpeed_[rpm]"] * np.pi / 30e3, rtol=1e-9, atol=1e-9
    )


def test_a_command_within_the_limits_is_followed_to_the_bit(storm_scene):
    start = 1e3 * fowt_env.trim(storm_scene)["GenTq"]
    near = start - 0.1 * storm_scene.turbine.torque_law.max_torque_rate
    frame = run(storm_scene, controller=commands(near, 0.26), duration=1.0)
    assert (frame["GenTq_[kN-m]"] == 1e-3 * near).all() and not frame["GenTqLim_[-]"].any()


def test_the_generator_is_off_from_the_instant_of_the_grid_loss(storm_scene):
    for controller in (Constant(), commands(43e3, 0.26)):
        frame = run(
            storm_scene, controller=controller, duration=2.0, faults={"kind": "grid_loss", "time": 0.7}
        )
        torque = frame["GenTq_[kN-m]"].to_numpy()
        assert (torque[:7] > 40.0).all() and (torque[7:] == 0.0).all()


@pytest.mark.parametrize("kind", [Constant, commands])
def test_a_run_goes_on_past_the_overspeed_unless_it_is_to_stop_there(storm_scene, kind):
    limit = storm_scene.turbine.overspeed * 30.0 / np.pi
    free = {"controller": kind(0.0, 0.0), "duration": 20.0}
    frame = run(storm_scene, **free)
    speed = frame["RotSpeed_[rpm]"].to_numpy()
    assert speed.max() > 1.2 * limit
    with pytest.raises(SimulationStopped, match="overspeed") as stopped:
        run(storm_scene, **free, protection="end_at_overspeed")
    first = int(np.argmax(speed > limit))
    assert stopped.value.time == pytest.approx(frame["Time_[s]"][first])
    np.testing.assert_array_equal(stopped.value.frame.to_numpy(), frame.to_numpy()[:first])
    with pytest.raises(SimulationStopped, match="overspeed"):  # an environment ends at its last instant too
        run(storm_scene, **free | {"duration": first * 0.1}, protection="end_at_overspeed")


NO_TRIPS = dict.fromkeys(("overspeed", "overpower", "acceleration", "pitch_deviation"), False)


def overspeed(ratio):
    """Protection that trips by overspeed alone, above a ratio of rated rotor speed."""
    return NO_TRIPS | {"overspeed": {"limit": ratio}}


def test_a_trip_is_an_emergency_stop_at_the_instant_in_which_the_speed_is_passed(storm_scene):
    """Against a wrapper that overrides the controller from a time on."""
    options = {"duration": 40.0, "faults": {"kind": "grid_loss", "time": 5.0}}
    free = run(storm_scene, controller="gspi_oc3", **options)
    at = float(free["Time_[s]"][free["RotSpeed_[rpm]"] / 12.1 > 1.1].iloc[0])
    tripped = run(storm_scene, controller="gspi_oc3", protection=overspeed(1.1), **options)
    assert tripped.attrs["tripped"] == pytest.approx(at, abs=1e-9)
    inner = make("gspi_oc3", storm_scene.turbine, 0.1)
    stop = Overridden(inner, Fault(kind="emergency_stop", time=at), np.radians(90.0), 0.1)
    pd.testing.assert_frame_equal(tripped, run(storm_scene, controller=stop, **options), check_exact=True)
    assert tripped["BldPitch1_[deg]"].iloc[-1] == pytest.approx(90.0, abs=0.1)


def test_a_trip_stays_when_the_speed_has_fallen_and_takes_the_torque(storm_scene):
    """From a rotor that starts too fast; over many compiled calls, as a progress bar has them."""
    fast = {"RotSpeed": 13.5}
    frame = run(storm_scene, controller="pi", protection=overspeed(1.1), duration=60.0, initial=fast)
    assert frame.attrs["tripped"] == 0.0
    assert frame["RotSpeed_[rpm]"].iloc[-1] < 6.0
    assert (frame["GenTq_[kN-m]"] == 0.0).all()


@pytest.mark.parametrize("trip", [1.0, 0.5, -1.3, np.inf, "fast"])
def test_a_trip_at_or_below_rated_is_refused(storm_scene, trip):
    with pytest.raises(InputError, match="overspeed.limit = "):
        run(storm_scene, protection={"overspeed": {"limit": trip}})


@pytest.mark.parametrize("keyword", REPLACED)
def test_a_replaced_keyword_says_what_replaces_it(storm_scene, keyword):
    with pytest.raises(
        InputError, match=f"simulate\\({keyword}=...\\) was replaced: use (protection|faults|initial)="
    ):
        run(storm_scene, **{keyword: 1.2})


def test_what_the_time_step_blows_up_is_not_called_a_capsize(platform):
    hydro = platform.hydro.model_copy(update={"drag_coefficient": 1e5})
    sea = {"kind": "regular", "H": 3.0, "T": 5.0}
    scene = fowt_env.build_scene(platform.model_copy(update={"hydro": hydro}), sea=sea, fidelity="reference")
    with pytest.raises(SimulationStopped, match="numerical blow-up"):
        run(scene, dt=0.1, duration=20.0)


# Rare events: a scene for each counter that really makes it happen


def under_water():
    """The hull's upper cylinder lies below the water plane."""
    return fowt_env.build_scene(fidelity="reference"), {"initial": {"start": "zero", "PtfmHeave": -60.0}}


def without_roots():
    """Polars so large that no inflow angle balances them, in air so thin that the loads stay finite."""
    scene = fowt_env.build_scene(wind=8.0, fidelity="reference")
    elements = scene.model.aero.rotor.elements
    segment = elements.polars.segment.copy()
    segment[:, 1] = 1e160
    broken = elements._replace(polars=elements.polars._replace(segment=segment), air_density=1e-165)
    return scene.with_model({"aero.rotor.elements": broken}), {}


def without_equilibrium():
    """Lines that shrink under tension and are too short: they have no catenary."""
    scene = fowt_env.build_scene(fidelity="reference")
    lines = scene.model.mooring
    shrinking = lines._replace(length=0.93 * lines.length, EA=-lines.EA)
    return scene.with_model(mooring=shrinking), {"initial": "zero"}


def yawing():
    """A rotor as one table that yaws at 10 deg/s: the wind along a blade is steeper than the table takes."""
    return fowt_env.build_scene(wind=10.0, fidelity="fast"), {"initial": {"PtfmRVzi": 10.0}}


HAPPENINGS = {
    Counter.BEM_FALLBACK: without_roots,
    Counter.HYDROSTATIC_FALLBACK: under_water,
    Counter.MOORING_UNCONVERGED: without_equilibrium,
    Counter.ROTOR_TABLE_CLAMPED: yawing,
}


@pytest.mark.parametrize("event", Counter, ids=lambda event: event.name)
def test_a_rare_event_of_a_run_is_handed_out_and_warned_of_where_it_does_harm(event):
    scene, options = HAPPENINGS[event]()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        frame = run(scene, duration=0.1, dt=0.0125, **options)
    assert list(frame.attrs["events"]) == [event.name] and frame.attrs["events"][event.name] > 0
    told = [str(w.message) for w in caught if issubclass(w.category, fowt_env.PlantWarning)]
    if not EVENTS[event].harmful:
        assert told == []
        return
    (text,) = told
    assert f"{event.name} {frame.attrs['events'][event.name]}: " in text
    assert EVENTS[event].meaning in text and EVENTS[event].advice in text
    assert [w.filename for w in caught if str(w.message) == text] == [__file__]


def test_an_ordinary_run_has_no_rare_events(storm_scene):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run(storm_scene, duration=1.0).attrs["events"] == {}


# Rows and time


def test_rows_run_from_zero_to_the_duration_inclusive(wave_scene):
    frame = run(wave_scene, duration=3.0, output_dt=0.25, control_dt=0.1)
    assert len(frame) == 13
    assert np.allclose(frame["Time_[s]"], 0.25 * np.arange(13), rtol=0.0, atol=1e-12)
    assert list(frame.columns) == [channel.column for channel in wave_scene.channels]
    assert np.isfinite(frame.to_numpy()).all()


def test_output_step_does_not_change_the_motion(wave_scene):
    fine, coarse = (run(wave_scene, duration=4.0, output_dt=step) for step in (0.05, 0.5))
    thinned = fine.iloc[::10].reset_index(drop=True)
    # the rows evaluate the moorings, and those start from their last solution
    assert np.allclose(thinned[COLUMNS], coarse[COLUMNS], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    "options, names",
    [
        (dict(dt=0.03), ("dt = 0.03", "control_dt = 0.1")),
        (dict(dt=0.05, control_dt=0.1, output_dt=0.12), ("dt = 0.05", "output_dt = 0.12")),
        (dict(duration=1.02), ("dt = 0.0125", "duration = 1.02")),
        (dict(duration=1.05), ("dt = 0.1", "duration = 1.05")),
        (dict(dt=0.0), ("dt = 0.0", "positive")),
        (dict(duration=-5.0), ("duration = -5.0", "positive")),
        (dict(control_dt=float("nan")), ("control_dt = nan", "positive")),
        (dict(output_dt=True), ("output_dt = True", "positive")),
        (dict(output_dt=0.0), ("output_dt = 0.0", "positive")),
    ],
)
def test_steps_that_do_not_fit_are_refused_with_both_values(options, names, still_scene):
    with pytest.raises(InputError) as caught:
        run(still_scene, **options)
    for name in names:
        assert name in str(caught.value)


def test_run_longer_than_the_random_sea_is_refused(storm_scene):
    with pytest.raises(InputError, match=r"duration = 61 s.*drawn for 60 s"):
        run(storm_scene, duration=61.0)


# Start


def test_run_starts_at_the_trim(still_scene):
    point, first = fowt_env.trim(still_scene), run(still_scene, duration=1.0).iloc[0]
    for name in ("PtfmSurge", "PtfmHeave", "PtfmPitch"):
        column = next(c.column for c in still_scene.channels if c.name == name)
        assert first[column] == pytest.approx(point[name], rel=1e-12)


def test_zero_start_has_an_undisplaced_platform_and_the_rotor_of_that_wind(storm_scene):
    x, u = initial_state(storm_scene, "zero")
    assert np.all(x[:6] == 0.0) and np.all(x[State.VX : State.WZ + 1] == 0.0)
    fixed = fowt_env.trim(storm_scene, platform="fixed")
    assert np.array_equal(x, fixed.state) and np.array_equal(u, fixed.command)


def test_initial_values_are_absolute_with_or_without_unit(still_scene):
    initial = {"PtfmSurge": 5.0, "PtfmPitch_[deg]": 3.0, "RotSpeed": 6.0, "BldPitch1": 10.0, "Azimuth": 30.0}
    first = run(still_scene, duration=1.0, initial=initial).iloc[0]
    assert first["PtfmSurge_[m]"] == 5.0
    for column, expected in (
        ("PtfmPitch_[deg]", 3.0), ("RotSpeed_[rpm]", 6.0), ("BldPitch1_[deg]", 10.0), ("Azimuth_[deg]", 30.0),
    ):  # fmt: skip
        assert first[column] == pytest.approx(expected, rel=1e-14)
    assert first["PtfmHeave_[m]"] == pytest.approx(fowt_env.trim(still_scene)["PtfmHeave"], rel=1e-12)


def test_initial_velocities_are_in_inertial_axes(still_scene):
    initial = {"PtfmYaw": 90.0, "PtfmPitch": 10.0, "PtfmTVxi": 1.0, "PtfmTVzi": -0.5, "PtfmRVyi": 2.0}
    x, _ = initial_state(still_scene, initial=initial)
    assert x[State.VY] == pytest.approx(-1.0, rel=1e-12)
    pose = pose_of(x)
    assert pose.r11 * x[State.VX] + pose.r12 * x[State.VY] + pose.r13 * x[State.VZ] == pytest.approx(1.0)
    first = run(still_scene, duration=1.0, initial=initial).iloc[0]
    expected = dict(PtfmTVxi=1.0, PtfmTVyi=0.0, PtfmTVzi=-0.5, PtfmRVxi=0.0, PtfmRVyi=2.0, PtfmRVzi=0.0)
    for name, value in expected.items():
        column = next(c.column for c in still_scene.channels if c.name == name)
        assert first[column] == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize(
    "options, message",
    [
        (dict(initial="somewhere"), "unknown start 'somewhere'.*Known: parked, trim, zero"),
        (dict(initial={"PtfmSurg": 1.0}), "Did you mean 'PtfmSurge'"),
        (dict(initial={"PtfmSurge": float("inf")}), r"initial\['PtfmSurge'\] = inf.*finite"),
        (dict(initial={"PtfmSurge": "5"}), r"initial\['PtfmSurge'\] = '5'"),
        (dict(initial={"PtfmPitch": 95.0}), r"PtfmPitch.*= 95: must be inside \(-90, 90\)"),
        (dict(initial={"BldPitch1": 95.0}), r"BldPitch1.*= 95 deg: must be in \[0, 90\]"),
        (
            dict(initial={"PtfmHeave": -201.0}),
            "begin with its keel 1 m below the sea bed .PtfmHeave = -201 m",
        ),
    ],
)
def test_bad_starts_are_refused(options, message, still_scene):
    with pytest.raises(InputError, match=message):
        run(still_scene, **options)


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        ({"PtfmHeave": -200.0}, "its tower base 190 m under water"),
        ({"PtfmHeave": 121.0}, "its keel 0.9.* m above the water"),
        ({"PtfmYaw": 180.0}, r"PtfmYaw'\] = 180: must be within 90 deg of 0"),
        ({"PtfmYaw": -90.5}, "face away from the wind"),
    ],
)
def test_a_rotor_that_cannot_work_where_it_is_put_is_refused(initial, message, storm_scene):
    with pytest.raises(InputError, match=message):
        initial_state(storm_scene, initial=initial)
    initial_state(storm_scene, initial={"PtfmYaw": 80.0, "PtfmHeave": -9.0})


# Controllers


def test_no_controller_holds_rotor_speed_and_blade_pitch(storm_scene):
    frame = run(storm_scene, duration=5.0)
    for column in ("RotSpeed_[rpm]", "BldPitch1_[deg]", "GenTq_[kN-m]"):
        assert np.ptp(frame[column]) < 1e-12
    assert np.ptp(frame["PtfmPitch_[deg]"]) > 0.0
    assert frame["RotSpeed_[rpm]"][0] == pytest.approx(12.1)


def test_law_called_from_python_gives_the_bits_of_the_compiled_loop(storm_scene, turbine):
    for output_dt in (0.1, 0.25):
        options = dict(duration=6.0, output_dt=output_dt)
        compiled = run(storm_scene, controller="pi", **options)
        plain = run(storm_scene, controller=Delegate(turbine, 0.1), **options)
        pd.testing.assert_frame_equal(plain, compiled, check_exact=True)
    assert np.ptp(compiled["BldPitch1_[deg]"]) > 0.0


def test_run_in_chunks_is_one_run(storm_scene, monkeypatch):
    whole = run(storm_scene, controller="pi", duration=12.0)
    monkeypatch.setattr(simulation, "FIRST_CHUNK", 0.7)
    monkeypatch.setattr(simulation, "CHUNK_TIME", 0.0)  # chunks stay as short as the first
    shares = []
    chunked = run(storm_scene, controller="pi", duration=12.0, progress=shares.append)
    pd.testing.assert_frame_equal(whole, chunked, check_exact=True)
    assert len(shares) > 10 and shares[-1] == 1.0 and shares == sorted(shares)


def test_controller_that_returns_nan_is_named(storm_scene, turbine):
    class Broken(Delegate):
        def act(self, measurement):
            torque, pitch = super().act(measurement)
            return torque, float("nan") if measurement.time > 0.95 else pitch

    with pytest.raises(ControllerError, match=r"'Broken' returned .*nan.* at t = 1.000 s") as caught:
        run(storm_scene, controller=Broken(turbine, 0.1))
    assert caught.value.time == pytest.approx(1.0)
    assert caught.value.controller == "Broken"


# Stops


def test_capsize_stops_the_run_and_keeps_the_rows(still_scene):
    with pytest.raises(SimulationStopped, match="capsize") as caught:
        run(still_scene, initial={"PtfmPitch": 78.0, "PtfmRVyi": 20.0}, duration=60.0)
    stop = caught.value
    assert 0.0 < stop.time < 2.0 and "capsize" in stop.reason
    assert f"t = {stop.time:.3f} s" in str(stop)
    assert stop.frame["Time_[s]"].iloc[-1] <= stop.time
    assert stop.frame["Time_[s]"].iloc[-1] == pytest.approx(stop.time, abs=0.1 + 1e-9)
    assert stop.frame["PtfmPitch_[deg]"].iloc[0] == pytest.approx(78.0)


# The same again


def test_same_seed_gives_the_same_bits(storm_scene):
    options = dict(controller="pi", duration=8.0)
    first, second = run(storm_scene, **options), run(storm_scene, **options)
    pd.testing.assert_frame_equal(first, second, check_exact=True)
    again, other = (
        fowt_env.build_scene(
            "oc3_hywind", wind=18.0, sea=storm_scene.sea, seed=seed, duration=60.0, wave_components=60,
            fidelity="reference",
        )
        for seed in (3, 4)
    )  # fmt: skip
    pd.testing.assert_frame_equal(first, run(again, **options), check_exact=True)
    assert not np.array_equal(first["Wave1Elev_[m]"], run(other, **options)["Wave1Elev_[m]"])


STORM = """
import hashlib, fowt_env
scene = fowt_env.build_scene("oc3_hywind", wind={"kind": "ntm", "speed": 18.0}, seed=3, duration=60.0,
    sea={"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}, wave_components=60)
frame = fowt_env.simulate(scene, "pi", duration=8.0)
digest = hashlib.sha256(frame.to_numpy().tobytes()).hexdigest()
"""


def test_another_process_gives_the_same_bits():
    here = {}
    exec(STORM, here)
    assert fresh_python(STORM + "print(digest)") == here["digest"]
    assert here["frame"]["Wind1VelX_[m/s]"].std() > 0.1


STEPS = """
import numpy as np, fowt_env
from plant_helpers import random_state
from fowt_env.plant.advance import advance
scene = fowt_env.build_scene("oc3_hywind", wind=18.0, seed=3, duration=60.0, wave_components=20,
    sea={"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}, fidelity="reference")
x = random_state(np.random.default_rng(6))
status = advance(scene.handle(), x, np.array([4e4, 0.2]), 100, 3, 0.05)
"""


def test_kernels_are_plain_python_with_the_jit_off():
    here, program = {}, STEPS + "print(status, *(repr(float(v)) for v in x))"
    exec(STEPS, here)
    printed = fresh_python(program, paths=[Path(__file__).parent], NUMBA_DISABLE_JIT="1")
    plain = np.array(printed.split(), dtype=float)
    assert here["status"] == plain[0] == 0.0
    # the compiled functions of the mathematical library differ from Python's in some last bits
    assert np.allclose(plain[1:], here["x"], rtol=1e-11, atol=1e-13)


# Steps


def test_many_steps_are_one_step_many_times(wave_scene):
    x0, u = random_state(np.random.default_rng(1)), np.zeros(2)
    together, alone = x0.copy(), x0.copy()
    assert advance(wave_scene.handle(), together, u, 7, 40, 0.05) == 0
    handle = wave_scene.handle()
    for i in range(40):
        assert advance(handle, alone, u, 7 + i, 1, 0.05) == 0
    assert np.array_equal(together, alone)


def test_default_step_is_accurate_in_waves(wave_scene):
    options = dict(duration=60.0, output_dt=0.2, control_dt=0.2)
    coarse, fine = run(wave_scene, dt=0.1, **options), run(wave_scene, dt=0.0125, **options)
    for column in ("PtfmSurge_[m]", "PtfmPitch_[deg]"):
        assert np.abs(coarse[column] - fine[column]).max() < 1e-3 * np.ptp(fine[column])


# Response in waves


def harmonics(frame, column, period, orders=(1, 2)):
    """Amplitudes of the harmonics of a wave period, slow modes fitted away."""
    t = frame["Time_[s]"].to_numpy()
    keep = t >= 260.0
    t = t[keep]
    terms = [np.ones_like(t)]
    for p in (*(period / q for q in (1, 2, 3)), 125.0, 33.0, 31.0):
        terms += [np.cos(2 * np.pi * t / p), np.sin(2 * np.pi * t / p)]
    fit = np.linalg.lstsq(np.array(terms).T, frame[column].to_numpy()[keep], rcond=None)[0]
    return [np.hypot(fit[2 * q - 1], fit[2 * q]) for q in orders]


@pytest.mark.slow
def test_double_frequency_comes_from_position_and_from_surface():
    # theory.md, section 8: H = 3 m, T = 5 s; second over first harmonic of surge and pitch, per cent
    expected = {
        ("fixed", "swl"): (0.02, 0.02),
        ("instantaneous", "swl"): (0.34, 0.34),
        ("fixed", "instantaneous"): (0.60, 0.52),
        ("instantaneous", "instantaneous"): (0.92, 0.83),
    }
    measured = {}
    for position, surface in expected:
        scene = fowt_env.build_scene(
            "oc3_hywind",
            sea={"kind": "regular", "H": 3.0, "T": 5.0, "ramp": 50.0},
            kinematics_position=position,
            surface=surface,
            stretching="wheeler" if surface == "instantaneous" else "none",
            fidelity="reference",
        )
        frame = run(scene, duration=460.0, dt=0.1, control_dt=0.1, output_dt=0.1)
        surge, surge2 = harmonics(frame, "PtfmSurge_[m]", 5.0)
        pitch, pitch2 = harmonics(frame, "PtfmPitch_[deg]", 5.0)
        assert surge == pytest.approx(0.178, rel=0.01)
        assert pitch == pytest.approx(0.1035, rel=0.01)
        measured[position, surface] = (100.0 * surge2 / surge, 100.0 * pitch2 / pitch)
    for key, ratios in expected.items():
        assert measured[key] == pytest.approx(ratios, abs=0.05)
    for i in range(2):
        in_order = [measured[key][i] for key in expected]
        assert in_order == sorted(in_order)


@pytest.fixture(scope="module")
def steady():
    return fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard", duration=60.0)


def warnings_of(do):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        do()
    return [str(warning.message) for warning in caught]


@pytest.mark.parametrize("law", ["compiled", "function"])
@pytest.mark.parametrize(
    ("torque", "pitch", "words"),
    [(43093.0, 14.8, "14.8 rad = 848 deg"), (43.09, 0.26, "43.09 N m, 0.1 % of the rated")],
)
def test_commands_in_other_units_are_warned_of_compiled_or_not(law, torque, pitch, words, steady):
    given = Constant(torque, pitch) if law == "compiled" else lambda measurement: (torque, pitch)
    texts = warnings_of(lambda: run(steady, controller=given, duration=20.0))
    assert len([text for text in texts if words in text]) == 1, texts


@pytest.mark.parametrize(
    ("periods", "words"),
    [
        ({"control_dt": 0.03}, "control_dt = 0.03 s does not divide output_dt"),
        ({"output_dt": 0.07}, "output_dt = 0.07 s does not divide control_dt"),
        ({"control_dt": "x"}, "control_dt = 'x': must be a positive number"),
    ],
)
def test_a_period_that_does_not_fit_is_named_as_it_was_given(steady, periods, words):
    with pytest.raises(InputError, match=words):
        fowt_env.simulate(steady, "pi", duration=10.0, **periods)


def test_a_moment_beyond_the_limits_is_no_other_unit(steady):
    def law(measurement):  # 0.9 s at a time
        return (43093.0, 0.26) if measurement.time % 1.0 < 0.05 else (43093.0, 4.0)

    assert not warnings_of(lambda: run(steady, controller=law, duration=1.0))
    small = warnings_of(lambda: run(steady, controller=lambda m: (0.0, 0.3), duration=5.0))
    assert not [text for text in small if "commands are" in text]  # no torque is a command, not a unit


@pytest.mark.parametrize("controller", ["pi", "gspi_oc3", "lqr"])
def test_built_in_controllers_run_without_a_warning(controller, steady):
    texts = warnings_of(lambda: run(steady, controller=controller, duration=20.0))
    assert not texts


def test_a_run_says_for_how_long_its_torque_was_limited(steady):
    with pytest.warns(fowt_env.PlantWarning, match="limited for 4 of 4 s"):
        frame = run(steady, controller=lambda m: (60e3, 0.26), duration=4.0)
    assert frame.attrs["torque_limited"] == pytest.approx(4.0)
    assert run(steady, controller="pi", duration=4.0).attrs["torque_limited"] == 0.0


def test_a_table_beyond_the_memory_of_the_machine_is_refused(monkeypatch, steady):
    monkeypatch.setattr(simulation, "physical_memory", lambda: 1e6)
    with pytest.raises(InputError, match=r"duration = 60 s: a table of 601 rows.*0.000\d* GiB.*output_dt"):
        monkeypatch.setattr(simulation, "MOST_MEMORY", 0.2)
        run(steady, controller="pi", duration=60.0)
    run(steady, controller="pi", duration=2.0)
