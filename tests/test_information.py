"""What a controller is given of a run: what it declares, through its sensors, and no weather ahead."""

import copy
import pickle

import numba
import numpy as np
import pandas as pd
import pytest
from laws import Recorder
from naive.preview import add_motion
from naive.sensors import NaiveSensors
from potential_body import made_up_body

import fowt_env
from fowt_env.control import (
    PRIVILEGED_INPUTS,
    MeasurementView,
    hidden,
    known_scene,
    make,
    view_of,
)
from fowt_env.controllers import CONTROLLERS
from fowt_env.descriptions.lidar import Lidar, read_lidar
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.sensors import Sensor, SensorChain, built_in_chains
from fowt_env.errors import ControllerError, InputError, SimulationStopped
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.measurement import (
    N_BLADE_MEASUREMENTS,
    N_MEASUREMENTS,
    SENSOR_FIELDS,
    BladeMeasurement,
    Measure,
    Measurement,
    measurement_rows,
)
from fowt_env.weather.lidar_gates import Gates, lidar_gates
from fowt_env.weather.preview import Motion, Preview, exact_preview, rotor_wind_series
from fowt_env.weather.sensor_noise import draw_noise

GUST = {"kind": "steps", "speeds": [17.0, 19.0, 16.0], "every": 10.0, "ramp": 4.0}
ROSCO = {"rosco", "rosco_float"}
INDIVIDUAL = {"ipc", "ipc_constrained", "ipc_floating", "rosco_ipc"}  # of scenes with pitch="individual"
ONES = Measurement(*[1.0 + i for i in range(N_MEASUREMENTS)])


@pytest.fixture(scope="module")
def gust_scene():
    return fowt_env.build_scene("oc3_hywind", wind=GUST, duration=60.0, fidelity="standard")


def run(scene, controller, **options):
    return fowt_env.simulate(scene, controller, **{"duration": 6.0} | options)


class Watcher:
    """The same in Python."""

    def __init__(self, information=None, preview_times=None):
        self.rows = []
        if information is not None:
            self.information = information
        if preview_times is not None:
            self.preview_times = preview_times

    def reset(self, measurement):
        self.first = np.array(measurement)

    def act(self, measurement):
        self.rows.append([*measurement, *getattr(measurement, "_ahead", ())])
        return 43093.55, 0.26


# Measurements


def test_a_compiled_law_reads_nothing_but_what_it_declares_and_the_time(gust_scene):
    """Of the command in force too; and the same of act(), called from Python."""
    some, every = Recorder(("rotor_speed", "blade_pitch")), Recorder(Measurement._fields)
    run(gust_scene, some)
    run(gust_scene, every)
    shown = [Measure.TIME, Measure.ROTOR_SPEED, Measure.BLADE_PITCH, N_MEASUREMENTS + 1]
    assert np.isnan(np.delete(some.seen(), shown, axis=1)).all()
    assert np.array_equal(some.seen()[:, shown], every.seen()[:, shown])
    assert np.isfinite(every.seen()).all()
    some.reset(ONES)
    some.act(ONES)
    assert np.flatnonzero(np.isfinite(some.seen()[0, :N_MEASUREMENTS])).tolist() == sorted(shown[:3])
    with pytest.raises(InputError, match=r"measurement has shape \(22,\): must be \(24,\)"):
        Recorder(("wind_preview",), (1.0, 2.0)).act(ONES)


def test_python_and_compiled_controllers_are_given_the_same(gust_scene):
    information, leads = ("surge", "rotor_speed", "wind_preview"), (2.0, 5.0)
    compiled, plain = Recorder(information, leads), Watcher(information, leads)
    one, other = run(gust_scene, compiled), run(gust_scene, plain)
    pd.testing.assert_frame_equal(one, other, check_exact=True)
    assert np.array_equal(compiled.seen()[:, :-2], np.array(plain.rows), equal_nan=True)


