"""Tasks: what is drawn, and which tasks are refused."""

from dataclasses import replace

import numpy as np
import pytest

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs import TASKS, FowtEnv, Task, task_tables
from fowt_env.envs.observations import DEFAULT, KNOWN, STANDARD, check_channels
from fowt_env.envs.rewards import REWARD_TERMS
from fowt_env.envs.tasks import task_of
from fowt_env.errors import InputError

WIND = {"kind": "ntm", "speed": (12.0, 24.0), "class": "B"}


def draws(task, n=200):
    rng = np.random.default_rng(3)
    return [task.draw(rng) for _ in range(n)]


@pytest.mark.parametrize(
    ("name", "low", "high"), [("above_rated", 12.0, 24.0), ("full_range", 4.0, 25.0), ("steady", 4.0, 25.0)]
)
def test_mean_winds_fill_their_range(name, low, high):
    speeds = np.array([episode.wind["speed"] for episode in draws(TASKS[name])])
    assert low <= speeds.min() < low + 0.05 * (high - low)
    assert high - 0.05 * (high - low) < speeds.max() <= high


def test_joint_sea_belongs_to_the_wind_of_the_episode():
    table = {12.0: (1.16, 7.25), 14.0: (1.34, 7.43), 24.0: (3.07, 9.01)}  # rows of gulf_of_maine_normal
    for episode in draws(TASKS["full_range"]):
        assert 0.83 <= episode.sea["Hs"] <= 3.07
        assert 6.9 <= episode.sea["Tp"] <= 9.01
    for speed, (height, period) in table.items():
        sea = (
            replace(TASKS["above_rated"], wind={"kind": "ntm", "speed": speed})
            .draw(np.random.default_rng(0))
            .sea
        )
        assert (sea["Hs"], sea["Tp"]) == pytest.approx((height, period), rel=1e-12)


def test_seeds_and_offsets_differ_between_episodes():
    episodes = draws(TASKS["above_rated"], 50)
    assert len({episode.weather_seed for episode in episodes}) == 50
    for name, (low, high) in TASKS["above_rated"].offsets.items():
        values = np.array([episode.offsets[name] for episode in episodes])
        assert np.all((values >= low) & (values <= high)) and np.ptp(values) > 0.5 * (high - low)


def test_numbers_without_range_are_kept():
    task = Task("fixed", wind=18.0, sea={"kind": "regular", "H": 3.0, "T": (5.0, 9.0), "heading": 30.0})
    episodes = draws(task, 20)
    assert {episode.wind for episode in episodes} == {18.0}
    assert all(e.sea["H"] == 3.0 and e.sea["heading"] == 30.0 for e in episodes)
    assert len({episode.sea["T"] for episode in episodes}) == 20
    assert task.fixed_wind and not TASKS["above_rated"].fixed_wind


MIXED = [(3.0, WIND, None), (1.0, {"kind": "eog", "speed": 14.0, "start": (5.0, 9.0)}, {"kind": "joint"})]


def test_a_mixture_draws_each_weather_by_its_share_and_within_its_own_ranges():
    task = Task("mixed", wind=MIXED)
    episodes = draws(task, 400)
    gusts = [episode for episode in episodes if episode.wind["kind"] == "eog"]
    assert 0.25 - 4.0 * 0.022 < len(gusts) / 400 < 0.25 + 4.0 * 0.022  # four standard deviations
    assert all(5.0 <= episode.wind["start"] <= 9.0 and episode.sea["Hs"] == 1.34 for episode in gusts)
    rest = [episode for episode in episodes if episode.wind["kind"] == "ntm"]
    assert len(rest) + len(gusts) == 400 and all(episode.sea is None for episode in rest)
    assert np.ptp([episode.wind["speed"] for episode in rest]) > 10.0
    assert task.has_sea and not task.fixed_wind
    assert not Task("calm", wind=[(1.0, 14.0, None), (1.0, 14.0, None)]).has_sea
    assert Task("calm", wind=[(1.0, 14.0, None), (1.0, 14.0, None)]).fixed_wind
    assert not Task("calm", wind=[(1.0, 14.0, None), (1.0, 15.0, None)]).fixed_wind


def test_a_mixture_runs_all_of_its_weathers_in_one_environment():
    env = FowtEnv(Task("mixed", wind=MIXED), rotor="table", wave_components=5, fidelity="standard")
    kinds = set()
    for seed in range(12):
        _, info = env.reset(seed=seed)
        kinds.add(info["sampled"]["wind"]["kind"])
        assert np.all(np.isfinite(env.step([0.0, 0.0])[0]))
    assert kinds == {"ntm", "eog"}


