"""What a preview that errs is worth: shares beside closed forms; the law without any, and with an offset."""

import numpy as np
import pytest

pytest.importorskip("osqp", reason='OSQP is not installed: pip install "fowt-env[mpc]"')

from fowt_env import build_scene, simulate  # noqa: E402
from fowt_env.controllers import make  # noqa: E402
from fowt_env.controllers.mpc.ahead import LearntShare  # noqa: E402
from fowt_env.controllers.mpc.law import MPC  # noqa: E402
from fowt_env.controllers.mpc.settings import PREVIEW  # noqa: E402
from fowt_env.weather.preview import exact_preview  # noqa: E402


@pytest.mark.parametrize("noise", [0.3, 1.0, 3.0])
def test_the_shares_are_those_of_least_error(noise):
    """A wind that forgets by a factor a per period, and a preview with white errors: g = V/(V + noise^2).

    V = 1 - a^2k is the error's variance of the prediction a^k v. 12 000 periods leave some 0.05 of a share.
    """
    a, periods, count = 0.95, 12_000, 7
    rng = np.random.default_rng(1)
    wind = np.zeros(periods + count)
    for i, white in enumerate(rng.standard_normal(periods + count - 1)):
        wind[i + 1] = a * wind[i] + np.sqrt(1.0 - a * a) * white
    share, sum_of_late = LearntShare(count, 0.999), np.zeros(count)
    for i in range(periods):
        expected = 10.0 + wind[i] * a ** np.arange(count)
        seen = 10.0 + wind[i : i + count] + noise * rng.standard_normal(count)
        found = share.learn(10.0 + wind[i], expected, seen - expected)
        if i >= periods // 4:
            sum_of_late += found
    error = 1.0 - a ** (2.0 * np.arange(count))
    assert sum_of_late / (periods - periods // 4) == pytest.approx(error / (error + noise**2), abs=0.05)


def test_what_few_seconds_show_gives_a_preview_little_share():
    """A wind that rises by 1 m/s where the preview said 3 would earn a third."""
    share = LearntShare(4, 0.99)
    assert not share.learn(10.0, np.full(4, 10.0), np.full(4, 3.0)).any()
    for _ in range(3):
        found = share.learn(11.0, np.full(4, 10.0), np.full(4, 3.0))
    assert found[0] == 0.0 and np.all((0.0 < found[1:]) & (found[1:] < 0.1))


@pytest.fixture(scope="module")
def gusty():
    """Wind that rises and falls about 16 m/s, in still water."""
    time = np.arange(0.0, 131.0)
    speed = 16.0 + np.sin(0.3 * time) + 0.7 * np.sin(0.11 * time)
    series = {"kind": "series", "time": time.tolist(), "speed": speed.tolist()}
    return build_scene("oc3_hywind", wind=series, fidelity="standard")


def test_without_a_share_the_law_is_that_without_a_preview(gusty, monkeypatch):
    monkeypatch.setattr(LearntShare, "learn", lambda self, now, expected, differing: 0.0 * differing)
    ours, plain = (simulate(gusty, name, duration=60.0) for name in ("mpc_lidar", "mpc"))
    for channel in ("GenTq_[kN-m]", "BldPitch1_[deg]", "RotSpeed_[rpm]"):
        assert ours[channel].to_numpy() == pytest.approx(plain[channel].to_numpy(), rel=1e-6)
    assert np.ptp(plain["BldPitch1_[deg]"]) > 1.0


def test_an_exact_preview_earns_its_share(gusty):
    scene = gusty
    blind, seer = make("mpc", scene.turbine, 0.1), MPC(scene.turbine, 0.1, PREVIEW, preview=True, exact=False)
    unseen, seen = (simulate(scene, one, duration=130.0).iloc[600:] for one in (blind, seer))
    for channel in ("RotSpeed_[rpm]", "PtfmPitch_[deg]"):
        assert seen[channel].std() < 0.95 * unseen[channel].std()
    travel = [run["BldPitch1_[deg]"].diff().abs().mean() for run in (unseen, seen)]
    assert travel[1] < 0.85 * travel[0]


def test_a_preview_that_is_off_for_good_ends_with_the_commands_of_the_true_one(gusty):
    """1 m/s too high, for 12 schedule times; without the integral of the speed, which would hide it."""
    settings = PREVIEW.changed(preview_time=3.0, schedule_time=10.0, speed_integral=1e-6)

    def high(scene, leads):
        true = exact_preview(scene, leads)
        return true._replace(values=true.values + 1.0)

    runs = []
    for preview in ("exact", high):
        law = MPC(gusty.turbine, 0.1, settings, preview=True)
        runs.append(simulate(gusty, law, duration=130.0, preview=preview).iloc[-100:])
    for channel, within in (("BldPitch1_[deg]", 0.02), ("GenTq_[kN-m]", 0.02), ("RotSpeed_[rpm]", 0.02)):
        assert runs[1][channel].to_numpy() == pytest.approx(runs[0][channel].to_numpy(), abs=within)