def test_what_a_python_controller_does_not_declare_raises_by_name_and_by_index(gust_scene):
    class Curious(Watcher):
        name = "curious"

        def act(self, measurement):
            return self.asks(measurement)

    for asks in (lambda m: m.wind_speed, lambda m: m[Measure.WIND_SPEED], lambda m: m[-2]):
        curious = Curious(("rotor_speed",))
        curious.asks = asks
        with pytest.raises(
            ControllerError, match=r"'curious' reads 'wind_speed' at t = 0.000 s.*information"
        ):
            run(gust_scene, curious)
    curious = Curious(("rotor_speed",))
    curious.asks = lambda m: m.wind_preview
    with pytest.raises(ControllerError, match="'wind_preview'.*preview_times"):
        run(gust_scene, curious)


def test_a_view_is_a_measurement_with_nan_for_the_rest():
    view = view_of(make(Watcher(("surge", "wind_preview"), (1.0,)), None, 0.1))([*ONES, 17.5])
    assert isinstance(view, Measurement) and isinstance(view, MeasurementView)
    assert view.surge == ONES.surge and view.time == ONES.time and view.wind_preview == (17.5,)
    values = np.array(view)
    shown = [Measure.TIME, Measure.SURGE]
    assert np.array_equal(np.flatnonzero(np.isfinite(values)), shown)
    assert view[Measure.SURGE] == ONES.surge and np.isnan(view[6:8]).all()
    later = view._replace(time=9.0)
    assert later.time == 9.0 and later.wind_preview == (17.5,)
    with pytest.raises(ControllerError, match="heave"):
        _ = later.heave
    for same in (copy.deepcopy(view), pickle.loads(pickle.dumps(view))):
        assert np.array_equal(np.array(same), values, equal_nan=True)
        assert same.wind_preview == (17.5,) and same.surge == view.surge
        with pytest.raises(ControllerError, match="reads 'heave' at t = 1.000 s"):
            _ = same.heave


def test_a_copied_view_has_the_blades_and_what_they_hide():
    declared = ("azimuth", "wind_preview")
    watcher = Watcher(declared, (1.0, 2.0))
    blades = list(range(N_BLADE_MEASUREMENTS))
    view = view_of(make(watcher, None, 0.1))([*ONES, 17.5, 18.5, *blades])
    for same in (copy.deepcopy(view), pickle.loads(pickle.dumps(view))):
        assert same.wind_preview == (17.5, 18.5) and same.blades.azimuth == blades[0]
        again = pickle.loads(pickle.dumps(same.blades))
        for kept in (same.blades, again):
            with pytest.raises(ControllerError, match="reads 'blade_pitch_1' at t = 1.000 s"):
                _ = kept.blade_pitch_1


def test_a_controller_that_declares_nothing_is_given_the_turbine_s_own_sensors(gust_scene):
    watcher = Watcher()
    run(gust_scene, watcher)
    shown = np.flatnonzero(np.isfinite(watcher.rows[3]))
    assert shown.tolist() == sorted(Measure[name.upper()] for name in SENSOR_FIELDS)
    assert not {"wind_speed", "wave_elevation", "surge"} & set(SENSOR_FIELDS)


def test_a_law_that_works_with_what_it_was_not_given_is_stopped_with_the_reason(gust_scene):
    class Leaky(Recorder):
        kernel = staticmethod(leak)

    with pytest.raises(SimulationStopped, match="command is not finite.*declare") as caught:
        run(gust_scene, Leaky(("rotor_speed",)))
    assert caught.value.time == 0.0


@control_kernel
def leak(parameters, memory, measurement, command):
    """Command with the wind."""
    command[0], command[1] = 40000.0, 0.01 * measurement[20]


@pytest.mark.parametrize("information", [("rotor_sped",), ("weather",)])
def test_an_unknown_name_is_refused(gust_scene, information):
    with pytest.raises(InputError, match="unknown information of controller 'Watcher'"):
        run(gust_scene, Watcher(information))


@pytest.mark.parametrize("name", sorted(set(CONTROLLERS) - ROSCO - INDIVIDUAL))
def test_every_built_in_controller_declares_all_that_it_uses(gust_scene, name):
    """Its run is that of one that is given everything."""
    honest = make(name, gust_scene.turbine, 0.1)
    told = make(name, gust_scene.turbine, 0.1)
    given = (*Measurement._fields, *(x for x in honest.information if x in PRIVILEGED_INPUTS))
    told.__class__ = type("Told", (type(told),), {"information": given})  # of some laws it is a property
    one, other = run(gust_scene, honest, duration=20.0), run(gust_scene, told, duration=20.0)
    pd.testing.assert_frame_equal(one, other, check_exact=True)
    assert np.isfinite(one.to_numpy()).all()