def test_lists_of_a_series_are_data_and_not_ranges():
    wind = {"kind": "series", "time": (0.0, 700.0), "speed": (10.0, 12.0)}
    assert Task("ramp", wind=wind).draw(np.random.default_rng(0)).wind is wind


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": ""}, "task.name"),
        ({"wind": None}, "needs a wind"),
        ({"wind": {"kind": "ntm", "speed": (12.0, 240.0)}}, "240.0: must be a number in"),
        ({"wind": {"kind": "ntm", "speed": (24.0, 12.0)}}, "low end must not exceed"),
        ({"wind": {"kind": "ntmm", "speed": 12.0}}, "Did you mean 'ntm'"),
        ({"sea": {"kind": "joint", "table": "gulf_of_main_normal"}}, "Did you mean 'gulf_of_maine_normal'"),
        ({"sea": {"kind": "jonswap", "Hs": (-1.0, 2.0), "Tp": 8.0}}, "Hs"),
        ({"sea": "papr_regular"}, "Did you mean 'paper_regular'"),
        ({"duration": 0.0}, "duration = 0.0: must be a number in"),
        ({"duration": float("nan")}, "duration = nan"),
        ({"observation": ("surge", "pitch_rate")}, "Did you mean 'platform_pitch_rate'"),
        ({"observation": ()}, "at least one channel"),
        ({"observation": "surge"}, "must be a list of channel names"),
        ({"weights": {"power": -1.0}}, "weight of power = -1.0"),
        ({"offsets": {"PtfmSurg": (0.0, 1.0)}}, "Did you mean 'PtfmSurge'"),
        ({"offsets": {"PtfmSurge": (1.0, 0.0)}}, "low end must not exceed"),
        ({"offsets": {"PtfmSurge": 1.0}}, "must be a pair"),
        ({"offsets": {"PtfmTVxi": (0.0, 1.0)}}, "unknown channel"),
        ({"blade_pitch": (10.0, -1.0)}, "low end must not exceed"),
        ({"setpoint": (0.5, float("inf"))}, "inf"),
        ({"residual_torque": 2.0}, "residual_torque = 2.0"),
        ({"residual_pitch": -1.0}, "residual_pitch = -1.0"),
        ({"wind": [(1.0, WIND)]}, r"wind\[0\] = .*must be \(share, wind, sea\)"),
        ({"wind": [(1.0, WIND, None), 14.0]}, r"wind\[1\] = 14.0: must be \(share, wind, sea\)"),
        ({"wind": [(0.0, WIND, None)]}, r"share of wind\[0\] = 0.0: must be a number in \(0, 1e\+06\]"),
        ({"wind": [(1.0, {"kind": "ntm", "speed": 120.0}, None)]}, "speed = 120.0"),
        ({"wind": [(1.0, WIND, None)], "sea": "paper_regular"}, "sea = 'paper_regular': must be None with"),
        ({"wind": [(1.0, {"kind": "box"}, None)]}, r"wind\[0\]: a box of full-field wind"),
        ({"wind_preview": (1.0, -2.0)}, "wind_preview = -2.0"),
        ({"wind_preview": 5.0}, "must be a list of times"),
    ],
)
def test_bad_tasks_name_the_key_and_what_is_allowed(changes, message):
    given = {"name": "mine", "wind": WIND} | changes
    with pytest.raises(InputError, match=message):
        Task(**given)


def test_default_among_the_channels_stands_for_the_task_s_own():
    assert check_channels("observation", (DEFAULT, "wind_speed"), STANDARD) == (*STANDARD, "wind_speed")
    assert check_channels("observation", ("yaw", DEFAULT), STANDARD)[0] == "yaw"
    assert len(check_channels("observation", KNOWN)) == len(KNOWN)


def test_tables_show_every_entry_and_every_term():
    task = replace(TASKS["above_rated"], observation=KNOWN, wind_preview=(2.0, 4.0))
    text = task_tables(task)
    for word in (*REWARD_TERMS, *STANDARD, "wind_preview_4s", "sin_azimuth", "47.40 kN m", "0 to 30 deg"):
        assert word in text


def test_tasks_are_those_of_the_nrel_5_mw_turbine():
    turbine = read_turbine("nrel5mw")
    assert all(task_of(name, turbine) is task for name, task in TASKS.items())


def test_tasks_are_scaled_to_a_larger_turbine():
    turbine = read_turbine("oc3_froude_10mw")
    above, full = task_of("above_rated", turbine), task_of("full_range", turbine)
    rated, cut_out = turbine.rated_wind_speed, turbine.cut_out_wind_speed
    assert above.wind["speed"] == pytest.approx((rated + 0.6, rated + 12.6))
    assert full.wind["speed"][1] == cut_out and turbine.cut_in_wind_speed < full.wind["speed"][0] < rated
    slower = turbine.rated_rotor_speed / read_turbine("nrel5mw").rated_rotor_speed
    assert above.offsets["RotSpeed"] == pytest.approx((-0.5 * slower, 0.5 * slower))
    # that drive turns a degree per turn of the rotor as fast, so that a degree costs what it did
    assert above.weights["pitch_travel"] == pytest.approx(TASKS["above_rated"].weights["pitch_travel"])
    mixed = task_of("above_rated_mixture", turbine)
    assert all(air["speed"] == above.wind["speed"] for _, air, _ in mixed.weathers)


def test_the_reach_of_the_blades_is_within_the_drive():
    turbine = read_turbine("nrel5mw")
    drive = turbine.pitch_drive.model_copy(update={"minimum": np.radians(1.0), "maximum": np.radians(25.0)})
    task = task_of("above_rated", turbine.model_copy(update={"pitch_drive": drive}))
    assert task.blade_pitch == pytest.approx((1.0, 25.0))
