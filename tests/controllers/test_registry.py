"""Names, import paths and objects that can be controllers, and what they may return."""

import functools
import pickle
import sys

import numpy as np
import pytest
from naive.turbine import turbine

from fowt_env import build_scene
from fowt_env.control import PRIVILEGED_INPUTS, USUAL_LIDAR, whole_view, with_wind_ahead
from fowt_env.controllers import CONTROLLERS, CheckedController, information, make
from fowt_env.controllers.constant import Constant
from fowt_env.controllers.policy.controller import shipped_agents
from fowt_env.descriptions.lidar import read_lidar
from fowt_env.errors import ControllerError, InputError
from fowt_env.plant.measurement import BladeMeasurement, Measurement

QUIET = Measurement(*[0.0] * len(Measurement._fields))
RATED = QUIET._replace(
    rotor_speed=1.267109, generator_speed=122.9096, generator_torque=43093.55, blade_pitch=0.2
)


BLADES = BladeMeasurement._make([0.0, 0.2, 0.2, 0.2, 6e6, 5e6, 4e6, *[0.0] * 7])
GATES = len(read_lidar(USUAL_LIDAR).distances)
# not part of the package: tests of them are skipped without the library
ROSCO = {"rosco", "rosco_float", "rosco_ipc"}
OSQP = {"lq_preview", "mpc", "mpc_lidar", "mpc_preview"}


class Steady:
    """A user's controller without constructor arguments."""

    def reset(self, measurement):
        self.pitch = measurement.blade_pitch

    def act(self, measurement):
        return 4e4, self.pitch


class Returning:
    """A user's controller that returns whatever it was given."""

    def __init__(self, answer):
        self.answer = answer

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return self.answer


@pytest.fixture(scope="module")
def scene():
    return build_scene("oc3_hywind", wind=18.0, duration=100.0, fidelity="standard")


def ahead(controller, measurement, wind=18.0):
    """The measurement with a steady wind at all times that the controller looks ahead, and with blades."""
    if controller.individual:
        return whole_view([*measurement, *BLADES._replace(azimuth=measurement.time)])
    if "lidar" in controller.information:
        return with_wind_ahead(measurement, [wind] * GATES + [0.75] * GATES)
    return with_wind_ahead(measurement, [wind] * len(controller.preview_times))


def prepared(name, scene):
    """A controller by name, told of a scene."""
    if name in ROSCO:
        pytest.importorskip("rosco", reason="needs the ROSCO library: pip install --no-deps rosco")
    if name in OSQP:
        pytest.importorskip("osqp", reason='OSQP is not installed: pip install "fowt-env[mpc]"')
    controller = make(name, turbine(), 0.1)
    controller.prepare(scene)
    return controller


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_every_controller_commands_within_the_turbines_limits(name, scene):
    controller = prepared(name, scene)
    rng = np.random.default_rng(4)
    wind = np.random.default_rng(5).uniform(0.0, 40.0, 500)
    controller.reset(ahead(controller, RATED))
    for k in range(500):
        speed, blade_pitch = rng.uniform(0.0, 200.0), rng.uniform(0.0, 1.5)
        m = RATED._replace(time=0.1 * k, generator_speed=speed, blade_pitch=blade_pitch)
        torque, *pitches = controller.act(ahead(controller, m, wind[k]))
        assert 0.0 <= torque <= 47402.91
        assert len(pitches) == (3 if controller.individual else 1)
        assert all(-1e-15 <= pitch <= 1.570796 for pitch in pitches)  # ROSCO's own limit is rounded


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_reset_forgets(name, scene):
    controller = prepared(name, scene)

    def run():
        controller.reset(ahead(controller, RATED))
        states = [RATED._replace(time=0.1 * k, generator_speed=120.0 + k) for k in range(50)]
        return [controller.act(ahead(controller, state)) for state in states]

    first = run()
    for k in range(200):
        controller.act(ahead(controller, RATED._replace(time=5.0 + 0.1 * k, generator_speed=140.0), 14.0))
    assert run() == first


@pytest.mark.parametrize("name", sorted(set(CONTROLLERS) - ROSCO))
def test_every_controller_of_ours_survives_pickling(name, scene):
    controller = prepared(name, scene)
    controller.reset(ahead(controller, RATED))
    controller.act(ahead(controller, RATED))
    twin = pickle.loads(pickle.dumps(controller))
    later = ahead(controller, RATED._replace(time=0.1, generator_speed=130.0))
    assert twin.act(later) == controller.act(later)


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_every_name_says_what_it_is_and_what_it_uses(name):
    assert CONTROLLERS[name].__doc__ and make(name, turbine(), 0.1).name == name
    used = information(name)
    assert used
    assert set(used) <= {*Measurement._fields, *BladeMeasurement._fields, *PRIVILEGED_INPUTS}