# The scene


class Asking(Watcher):
    def prepare(self, scene):
        self.scene = scene


def test_prepare_is_given_the_plant_without_its_weather_where_it_is_declared(storm_scene):
    asking = Asking(("rotor_speed", "plant_model"))
    fowt_env.simulate(storm_scene, asking, duration=0.5)
    known = asking.scene
    rated = storm_scene.turbine.rated_wind_speed
    assert (known.wind, known.wind_speed, known.sea, known.seed) == (rated, rated, None, 0)
    assert known.platform is storm_scene.platform and known.turbine is storm_scene.turbine
    wind, waves = known.model.aero.wind, known.model.hydro.waves
    assert wind.value.shape == (1, 5) and wind.value[0].tolist() == [rated, 0.0, 0.0, 0.0, 0.0]
    assert not waves.amplitude.any() and len(waves.omega) == 1


NTM, JONSWAP = "ntm:18:B", {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}
OTHER_SEA = {"kind": "jonswap", "Hs": 7.5, "Tp": 12.0, "gamma": 2.0, "heading": 20.0, "ramp": 15.0}
IN_PLANE, OBLIQUE = OTHER_SEA | {"heading": 180.0}, OTHER_SEA | {"heading": 60.0}
SHORT_CRESTED = {"omega": [0.5, 0.7], "amplitude": [1.0, 0.5], "heading": [0.0, 30.0]}
OWN_WIND = {"kind": "series", "time": [0.0, 5.0, 9.0, 300.0], "speed": [12.0, 14.0, 13.0, 12.0]}
SEMI, SPAR = "iea15_volturnus_s", "oc3_hywind"
KNOWN_KINDS = {  # platform, the wind and sea of two runs, options
    "reference": (SPAR, (NTM, NTM), (JONSWAP, OTHER_SEA), {"fidelity": "reference"}),
    "standard": (SPAR, (NTM, NTM), (JONSWAP, OTHER_SEA), {}),
    "fast": (SPAR, (NTM, NTM), (JONSWAP, OTHER_SEA), {"fidelity": "fast"}),
    "other waves": (SPAR, (18.0, 15.0), ("regular:3:5", "pierson_moskowitz:4"), {}),
    "white noise": (SPAR, (18.0, 18.0), (JONSWAP, {"kind": "components", "omega": [0.3, 0.5, 0.9],
                    "amplitude": [0.1, 0.1, 0.1]}), {}),
    "short crests": (SPAR, (18.0, 18.0), (SHORT_CRESTED | {"kind": "components", "phase": [0.3, 2.0]},
                     SHORT_CRESTED | {"kind": "components", "phase": [1.0, 1.5]}), {}),
    "diffraction": (SPAR, (NTM, NTM), (JONSWAP, OTHER_SEA), {"diffraction": "maccamy_fuchs"}),
    "diffraction by the plain sum": (SPAR, (NTM, NTM), (JONSWAP, OTHER_SEA),
                                     {"diffraction": "maccamy_fuchs", "wave_loads": "exact"}),
    "potential flow": (SEMI, (NTM, "etm:20:A"), (JONSWAP, OTHER_SEA), {"radiation": "none"}),
    "second order": (SPAR, (18.0, 18.0), (JONSWAP, OBLIQUE), {"second_order": "full"}),
    "second order, newman": (SPAR, (18.0, 18.0), (JONSWAP, OBLIQUE),
                             {"second_order": "newman", "excitation_position": "filtered"}),
    "filtered position": (SEMI, (NTM, NTM), (JONSWAP, OTHER_SEA), {"excitation_position": "filtered",
                                                                         "radiation": "none"}),
    "potential flow, plain sum": (SEMI, (NTM, NTM), (JONSWAP, OTHER_SEA), {"wave_loads": "exact",
                                                                                 "radiation": "convolution"}),
    "members": ("nrel5mw_oc4_semi", (NTM, NTM), (JONSWAP, OTHER_SEA), {"radiation": "none",
                "wave_components": 20}),
    "no air": (SPAR, (None, None), (JONSWAP, OTHER_SEA), {}),
    "no water": (SPAR, (NTM, NTM), (None, None), {"hydrodynamics": False}),
    "gusts": (SPAR, ({"kind": "eog", "speed": 14.0, "start": 50.0}, {"kind": "edc", "speed": 18.0}),
              (JONSWAP, OTHER_SEA), {}),
    "own series": (SPAR, (OWN_WIND, GUST), (JONSWAP, JONSWAP), {}),
    "box": (SPAR, ("box", "box"), (JONSWAP, OTHER_SEA), {}),
    "box, averaged": (SPAR, ("box", "box"), (JONSWAP, OTHER_SEA), {"fidelity": "fast"}),
    "planar": (SPAR, (NTM, NTM), (JONSWAP, IN_PLANE), {"planar": True}),
    "every option": (SPAR, (NTM, NTM), (JONSWAP, OTHER_SEA), {"tower": "modes", "pitch": "individual",
                     "dynamic_inflow": True, "current": 0.5, "mooring": "table", "loads": "own"}),
}  # fmt: skip


