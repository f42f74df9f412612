"""The wind predicted from estimate and lidar: drawn weather beside the design, blindness, motion, the law."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("osqp", reason='OSQP is not installed: pip install "fowt-env[mpc]"')

from fowt_env import build_scene, simulate  # noqa: E402
from fowt_env.control.views import LidarReading  # noqa: E402
from fowt_env.controllers import make  # noqa: E402
from fowt_env.controllers.mpc import ahead as module  # noqa: E402
from fowt_env.controllers.mpc.ahead import Foresight, ages_of, covariances, fusion  # noqa: E402
from fowt_env.controllers.mpc.law import MPC  # noqa: E402
from fowt_env.controllers.mpc.settings import MPCSettings  # noqa: E402
from fowt_env.descriptions.lidar import Lidar, read_lidar  # noqa: E402
from fowt_env.weather.lidar import blocked_share  # noqa: E402
from fowt_env.weather.lidar_gates import Gates, lidar_gates  # noqa: E402
from fowt_env.weather.preview import exact_preview, rotor_wind_series  # noqa: E402

SPEED, HUB, RADIUS, PERIOD, COUNT = 18.0, 90.0, 63.0, 0.5, 30
FORGETTING = np.exp(-PERIOD / 240.0)
SMALL = Lidar(**read_lidar("four_beam_pulsed").model_dump() | {"distances": (90.0, 190.0)})
SEEDS = range(1001, 1009)


def drawn(seed, speed=SPEED):
    wind = {"kind": "ntm", "speed": speed, "class": "B"}
    return build_scene("oc3_hywind", wind=wind, seed=seed, duration=600.0, fidelity="standard")


@pytest.fixture(scope="module")
def weather():
    """(seeds) of (rotor's wind, readings (2 gates, n), fresh (n,)) every 0.5 s for 600 s, and the scene."""
    rows = []
    for seed in SEEDS:
        scene = drawn(seed)
        series, (start, wind, period) = lidar_gates(scene, SMALL).series, rotor_wind_series(scene)
        time = PERIOD * np.arange(1200)
        values = series.values[:, ::5][:, : time.size]
        rows.append((np.interp(time, start, wind, period=period), values[:2], values[2]))
    return rows, scene


def test_drawn_readings_have_the_covariances_of_the_design(weather):
    """Frequencies of sampling and shots one by one, independently coded; 8 records leave some 15 %."""
    rows, scene = weather
    blocked = blocked_share(SMALL, scene.turbine.rotor, scene.turbine.blade)
    steps = np.arange(-60, 61)
    known = covariances(SMALL, blocked, SPEED, HUB, RADIUS, PERIOD * steps)
    variance = known.rotor[60]

    def found(a, b):
        """E[a(t + lag) b(t)] of periodic records, without their slowest waves."""
        total = 0.0
        for record in zip(a, b, strict=True):
            first, second = (np.fft.rfft(x) / x.size for x in record)
            product = first * second.conj()
            product[0] = 0.0
            total = total + np.fft.irfft(product, record[0].size) * record[0].size
        return (total / len(a))[steps]

    wind = [row[0] for row in rows]
    for gate in range(2):
        reading = [row[1][gate] for row in rows]
        assert np.abs(found(reading, wind) - known.cross[gate]).max() < 0.15 * variance
        peak = steps[np.argmax(found(reading, wind))]
        assert abs(peak - steps[np.argmax(known.cross[gate])]) <= 1
        assert np.abs(found(reading, reading) - known.gates[gate, gate]).max() < 0.2 * variance
    near, far = ([row[1][gate] for row in rows] for gate in range(2))
    assert np.abs(found(far, near) - known.gates[1, 0]).max() < 0.15 * variance


def test_values_that_are_held_have_the_variance_of_the_wind_in_the_beam():
    """One beam, three shots of ten lost: what holding takes from each frequency it folds into others."""
    lidar = Lidar(**SMALL.model_dump() | {"azimuth": (15.0,), "elevation": (5.0,)})
    lags = np.array([0.0, 1.0])
    free, held = (
        covariances(Lidar(**lidar.model_dump() | {"scan_period": scan}), blocked, SPEED, HUB, RADIUS, lags)
        for scan, blocked in ((0.0, 0.0), (2.0, 0.3))
    )
    np.testing.assert_allclose(held.gates[:, :, 0], free.gates[:, :, 0], rtol=1e-9)
    assert held.gates[0, 0, 1] < 0.99 * held.gates[0, 0, 0]


def predictions(made, wind, readings, fresh, gates=2):
    """(n, COUNT) m/s of a Foresight that is given an estimate with the errors that it assumes."""
    law, rng, slow, rows = Foresight(made, gates, PERIOD, FORGETTING), np.random.default_rng(3), 0.0, []
    decay = np.exp(-PERIOD / module.SLOW_TIME)
    late = np.interp(np.arange(wind.size) - module.LATE / PERIOD, np.arange(wind.size), wind)
    for k in range(wind.size - COUNT):
        slow = decay * slow + np.sqrt(1.0 - decay**2) * module.SLOW_ERROR * rng.normal()
        estimate = late[k] + slow + module.FAST_ERROR * rng.normal()
        reading = LidarReading(tuple(readings[:, k]), (fresh[k],) * gates)
        rows.append(law.foresee(SPEED, estimate, 0.0, reading))
    return np.array(rows)


def errors(weather, lost):
    """RMS error (COUNT,) m/s of the predictions, given the function lost(fresh (n,)) of the shots."""
    rows, scene = weather
    made, squares = fusion(scene, SMALL, PERIOD, COUNT), []
    for wind, readings, fresh in rows[:4]:
        found = predictions(made, wind, readings, lost(fresh))
        coming = np.lib.stride_tricks.sliding_window_view(wind, COUNT)[: len(found)]
        squares.append(np.mean((found - coming)[100:] ** 2, axis=0))
    return np.sqrt(np.mean(squares, axis=0)), made


def expected_error(made, used, lidar=SMALL, speed=SPEED):
    """RMS error (COUNT,) m/s by the covariances of a Fusion, from the first `used` signals."""
    at = list(module.WINDS).index(speed)
    signals, with_wind = made.signals[at][:used, :used], made.ahead[at][:, :used]
    variance = covariances(lidar, 0.37, speed, HUB, RADIUS, np.array([0.0, 1.0])).rotor[0]
    explained = (with_wind * np.linalg.solve(signals, with_wind.T).T).sum(axis=1)
    return np.sqrt(variance + module.MEAN_DOUBT**2 - explained)


def test_predictions_err_as_little_as_their_covariances_say(weather):
    """1, 3, 6 and 10 s ahead; and far less than those from the estimate alone, blind lidar included."""
    seen, made = errors(weather, lambda fresh: fresh)
    blind, _ = errors(weather, lambda fresh: 0.0 * fresh)
    alone = expected_error(made, len(module.ESTIMATES))
    for k in (2, 6, 12, 20):
        assert seen[k] == pytest.approx(expected_error(made, None)[k], rel=0.12)
        assert blind[k] == pytest.approx(alone[k], rel=0.12)
    assert seen[6] < 0.8 * blind[6] and seen[12] < 0.75 * blind[12]


def test_a_lidar_that_goes_blind_loses_its_influence_gradually(weather):
    """Held readings off by 5 m/s: of the change that they would make, less and less is made."""
    rows, scene = weather
    made = fusion(scene, SMALL, PERIOD, COUNT)
    wind, readings, _ = rows[0]
    ends, fresh = 400, np.ones(wind.size)
    fresh[ends:] = 0.0
    stuck = np.where(np.arange(wind.size) < ends, readings, readings[:, [ends]] + 5.0)
    found, clean, alone = (
        predictions(made, wind, *given)
        for given in ((stuck, fresh), (readings, np.ones(wind.size)), (readings, 0.0 * fresh))
    )
    assert np.abs(np.diff(found[ends : ends + 60, 8] - clean[ends : ends + 60, 8])).max() < 1.5
    assert np.abs(found - clean)[ends - 50 : ends].max() < 1e-9
    gone = ends + round((module.MEMORY + 40.0) / PERIOD)
    assert np.abs(found - alone)[gone : gone + 100].max() < 0.1
    assert np.abs(clean - alone)[gone : gone + 100].max() > 0.5


def test_a_shot_lost_now_and_then_is_no_loss(weather):
    """Gaps of two scans are what the covariances have; one of 5 s is not."""
    rows, scene = weather
    made = fusion(scene, SMALL, PERIOD, COUNT)
    law = Foresight(made, 2, PERIOD, FORGETTING)
    for k in range(60):
        law.foresee(SPEED, 18.0, 0.0, LidarReading((18.0, 18.0), (float(k % 4 == 0),) * 2))
    assert not law.doubts.any()
    for _ in range(10):
        law.foresee(SPEED, 18.0, 0.0, LidarReading((18.0, 18.0), (1.0, 0.0)))
    assert not law.doubts[:2].any() and np.all(np.diff(law.doubts[2, :7]) < 0.0)


def test_the_motion_of_the_nacelle_is_taken_from_the_readings_that_it_was_in():
    """Readings of a steady wind from a swaying nacelle, as old as they are on average."""
    made = fusion(drawn(1), SMALL, PERIOD, COUNT)
    time = PERIOD * np.arange(400)
    velocity = np.sin(2.0 * np.pi * time / 12.0)
    in_reading = np.interp(time - made.age, time, velocity)
    found = {}
    for known in (0.0, 1.0):
        law = Foresight(made, 2, PERIOD, FORGETTING)
        rows = [
            law.foresee(SPEED, SPEED, known * moving, LidarReading((SPEED - seen,) * 2, (1.0, 1.0)))
            for moving, seen in zip(velocity, in_reading, strict=True)
        ]
        found[known] = np.array(rows)[100:]
    assert np.abs(found[1.0] - SPEED).max() < 0.1 < 0.3 * np.abs(found[0.0] - SPEED).max()


def test_an_offset_of_all_signals_shifts_the_prediction_and_one_of_the_lidar_is_removed():
    made = fusion(drawn(1), SMALL, PERIOD, COUNT)
    for estimate, reading, wanted, within in ((20.0, 20.0, 20.0, 0.15), (18.0, 20.0, 18.0, 0.05)):
        law = Foresight(made, 2, PERIOD, np.exp(-PERIOD / 20.0))
        for _ in range(400):
            found = law.foresee(SPEED, estimate, 0.0, LidarReading((reading, reading), (1.0, 1.0)))
        assert found == pytest.approx(np.full(COUNT, wanted), abs=within)


@pytest.mark.parametrize("period", [0.3, 0.5, 1.0])
def test_ages_reach_as_far_at_every_period(period):
    estimates, readings = ages_of(period)
    assert estimates[0] == readings[0] == 0
    assert estimates[-1] * period == pytest.approx(module.MEMORY, abs=0.5 * period)
    assert module.MEMORY - 2.0 * module.STEP < readings[-1] * period <= module.MEMORY + 0.5 * period


@pytest.mark.nightly
def test_the_page_has_the_errors_of_the_shipped_lidars():
    page = (Path(__file__).parents[3] / "docs" / "results" / "linear-design.md").read_text(encoding="utf-8")
    scene, ahead = drawn(1), [2, 6, 12, 20]
    lidars = [read_lidar(name) for name in ("four_beam_pulsed", "circular_cw")]
    made = [fusion(scene, lidar, PERIOD, COUNT) for lidar in lidars]
    for speed in (12.0, 18.0, 24.0):
        alone = expected_error(made[0], len(module.ESTIMATES), lidars[0], speed)[ahead]
        four, circle = (
            expected_error(*pair, speed)[ahead] for pair in zip(made, (None, None), lidars, strict=True)
        )
        cells = " | ".join(f"{x:.2f} / {y:.2f}" for x, y in zip(four, circle, strict=True))
        assert f"| {speed:g} m/s | estimate alone | {' | '.join(f'{x:.2f}' for x in alone)} |\n" in page
        assert f"| | with four beams / circular lidar | {cells} |\n" in page


# ---- the law


@pytest.fixture(scope="module")
def gusty():
    """Wind that rises and falls about 16 m/s, in still water."""
    time = np.arange(0.0, 131.0)
    speed = 16.0 + np.sin(0.3 * time) + 0.7 * np.sin(0.11 * time)
    series = {"kind": "series", "time": time.tolist(), "speed": speed.tolist()}
    return build_scene("oc3_hywind", wind=series, fidelity="standard")


@pytest.mark.nightly
def test_with_a_lidar_the_rotor_speed_varies_less_and_with_a_blind_one_as_without(gusty):
    seen = lidar_gates(gusty)
    values = seen.series.values.copy()
    values[10:] = 0.0
    values[:10] += 3.0
    blind = Gates(seen.lidar, seen.series._replace(values=values))
    runs = [
        simulate(gusty, name, duration=130.0, preview=preview)["RotSpeed_[rpm]"].iloc[500:].std()
        for name, preview in (("mpc", "exact"), ("mpc_lidar", "four_beam_pulsed"), ("mpc_lidar", blind))
    ]
    assert runs[1] < 0.8 * runs[0]
    assert runs[2] < 1.15 * runs[0]


def test_a_controller_prepared_by_hand_has_the_usual_lidar(gusty):
    law = make("mpc_lidar", gusty.turbine, 0.1)
    law.prepare(gusty)
    assert law.controller.gates == len(read_lidar("four_beam_pulsed").distances)
    assert law.information[-1] == "lidar" and law.preview_times == ()


@pytest.mark.nightly
def test_a_preview_that_is_off_for_good_ends_with_the_commands_of_the_true_one(gusty):
    """1 m/s too high, for 12 schedule times; almost without integral of the speed, which would hide it."""
    settings = MPCSettings(preview_time=3.0, schedule_time=10.0, mean_speed=1.0)

    def high(scene, leads):
        true = exact_preview(scene, leads)
        return true._replace(values=true.values + 1.0)

    runs = []
    for preview in ("exact", high):
        law = MPC(gusty.turbine, 0.1, settings, preview=True)
        runs.append(simulate(gusty, law, duration=130.0, preview=preview).iloc[-100:])
    for channel, within in (("BldPitch1_[deg]", 0.02), ("GenTq_[kN-m]", 0.02), ("RotSpeed_[rpm]", 0.02)):
        assert runs[1][channel].to_numpy() == pytest.approx(runs[0][channel].to_numpy(), abs=within)