def test_a_scene_reaches_only_controllers_that_ask_for_it():
    class Asking(Steady):
        information = ("blade_pitch", "wind_preview")

        def prepare(self, scene):
            self.scene = scene

    asking = make(Asking, turbine(), 0.1)
    asking.prepare("a scene")
    assert asking.controller.scene == "a scene"
    assert asking.information == ("blade_pitch", "wind_preview")
    make(Steady, turbine(), 0.1).prepare("a scene")
    make("pi", turbine(), 0.1).prepare("a scene")


def test_constant_holds_what_was_measured_or_given():
    held = make("constant", turbine(), 0.1)
    held.reset(RATED)
    assert held.act(RATED._replace(generator_torque=0.0, blade_pitch=0.0)) == (43093.55, 0.2)
    given = Constant(torque=1e4)
    given.reset(RATED)
    assert given.act(QUIET) == (1e4, 0.2)
    with pytest.raises(InputError, match="blade_pitch = nan"):
        Constant(blade_pitch=float("nan"))


def test_an_unknown_name_gets_a_suggestion():
    with pytest.raises(InputError, match="unknown controller 'pi_lnad'. Did you mean 'pi_land'"):
        make("pi_lnad", turbine(), 0.1)


def test_a_name_that_is_cut_short_gets_the_one_that_it_begins():
    with pytest.raises(InputError, match="unknown controller 'gspi'. Did you mean 'gspi_oc3'"):
        make("gspi", turbine(), 0.1)


@pytest.mark.parametrize("name", shipped_agents())
def test_the_bare_name_of_an_agent_gets_its_full_one_as_suggestion(name):
    with pytest.raises(InputError, match=f"unknown controller '{name}'. Did you mean 'policy:{name}'"):
        make(name, turbine(), 0.1)


@pytest.mark.parametrize("control_dt", [0.0, 1.5, float("nan")])
def test_a_control_period_outside_its_range_is_refused(control_dt):
    with pytest.raises(InputError, match="control_dt"):
        make("pi", turbine(), control_dt)


def test_objects_and_classes_of_the_protocol_are_taken():
    for given in (Steady(), Steady):
        controller = make(given, turbine(), 0.1)
        controller.reset(RATED)
        assert controller.act(RATED) == (4e4, 0.2)
        assert controller.name == "Steady"
    compiled = Constant()
    assert make(compiled, turbine(), 0.1) is compiled


def test_a_class_that_takes_the_turbine_gets_it():
    class Tuned(Steady):
        def __init__(self, turbine, control_dt):
            self.given = turbine.name, control_dt

    assert make(Tuned, turbine(), 0.25).controller.given == ("published", 0.25)


def test_an_import_path_is_looked_for_in_the_working_folder(tmp_path, monkeypatch):
    (tmp_path / "my_own_law.py").write_text(
        "class Law:\n"
        "    def reset(self, measurement):\n        pass\n"
        "    def act(self, measurement):\n        return 1.0, measurement.blade_pitch\n"
        "def function(m):\n    return 2.0, m.blade_pitch\n"
    )
    monkeypatch.chdir(tmp_path)
    before = list(sys.path)
    controller = make("my_own_law:Law", turbine(), 0.1)
    controller.reset(RATED)
    assert controller.act(RATED) == (1.0, 0.2)
    assert controller.name == "my_own_law:Law"
    assert make("my_own_law:function", turbine(), 0.1).act(RATED) == (2.0, 0.2)
    assert sys.path == before
    with pytest.raises(InputError, match="'Lau'.*Did you mean 'Law'"):
        make("my_own_law:Lau", turbine(), 0.1)


@pytest.mark.parametrize("path", ["no_such_module_at_all:Law", "fowt_env.controllers.pi:", ":PI"])
def test_a_broken_import_path_is_named(path):
    with pytest.raises(InputError, match=path):
        make(path, turbine(), 0.1)


def test_things_that_are_no_controllers_are_refused():
    class NoAct:
        def reset(self, measurement):
            pass

    with pytest.raises(InputError, match="no method act"):
        make(NoAct(), turbine(), 0.1)
    with pytest.raises(InputError, match="no method reset"):
        make(3.0, turbine(), 0.1)
    with pytest.raises(InputError, match=r"must take \(turbine, control_dt\) or no arguments"):
        make(Returning, turbine(), 0.1)