@fowt_env.load_kernel
def push(parameters, motion, force):
    force[0] = parameters[0]


def box_of(seed):
    """Random wind that no other seed has, of a speed of its own."""
    draw = np.random.default_rng(seed)
    y = np.linspace(-80.0, 80.0, 5)
    u = 14.0 + seed + draw.normal(size=(40, 5, 5))
    return {"kind": "box", "u": u, "y": y, "z": 90.0 + y, "dt": 0.5, "speed": 14.0 + seed, "periodic": True}


def known_bytes(platform, wind, sea, seed, options):
    wind = box_of(seed) if wind == "box" else wind
    given = {"fidelity": "standard", "duration": 100.0} | options
    if "second_order" in given:
        body = {"hull": None, "hydro": None, "potential_flow": made_up_body(), "draft": 120.0, "options": {}}
        platform = read_platform(platform).model_copy(update=body)
        given |= {"radiation": "none"}
    if "loads" in given:
        given["loads"] = [fowt_env.Load("Push", push, [1e3])]
    scene = fowt_env.build_scene(platform, wind=wind, sea=sea, seed=seed, **{"fidelity": "reference"} | given)
    known = known_scene(scene, Asking(("plant_model", "wind_preview")))
    assert numba.typeof(known.model) == numba.typeof(scene.model)  # so that nothing is compiled anew
    return pickle.dumps(known)


@pytest.mark.parametrize("kind", KNOWN_KINDS)
def test_what_prepare_is_given_is_the_same_in_every_weather(kind):
    """Its bytes: an array of a wave's phase in it would give away the seed, and with it the whole run."""
    platform, winds, seas, options = KNOWN_KINDS[kind]
    runs = [(winds[0], seas[0], 1), (winds[0], seas[0], 2), (winds[1], seas[1], 2)]
    first, *others = (known_bytes(platform, *run, options) for run in runs)
    assert len(first) > 1000 and others == [first, first]


def test_prepare_is_given_the_turbine_alone_where_it_is_not(storm_scene):
    asking = Asking(("rotor_speed",))
    fowt_env.simulate(storm_scene, asking, duration=0.5)
    assert asking.scene.turbine is storm_scene.turbine
    with pytest.raises(ControllerError, match="reads 'model' of prepare's scene.*'plant_model'"):
        _ = asking.scene.model


def test_a_controller_is_prepared_for_the_nominal_scene_where_there_is_one(gust_scene, storm_scene):
    asking = Asking(("plant_model",))
    run(gust_scene, asking, duration=0.5, nominal=storm_scene)
    assert asking.scene.platform is storm_scene.platform and asking.scene.sea is None


# The wind ahead


def test_the_preview_is_the_wind_of_then_at_every_control_instant(gust_scene):
    leads = (0.0, 1.25, 7.0)
    law = Recorder(("wind_preview",), leads, calls=300)
    run(gust_scene, law, duration=30.0)
    time, speed, _ = rotor_wind_series(gust_scene)
    seen = law.seen()
    wanted = [np.interp(seen[:, 0] + lead, time, speed) for lead in leads]
    np.testing.assert_allclose(seen[:, N_MEASUREMENTS:-2].T, wanted, rtol=0.0, atol=1e-9)
    assert np.ptp(wanted) > 2.0


