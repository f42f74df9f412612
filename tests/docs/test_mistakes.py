"""What a newcomer's mistakes are answered with: each names what is wrong, and what to do."""

import pkgutil
import re
import sys
import warnings

import numpy as np
import pytest

import fowt_env
from fowt_env import errors
from fowt_env.descriptions.wind import ALL_KINDS
from fowt_env.envs.env import FowtEnv, ResetNeeded
from fowt_env.errors import ControllerError, InputError, PlantWarning

FINE = (43093.0, 0.26)  # N m, rad: of rated torque in 18 m/s


class Asked:
    """A controller that answers what a function of the measurement says."""

    def __init__(self, answer):
        self.answer = answer

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return self.answer(measurement)


@pytest.fixture(scope="module")
def scene():
    return fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard", duration=60.0)


def run(controller, **options):
    return lambda scene: fowt_env.simulate(scene, controller, **{"duration": 2.0} | options)


def answers(answer):
    return run(Asked(answer))


def built(**options):
    return lambda scene: fowt_env.build_scene("oc3_hywind", **{"fidelity": "standard"} | options)


def environment(act=None, **settings):
    """What happens in an environment, reset where something is done with it."""

    def mistake(scene):
        env = FowtEnv(platform="oc3_hywind", **settings)
        if act is not None:
            env.reset(seed=1)
            act(env)

    return mistake


def ended(env):
    """Steps to the end of an episode, and one more."""
    while not any(env.step(np.array([-1.0, -1.0]))[2:4]):
        pass
    env.step(np.zeros(2))