@pytest.mark.parametrize(
    "answer",
    [
        (float("nan"), 0.1), (4e4, float("inf")), (4e4,), (4e4, 0.1, 0.2), 4e4, None, ("40000", "0.1"),
        (4e4, None), (4e4, [0.1, 0.2]), np.zeros((2, 1)),
    ],
)  # fmt: skip
def test_a_wrong_answer_names_controller_time_and_answer(answer):
    controller = make(Returning(answer), turbine(), 0.1)
    controller.reset(RATED)
    with pytest.raises(ControllerError) as caught:
        controller.act(RATED._replace(time=12.5))
    assert "'Returning'" in str(caught.value) and "12.500 s" in str(caught.value)
    assert repr(answer) in str(caught.value)
    assert (caught.value.controller, caught.value.time) == ("Returning", 12.5)
    assert caught.value.returned is answer


@pytest.mark.parametrize("answer", [(4e4, 0.1), [4e4, 0.1], np.array([4e4, 0.1]), (40000, np.float64(0.1))])
def test_two_finite_numbers_pass_the_check(answer):
    torque, pitch = CheckedController(Returning(answer)).act(RATED)
    assert (torque, pitch) == (4e4, 0.1)
    assert type(torque) is float and type(pitch) is float


def test_a_measurement_of_another_length_is_refused():
    controller = make("pi", turbine(), 0.1)
    controller.reset(RATED)
    with pytest.raises(InputError, match="measurement has shape"):
        controller.act(RATED[:-1])


def law_of_measurement(measurement):
    return 4e4, 0.2


def counting(turbine, control_dt):
    """A factory of laws that remember."""
    calls = []

    def law(measurement):
        calls.append(measurement.time)
        return 4e4, 0.01 * len(calls)

    return law


def test_a_function_of_the_measurement_is_a_controller():
    for given in (law_of_measurement, lambda m: (4e4, 0.2), functools.partial(law_of_measurement)):
        controller = make(given, turbine(), 0.1)
        controller.reset(RATED)
        assert controller.act(RATED) == (4e4, 0.2)
    assert make(law_of_measurement, turbine(), 0.1).name == "law_of_measurement"


def test_a_function_is_given_the_turbine_s_own_sensors_or_what_it_declares():
    def surging(measurement):
        return 4e4, measurement.surge

    with pytest.raises(ControllerError, match="'surging' reads 'surge'"):
        make(surging, turbine(), 0.1).act(RATED)
    surging.information = ("surge",)
    assert make(surging, turbine(), 0.1).act(RATED) == (4e4, RATED.surge)


def test_a_factory_stays_one_and_may_make_a_function():
    def of_turbine_alone(turbine, control_dt=0.2):
        return Returning((control_dt, 0.2))

    assert make(of_turbine_alone, turbine(), 0.1).act(RATED) == (0.1, 0.2)

    def by_name(turbine):  # a law's only argument would not be called so
        return 1.0, 2.0

    with pytest.raises(InputError, match="must take"):
        make(by_name, turbine(), 0.1)
    runs = [make(counting, turbine(), 0.1) for _ in range(2)]
    assert [run.act(RATED)[1] for run in runs for _ in range(2)] == [0.01, 0.02, 0.01, 0.02]


def test_an_error_of_a_controller_names_it_the_time_and_the_line():
    def failing(measurement):
        return {}["torque"]

    line = failing.__code__.co_firstlineno + 1
    with pytest.raises(ControllerError) as caught:
        make(failing, turbine(), 0.1).act(RATED._replace(time=3.5))
    words = f"'failing' raised KeyError in act() at t = 3.500 s, test_registry.py line {line}: 'torque'"
    assert words in str(caught.value)
    assert isinstance(caught.value.__cause__, KeyError) and caught.value.time == 3.5

    class Starting:
        def reset(self, measurement):
            raise OSError("no file")

        act = law_of_measurement

    with pytest.raises(ControllerError, match=r"'Starting' raised OSError in reset\(\) .*: no file"):
        make(Starting(), turbine(), 0.1).reset(RATED)

    class Mute(Exception):
        def __str__(self):
            raise RuntimeError

    def mute(measurement):
        raise Mute

    with pytest.raises(ControllerError, match="'mute' raised Mute in act"):
        make(mute, turbine(), 0.1).act(RATED)