def test_a_preview_of_ones_own_or_a_function_of_the_scene_takes_the_place_of_the_exact_one(gust_scene):
    own = Preview(np.array([0.0, 4.0]), np.array([[10.0, 14.0]]))
    law = Recorder(("wind_preview",), (3.0,))
    run(gust_scene, law, preview=own)
    assert law.seen()[:, N_MEASUREMENTS] == pytest.approx(np.minimum(10.0 + law.seen()[:, 0], 14.0))
    told = []

    def made(scene, times):
        told.append((scene, times))
        return exact_preview(scene, times)

    same = Recorder(("wind_preview",), (3.0,)), Recorder(("wind_preview",), (3.0,))
    run(gust_scene, same[0], preview=made)
    run(gust_scene, same[1])
    assert told == [(gust_scene, (3.0,))]
    assert np.array_equal(same[0].seen(), same[1].seen(), equal_nan=True)


def moving(corner):
    """A Preview of 15 m/s at two leads that the nacelle's motion gets into."""
    motion = Motion(corner, np.array([0.0, 0.37, 1.0]), np.array([0.5, 0.3, 0.2]), np.array([2.45, 0.0]))
    return Preview(np.array([0.0, 60.0]), np.full((2, 2), 15.0), motion)


@pytest.mark.parametrize("corner", [0.8, np.inf])
def test_the_nacelle_s_own_motion_gets_into_the_preview_of_a_lidar_on_it(gust_scene, corner):
    law = Recorder(("nacelle_velocity", "wind_preview"), (1.0, 4.0), calls=400)
    plain = Watcher(law.information, law.preview_times)
    for controller in (law, plain):
        run(gust_scene, controller, preview=moving(corner), duration=40.0)
    seen = law.seen()[:, :-2]
    wanted = add_motion(moving(corner), seen[:, 0], seen[:, Measure.NACELLE_VELOCITY])
    np.testing.assert_allclose(seen[:, N_MEASUREMENTS:].T, wanted, rtol=0.0, atol=1e-12)
    assert np.ptp(wanted) > 0.1
    assert np.array_equal(np.array(plain.rows), seen, equal_nan=True)


@pytest.mark.parametrize(
    "preview, message",
    [
        ("lidar", "unknown preview 'lidar'"),
        (7, "preview = 7: must be 'exact', the name of a lidar"),
        (Preview(np.zeros(2), np.zeros((1, 2))), "time must increase"),
        (Preview(np.arange(2.0), np.zeros((2, 2))), r"must be \(n,\) and \(1, n\)"),
        (Preview(np.arange(2.0), np.full((1, 2), np.nan)), "must be finite"),
    ],
)
def test_a_preview_that_cannot_be_used_is_refused(gust_scene, preview, message):
    with pytest.raises(InputError, match=message):
        run(gust_scene, Recorder(("wind_preview",), (3.0,)), preview=preview)


@pytest.mark.parametrize(
    "information, times, message",
    [
        (("wind_preview",), (), "declares 'wind_preview' and has no preview_times"),
        ((), (1.0,), "does not declare 'wind_preview'"),
        (("wind_preview",), (2.0, 1.0), "controller 'recorder': preview_times.*must increase"),
    ],
)
def test_times_and_the_declaration_of_a_preview_go_together(gust_scene, information, times, message):
    with pytest.raises(InputError, match=message):
        run(gust_scene, Recorder(information, times))


def swaying(lidar):
    """Gates of a lidar in 15 m/s, three shots of four fresh, that the nacelle's motion gets into."""
    count = len(lidar.distances)
    values = np.repeat([15.0, 0.75], count)[:, None] * np.ones(2)
    motion = Motion(np.inf, np.array([0.37]), np.ones(1), np.zeros(2 * count))
    return Gates(lidar, Preview(np.array([0.0, 60.0]), values, motion))