REFUSED = {  # mistake: (what is done with a scene, error, what the answer has to say)
    "nan": (answers(lambda m: (np.nan, 0.0)), ControllerError, "'Asked' returned (nan, 0.0) at t = 0.000 s"),
    "one number": (answers(lambda m: 3.0), ControllerError, "returned 3.0 two finite numbers N m rad"),
    "nothing": (answers(lambda m: None), ControllerError, "returned None two finite numbers"),
    "three numbers": (answers(lambda m: (1, 2, 3)), ControllerError, "returned (1, 2, 3)"),
    "typing error in act": (
        answers(lambda m: (m.generator_sped, 0.0)),
        ControllerError,
        "'Asked' t = 0.000 s test_mistakes.py no 'generator_sped' Did you mean 'generator_speed'",
    ),
    "field of single blades": (
        answers(lambda m: (m.azimuth, 0.0)),
        ControllerError,
        "no 'azimuth': it is measurement.blades.azimuth",
    ),
    "undeclared preview": (
        answers(lambda m: (m.wind_preview[0], 0.0)),
        ControllerError,
        "'wind_preview' does not declare information preview_times",
    ),
    "bug in act": (
        answers(lambda m: (1.0 / 0.0, 0.0)),
        ControllerError,
        "'Asked' raised ZeroDivisionError in act() t = 0.000 s division",
    ),
    "no reset": (run(type("X", (), {"act": lambda s, m: FINE})()), InputError, "no method reset(measurement"),
    "function of three": (
        run(lambda a, b, c: FINE),
        InputError,
        "(turbine, control_dt) no arguments function of the measurement (a, b, c)",
    ),
    "factory of one argument": (
        run(lambda machine: Asked(lambda m: FINE)),
        ControllerError,
        "two finite numbers a function that makes a controller takes two arguments, (turbine, control_dt)",
    ),
    "name of an agent": (run("ppo_lqr"), InputError, "'ppo_lqr' Did you mean 'policy:ppo_lqr'"),
    "weather that a scene lacks": (
        lambda scene: fowt_env.build_scene(fidelity="reference").with_weather(18.0, None, 0),
        InputError,
        "wind = 18.0: cannot gain use build_scene",
    ),
    "missing module": (run("nomod:X"), InputError, "'nomod:X' cannot import"),
    "duration 0": (run("pi", duration=0), InputError, "duration = 0 positive number of seconds"),
    "negative duration": (run("pi", duration=-5), InputError, "duration = -5"),
    "duration as text": (run("pi", duration="20"), InputError, "duration = '20'"),
    "endless duration": (run("pi", duration=1e9), InputError, "duration = 1e+09 s GiB output_dt (now 0.1 s)"),
    "a name for a scene": (
        lambda scene: fowt_env.simulate("oc3_hywind"),
        InputError,
        "scene = 'oc3_hywind': must be a Scene build_scene('oc3_hywind', wind=",
    ),
    "a name to trim": (lambda scene: fowt_env.trim("oc3_hywind"), InputError, "must be a Scene build_scene("),
    "a name to linearize": (
        lambda scene: fowt_env.linearize("oc3_hywind"),
        InputError,
        "must be a Scene build_scene(",
    ),
    "unit of a start": (
        run("pi", initial={"PtfmPitch_[rad]": 0.1}),
        InputError,
        "'PtfmPitch_[rad]' is in deg PtfmPitch_[deg]",
    ),
    "unit of a channel": (
        lambda scene: fowt_env.trim(scene)["RotSpeed_[rad/s]"],
        InputError,
        "'RotSpeed_[rad/s]' is in rpm",
    ),
    "negative wind": (built(wind=-5), InputError, "wind = -5 [0, 100] m/s"),
    "wind of 1000": (built(wind=1000), InputError, "wind = 1000 [0, 100] m/s"),
    "wind nan": (built(wind=np.nan), InputError, "wind = nan"),
    "wind in a list": (built(wind=[18]), InputError, "wind = [18]: KIND:SPEED[:CLASS]"),
    "wind without kind": (built(wind={"speed": 18}), InputError, "wind.kind " + " ".join(ALL_KINDS)),
    "turbulence class D": (built(wind="ntm:18:D"), InputError, "wind.class 'D' A+, A, B, C"),
    "kind of others": (built(wind={"kind": "turbsim"}), InputError, "'turbsim' called 'bts' .bts file"),
    "kind as a text": (built(wind="turbsim"), InputError, "ntm:18:B .bts .wnd .csv box of TurbSim"),
    "no such box": (built(wind="x.bts"), InputError, "'x.bts': no such file"),
    "no such table": (built(wind="x.csv"), InputError, "'x.csv': not found"),
    "sea without a number": (built(sea="jonswap:4"), InputError, "sea = 'jonswap:4' jonswap:Hs:Tp[:gamma]"),
    "unknown sea": (
        built(sea="oc3_5_9"),
        InputError,
        "'oc3_5_9' Did you mean 'oc3_5_ of 95 names fowt list seas jonswap:4:9 .toml",
    ),
    "negative height": (built(sea={"kind": "jonswap", "Hs": -4, "Tp": 9}), InputError, "Hs = -4 >= 0"),
    "keys in lower case": (
        built(sea={"kind": "jonswap", "hs": 4, "tp": 9}),
        InputError,
        "Did you mean 'Hs' Did you mean 'Tp'",
    ),
    "no period": (built(sea={"kind": "jonswap", "Hs": 4}), InputError, "Tp is missing"),
    "option": (built(foo=1), InputError, "option of build_scene 'foo'"),
    "task": (environment(task="x"), InputError, "task 'x' above_rated"),
    "reward term": (environment(reward={"x": 1}), InputError, "'x' failure"),
    "observation": (environment(observation=["x"]), InputError, "'x' Nearest of"),
    "action mode": (environment(action_mode="x"), InputError, "'x' direct residual setpoint"),
    "setting": (environment(frame_skip=2), InputError, "'frame_skip'"),
    "step before reset": (lambda scene: FowtEnv().step(np.zeros(2)), ResetNeeded, "reset()"),
    "shape of an action": (environment(lambda e: e.step(np.zeros(3))), InputError, "(3,) (2,)"),
    "scalar action": (environment(lambda e: e.step(0.0)), InputError, "() (2,)"),
    "nan in an action": (environment(lambda e: e.step([np.nan, 0.0])), InputError, "finite"),
    "text as an action": (environment(lambda e: e.step("x")), InputError, "'x' 2 numbers"),
    "batch of actions": (environment(lambda e: e.step(np.zeros((2, 2)))), InputError, "(2, 2) (2,)"),
    "step after the end": (environment(ended, duration=5.0), ResetNeeded, "reset()"),
}
EXTRAS = {  # library: a function of the package that needs it, and its arguments
    "stable_baselines3": ("fowt_env.training.rl.train:make_algorithm", ("ppo",)),
    "matplotlib": ("fowt_env.visual.style:new_figure", (1.0, 1.0)),
    "pygame": ("fowt_env.visual.rendering:load_pygame", ()),
}
WARNED = {  # mistake: (what is done, what the warning has to say)
    "degrees": (answers(lambda m: (43093.0, 14.8)), "'Asked' blade pitch 14.8 rad = 848 deg commands are"),
    "kN m": (answers(lambda m: (43.09, 0.26)), "'Asked' torque 43.09 N m 0.1 % of the rated 43094 N m"),
    "torque of the slow shaft": (answers(lambda m: (4.18e6, 0.26)), "9.7e+03 % of the rated"),
    "runaway": (run(lambda m: (0.0, 0.0), duration=20.0), "above the overspeed of 15.73 rpm protection="),
    "negative torque": (
        run(lambda m: (-43e3, 0.3), duration=2.0),
        "torque was limited for 2 of 2 s 47.4 kN m",
    ),
    "breaking waves": (built(sea="jonswap:20:4"), "Hs = 20 m Tp = 4 s steepness of 0.8 breaking 0.14"),
    "regular breaking waves": (built(sea="regular:4:4"), "H = 4 m T = 4 s steepness of 0.16"),
    "above cut-out": (built(wind="ntm:30:B"), "30 m/s above cut-out wind of 25 m/s"),
    "below cut-in": (built(wind=2.0), "2 m/s below cut-in wind of 3 m/s"),
}


def said(text, words):
    """Whether all words, which are parted by single blanks, are in a text in this order."""
    pattern = ".*?".join(re.escape(word) for word in words.split())
    return re.search(pattern, " ".join(text.split()))


@pytest.mark.parametrize("mistake", REFUSED)
def test_a_mistake_is_refused_with_what_is_wrong_and_what_to_do(mistake, scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    do, error, words = REFUSED[mistake]
    with pytest.raises(error) as caught:
        do(scene)
    assert said(str(caught.value), words), str(caught.value)


@pytest.mark.parametrize("library", EXTRAS)
def test_a_library_that_is_not_installed_is_named_with_its_extra(library, monkeypatch):
    function, arguments = EXTRAS[library]
    function = pkgutil.resolve_name(function)
    for loaded in [name for name in sys.modules if name.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=r"""pip install ['"]fowt-env\["""):
        function(*arguments)


@pytest.mark.parametrize("mistake", WARNED)
def test_what_can_hardly_be_meant_is_warned_of_once(mistake, scene, monkeypatch):
    monkeypatch.setattr(errors, "_issued", set())  # other tests of this process may have built the same
    do, words = WARNED[mistake]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        do(scene)
    texts = [str(warning.message) for warning in caught if warning.category is PlantWarning]
    assert len([text for text in texts if said(text, words)]) == 1, texts