def test_a_lidar_is_read_gate_by_gate_and_the_nacelle_s_motion_gets_into_its_speeds_alone(gust_scene):
    lidar = Lidar(**read_lidar("four_beam_pulsed").model_dump() | {"distances": (90.0, 150.0, 200.0)})

    class Reader(Watcher):
        def act(self, measurement):
            reading = measurement.lidar
            assert np.array_equal(measurement._ahead, [*reading.speed, *reading.fresh])
            return super().act(measurement)

        def prepare(self, scene):
            self.known = scene

    law = Reader(("nacelle_velocity", "lidar"))
    run(gust_scene, law, preview=swaying(lidar), duration=20.0)
    rows = np.array(law.rows)
    assert law.known.lidar is lidar and rows.shape[1] == N_MEASUREMENTS + 6
    velocity = rows[:, Measure.NACELLE_VELOCITY]
    late = np.interp(rows[:, 0] - 0.37, rows[:, 0], velocity)
    for gate in range(3):
        np.testing.assert_allclose(rows[:, N_MEASUREMENTS + gate], 15.0 - late, rtol=0.0, atol=1e-12)
    assert np.ptp(late) > 0.1 and np.ptp(rows[:, N_MEASUREMENTS + 3 :] - 0.75) < 1e-12


def test_a_lidar_by_name_or_file_and_the_usual_one_where_none_is_given(gust_scene, tmp_path):
    path = tmp_path / "short.toml"
    path.write_text("azimuth = [0.0]\nelevation = [0.0]\ndistances = [60.0, 120.0]\nscan_period = 1.0\n")
    seen = {}
    for preview in ("exact", "four_beam_pulsed", "circular_cw", str(path)):
        law = Watcher(("lidar",))
        run(gust_scene, law, preview=preview, duration=2.0)
        seen[preview] = np.array(law.rows)[:, N_MEASUREMENTS:]
    assert [rows.shape[1] for rows in seen.values()] == [20, 20, 2, 4]
    assert np.array_equal(seen["exact"], seen["four_beam_pulsed"])
    series = lidar_gates(gust_scene, str(path)).series
    own, count = seen[str(path)].T, len(seen["exact"])
    np.testing.assert_allclose(own[2:], series.values[2:, :count], atol=1e-12)
    np.testing.assert_allclose(own[:2], series.values[:2, :count], atol=0.2)  # without the nacelle's motion


def test_a_compiled_law_reads_speeds_and_freshness_after_the_measurement(gust_scene):
    lidar = Lidar(**read_lidar("circular_cw").model_dump() | {"distances": (100.0,)})
    law = Recorder(("rotor_speed", "lidar"), leads=2)
    run(gust_scene, law, preview=swaying(lidar))
    seen = law.seen()[:, N_MEASUREMENTS : N_MEASUREMENTS + 2]
    assert seen[:, 1] == pytest.approx(0.75) and np.all(np.abs(seen[:, 0] - 15.0) < 1.0)


def test_the_lidar_is_hidden_unless_declared_and_goes_with_no_preview(gust_scene):
    curious = Watcher(("rotor_speed",))
    curious.act = lambda measurement: measurement.lidar
    with pytest.raises(ControllerError, match="reads 'lidar'.*add 'lidar' to its attribute information"):
        run(gust_scene, curious)
    with pytest.raises(InputError, match="declares 'wind_preview' and 'lidar'"):
        run(gust_scene, Watcher(("wind_preview", "lidar"), (1.0,)))
    with pytest.raises(InputError, match="preview = 7: must be a lidar"):
        run(gust_scene, Watcher(("lidar",)), preview=7)
    with pytest.raises(InputError, match="unknown lidar 'four_beam'"):
        run(gust_scene, Watcher(("lidar",)), preview="four_beam")


def test_in_still_air_there_is_nothing_to_look_ahead_at():
    with pytest.raises(InputError, match="needs a scene with wind"):
        run(fowt_env.build_scene("oc3_hywind", fidelity="reference"), Recorder(("wind_preview",), (1.0,)))


# Sensors


def test_a_field_that_the_chain_does_not_have_is_refused_where_it_is_declared(gust_scene):
    message = (
        "'recorder': declares 'surge', which the sensor chain 'standard' does not have; it has rotor_speed"
    )
    with pytest.raises(InputError, match=message):
        run(gust_scene, Recorder(("surge",)), sensors="standard")
    watcher = Watcher()
    run(gust_scene, watcher, sensors="standard")
    shown = {Measurement._fields[i] for i in np.flatnonzero(np.isfinite(watcher.rows[3]))}
    assert shown == set(SENSOR_FIELDS) & {"time", *built_in_chains()["standard"].available}
    assert np.isnan(hidden(make(watcher, None, 0.1))[Measure.SURGE])


EVERY = SensorChain(
    "every",
    {
        "rotor_speed": Sensor(noise=0.01, time_constant=0.3, delay=0.2, step=0.02),
        "generator_speed": Sensor(),
        "blade_pitch": Sensor(delay=0.5),
        "generator_torque": Sensor(step=1000.0),
        "platform_pitch": Sensor(time_constant=2.0),
        "nacelle_acceleration": Sensor(noise=0.05, delay=0.1),
        "nacelle_velocity": Sensor(integral_of="nacelle_acceleration", high_pass=0.3),
    },
)


@pytest.mark.parametrize("chain", [EVERY, built_in_chains()["standard"]], ids=["every", "standard"])
def test_readings_are_those_of_the_chain_taken_one_by_one(gust_scene, chain):
    true, read = Recorder(Measurement._fields, calls=200), Recorder(chain.available, calls=200)
    run(gust_scene, true, duration=20.0)
    frame = run(gust_scene, read, duration=20.0, sensors=chain)
    noise = {
        name: chain.sensors[name].noise if name in chain.sensors else 0.0 for name in Measurement._fields
    }
    drawn = draw_noise(np.array(list(noise.values())), gust_scene.seed, 200)
    twin = NaiveSensors(chain, 0.1, drawn)
    for measured, reading in zip(true.seen(), read.seen(), strict=True):
        wanted = twin.read(dict(zip(Measurement._fields, measured[:N_MEASUREMENTS], strict=True)))
        got = dict(zip(Measurement._fields, reading[:N_MEASUREMENTS], strict=True))
        for name in Measurement._fields:
            expected = pytest.approx(wanted.get(name, np.nan), rel=1e-12, abs=1e-12, nan_ok=True)
            assert got[name] == expected, name
    plain = run(gust_scene, Recorder((), calls=200), duration=20.0)
    pd.testing.assert_frame_equal(frame, plain, check_exact=True)


def test_exact_sensors_change_no_bit(storm_scene):
    frames = [run(storm_scene, "lqr", sensors=sensors) for sensors in (None, "exact", ALL_EXACT)]
    for frame in frames[1:]:
        pd.testing.assert_frame_equal(frames[0], frame, check_exact=True)


ALL_EXACT = SensorChain("all", {name: Sensor() for name in Measurement._fields if name != "time"})


def test_every_controller_and_every_length_of_run_meets_the_same_noise(gust_scene):
    short, long, plain = Recorder(("rotor_speed",)), Recorder(("rotor_speed",), calls=200), Watcher()
    run(gust_scene, short, sensors="standard")
    run(gust_scene, long, sensors="standard", duration=20.0)
    run(gust_scene, plain, sensors="standard")
    speed = short.seen()[:, Measure.ROTOR_SPEED]
    assert np.array_equal(speed, long.seen()[:60, Measure.ROTOR_SPEED])
    assert np.array_equal(speed, np.array(plain.rows)[:, Measure.ROTOR_SPEED])
    assert short.first.rotor_speed == speed[0]  # what reset is given is the first reading


def test_another_seed_has_other_noise():
    speeds = []
    for seed in (1, 2):
        scene = fowt_env.build_scene("oc3_hywind", wind=18.0, seed=seed, duration=60.0, fidelity="standard")
        law = Recorder(("rotor_speed",))
        run(scene, law, sensors="standard")
        speeds.append(law.seen()[:, Measure.ROTOR_SPEED])
    assert np.abs(speeds[0] - speeds[1]).max() > 1e-3


@pytest.mark.parametrize("of", [Measurement, BladeMeasurement])
def test_the_help_of_a_measurement_has_every_field_with_its_unit(of):
    rows = measurement_rows(of)
    assert [row[0] for row in rows] == list(of._fields)
    for name, unit, _, meaning, sensor in rows:
        assert any(
            line.split()[:1] == [name] and unit in line and meaning in line
            for line in of.__doc__.splitlines()
        )
        assert sensor in ("yes", "no")
    assert fowt_env.Measurement is Measurement
