"""Computes what the page of fowt tune shows, as functions of a weather and one or two control laws.

Everything here runs without a browser. A run is repeated in the same wind and waves for each law, so its
differences are paired; paired() repeats that over validation seeds, which are never used for scoring.
"""

import re
import shlex
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.margins import Margins
from fowt_env.caches import Cache, cached
from fowt_env.control import CompiledController, make
from fowt_env.control.information import known_scene
from fowt_env.controllers.design.linearised import sampled_loop
from fowt_env.controllers.design.saved_files import PI_KEYS, lqr_settings, save_design
from fowt_env.controllers.gspi import GSPI
from fowt_env.controllers.lqr.design import design_models
from fowt_env.controllers.pi import PI
from fowt_env.controllers.registry import CONTROLLERS
from fowt_env.descriptions.checks import check_number, check_whole_number, parse_number
from fowt_env.descriptions.sea_state import sea_of
from fowt_env.descriptions.wind import wind_of
from fowt_env.errors import InputError, PlantWarning, SimulationStopped, unknown
from fowt_env.plant.state import MOTIONS
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.scene.scene import Scene
from fowt_env.training.design.tune import FACTORS, Space, scaled_pi, spaces
from fowt_env.training.evaluation.bootstrap import case_means, interval, resample_weights
from fowt_env.training.evaluation.metric_names import SHORT
from fowt_env.training.evaluation.metrics import METRICS, better, mean_exponent, turbine_metrics
from fowt_env.training.evaluation.seeds import VALIDATION
from fowt_env.training.reports.verdict import percent_text
from fowt_env.visual.time_series import TIME, spectrum

CONTROL_DT = 0.1  # s
SKIP = 60.0  # s at the start of a run that is not scored, as in the suites
LEAST_WAVES = 700.0  # s, length of the weather of shorter runs, as in fowt simulate
DURATIONS = (120.0, 3660.0)  # s, of a run
SERIES_STEP = 0.5  # s, over which the drawn series are averaged
SPECTRUM_RANGE = (0.003, 0.5)  # Hz
RESPONSE_TIME, EVENT = 150.0, 20.0  # s: length of a response, start of the step or gust
STEP = 1.0  # m/s
EVERY = 2  # samples between drawn ones of a response
SERIES = (
    ("wind (m/s)", "Wind1VelX_[m/s]"), ("wave (m)", "Wave1Elev_[m]"),
    ("rotor speed (rpm)", "RotSpeed_[rpm]"), ("platform pitch (deg)", "PtfmPitch_[deg]"),
    ("blade pitch (deg)", "BldPitch1_[deg]"), ("power (kW)", "GenPwr_[kW]"),
    ("generator torque (kN m)", "GenTq_[kN-m]"), ("tower-base moment (kN m)", "TwrBsMyt_[kN-m]"),
)  # fmt: skip
SPECTRA = SERIES[2:5] + SERIES[7:]
RESPONSES = SERIES[2:5]
MOTION = {  # entry of the film: channel
    "surge": "PtfmSurge_[m]", "heave": "PtfmHeave_[m]", "pitch": "PtfmPitch_[deg]",
    "azimuth": "Azimuth_[deg]", "blade": "BldPitch1_[deg]", "speed": "RotSpeed_[rpm]",
}  # fmt: skip
SHOWN = (
    "RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]", "GenPwr_std_[kW]",
    "torque_travel_[kN-m/s]", "RotTorq_DEL_[kN-m]", "TwrBsMyt_DEL_[kN-m]", "FAIRTEN_DEL_[kN]",
    "RootMyb_DEL_[kN-m]", "GenPwr_capped_mean_[kW]", "RotSpeed_max_[rpm]",
)  # fmt: skip
_SCENES, _MODELS, _RUNS, _PICTURES, _FIGURES = Cache(24), Cache(16), Cache(16), Cache(16), Cache(256)


@dataclass(frozen=True)
class Weather:
    """Holds the conditions of a run: platform, wind and sea as texts of fowt simulate, seed, duration (s).

    Raises: InputError naming the key, value and allowed range.
    """

    platform: str = "oc3_hywind"
    wind: str = "ntm:14:B"
    sea: str = "jonswap:3.6:9.4"
    seed: int = 1001
    duration: float = 660.0

    def __post_init__(self):
        check_whole_number("seed", self.seed, 0)
        check_number("duration", self.duration, *DURATIONS)
        if wind_of(self.wind) is None:
            raise InputError(f"wind = {self.wind!r}: a controller is tuned in a wind")
        sea_of(self.sea)

    def scene(self) -> Scene:
        """Return the scene of the conditions, at fidelity standard. Raises: InputError."""
        return _SCENES.get(self, self._build)

    def _build(self):
        weather = {"wind": wind_of(self.wind), "sea": sea_of(self.sea), "seed": self.seed}
        return build_scene(self.platform, duration=max(LEAST_WAVES, self.duration), **weather)


@dataclass(frozen=True)
class Law:
    """Holds a controller's name and its changed settings ((key, value), ...), sorted."""

    controller: str = "pi"
    settings: tuple[tuple[str, float], ...] = ()

    def __str__(self):
        """Return the text that law_of reads: pi[KP=1.2,KI=0.9]."""
        if not self.settings:
            return self.controller
        return f"{self.controller}[{','.join(f'{key}={value:.6g}' for key, value in self.settings)}]"


def law_of(text: str) -> Law:
    """Return the Law of a text, NAME or NAME[KEY=VALUE,...]. Raises: InputError naming key, value, range."""
    found = re.fullmatch(r"([^\[]+)(?:\[(.*)\])?", text.strip(), re.S)
    if not found:
        raise InputError(f"controller {text!r}: must be NAME or NAME[KEY=VALUE,...]")
    name, rest = found.groups()
    known, settings = tunable(name), {}
    for pair in (rest or "").split(",") if rest else ():
        key, sign, number = (part.strip() for part in pair.partition("="))
        value = parse_number(number)
        if not sign or value is None:
            raise InputError(f"controller {text!r}: {pair!r}: must be KEY=VALUE with a number")
        if known is None:
            raise InputError(f"controller {name!r}: has no settings here; with settings: {', '.join(laws())}")
        if key not in known.ranges:
            raise unknown(f"setting of {name}", key, known.ranges)
        settings[key] = check_number(f"{name} {key}", value, *known.ranges[key])
    return changed(Law(name), settings)


def changed(law: Law, settings: Mapping[str, float]) -> Law:
    """Return the Law with exactly these settings, without those at their start."""
    start = known.start if (known := tunable(law.controller)) else {}
    kept = {key: float(value) for key, value in settings.items() if value != start.get(key)}
    return replace(law, settings=tuple(sorted(kept.items())))


@cached(1)
def laws() -> dict[str, Space]:
    """Return {name: Space} of the controllers with sliders: settings, ranges, start and maker."""
    ones = dict.fromkeys(FACTORS, 1.0)
    own = {
        "pi": Space(FACTORS, ones, lambda s, t, dt: PI(scaled_pi(s, t), dt, "pi")),
        "gspi_oc3": Space(FACTORS, ones, lambda s, t, dt: GSPI(scaled_pi(s, t), dt, "gspi_oc3")),
    }
    return own | spaces()


def tunable(name: str) -> Space | None:
    """Return the Space of a controller with sliders, None for another."""
    return laws().get(name)


def choices(further: tuple[str, ...] = ()) -> list[str]:
    """Return the names that the page offers: laws with sliders, further built-in ones, and given names."""
    return list(dict.fromkeys((*laws(), *CONTROLLERS, *further)))


def settings_of(law: Law) -> dict[str, float]:
    """Return {key: value} of all settings of a law with sliders, {} for another."""
    known = tunable(law.controller)
    return {} if known is None else dict(known.start) | dict(law.settings)


def made(law: Law, scene: Scene) -> Any:
    """Return a new controller of the law for a scene. Raises: InputError for settings out of range."""
    if not law.settings:
        return make(law.controller, scene.turbine, CONTROL_DT)
    return tunable(law.controller).make(settings_of(law), scene.turbine, CONTROL_DT)


class Picture(NamedTuple):
    """Holds what is drawn first of a run."""

    series: dict[str, np.ndarray]  # "time" and channels, means over SERIES_STEP
    film: dict[str, np.ndarray]  # "time" and entries of MOTION, for the moving turbine
    note: str  # why the run ended early or cannot be meant, "" for a good one


def run(weather: Weather, law: Law) -> tuple[pd.DataFrame, str]:
    """Return (DataFrame of a run of a law in a weather, what is wrong with it or ""), which is kept.

    Raises: InputError for a weather or law that cannot be built.
    """
    return _RUNS.get((weather, law), lambda: _frame(weather.scene(), law, weather.duration))


def picture(weather: Weather, law: Law) -> Picture:
    """Return the Picture of a run, which is kept; single precision, as it is sent to the page."""

    def make():
        frame, note = run(weather, law)
        parts = _means(frame, [channel for _, channel in SERIES], SERIES_STEP), _film(frame)
        return Picture(*({key: x.astype(np.float32) for key, x in part.items()} for part in parts), note)

    return _PICTURES.get((weather, law), make)


def figures(weather: Weather, law: Law) -> dict[str, float]:
    """Return {metric: value} of a run after SKIP; NaN for a run with a note."""
    frame, note = run(weather, law)
    if note:
        return dict.fromkeys(METRICS, np.nan)
    return _FIGURES.get((weather, law), lambda: turbine_metrics(frame, weather.scene().turbine, SKIP))


def _frame(scene, law, duration):
    """Return (DataFrame of a run, what is wrong with it or ""); it ends at overspeed, as evaluated ones."""
    ending = {"control_dt": CONTROL_DT, "protection": "end_at_overspeed"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlantWarning)  # the note says what concerns the law
        try:
            frame = simulate(scene, made(law, scene), duration, **ending)
        except SimulationStopped as error:
            return error.frame, str(error)
    return frame, frame.attrs["doubtful_commands"]


def _means(frame, names, step):
    """Return {"time", channel: means over blocks of a step (s)} of the channels that a run has."""
    block = max(1, round(step / CONTROL_DT))
    count = len(frame) // block

    def means(name):
        return frame[name].to_numpy()[: count * block].reshape(count, block).mean(axis=1)

    return {"time": means(TIME)} | {name: means(name) for name in names if name in frame.columns}


def _film(frame):
    """Return the motions at SERIES_STEP; the azimuth unwrapped, in degrees."""
    rows = frame.iloc[:: round(SERIES_STEP / CONTROL_DT)]
    film = {key: rows[channel].to_numpy() for key, channel in MOTION.items()}
    film["azimuth"] = np.unwrap(film["azimuth"], period=360.0)
    film |= {"time": rows[TIME].to_numpy(), "wave": rows["Wave1Elev_[m]"].to_numpy()}
    return film | {"wind": rows["Wind1VelX_[m/s]"].to_numpy()}


def spectra(weather: Weather, law: Law) -> dict[str, np.ndarray]:
    """Return {"frequency" (Hz), channel: power spectral density} of SPECTRA after SKIP, by Welch's method."""
    frame, _ = run(weather, law)
    scored = frame[frame[TIME] >= SKIP]
    if len(scored) < 16:
        return {"frequency": np.empty(0)} | {channel: np.empty(0) for _, channel in SPECTRA}
    result = {}
    for _, channel in SPECTRA:
        frequency, density = spectrum(scored[TIME], scored[channel])
        inside = (frequency >= SPECTRUM_RANGE[0]) & (frequency <= SPECTRUM_RANGE[1])
        result["frequency"], result[channel] = frequency[inside], density[inside]
    return result


class Linear(NamedTuple):
    """Holds the linear closed loop of a law at the mean wind."""

    poles: np.ndarray  # rad/s, complex
    margins: Margins | None  # None: the law moves no command
    note: str  # why there is no linear loop, "" where there is one
    least: complex = 0.0  # rad/s, pole of the least damped slow oscillation
    motion: str = ""  # its largest motion of the hull


def linear(weather: Weather, law: Law) -> Linear:
    """Return the Linear closed loop of a law at the mean wind of a weather, in still water."""
    scene = weather.scene()
    controller = made(law, scene)
    if not isinstance(controller, CompiledController):
        return Linear(np.empty(0, complex), None, "no fixed compiled law, so no linear loop")
    controller.prepare(known_scene(scene, controller))
    key = (weather.platform, scene.wind_speed)
    try:
        model = _MODELS.get(key, lambda: linearize(scene, wind=scene.wind_speed))
        if model.pitch_rests:
            return Linear(np.empty(0, complex), None, "below rated the blade pitch rests, the loop is open")
        loop = sampled_loop(model, controller, CONTROL_DT)
    except (InputError, SimulationStopped) as error:
        return Linear(np.empty(0, complex), None, str(error))
    poles, vectors = loop.modes()
    swinging = np.flatnonzero((poles.imag > 1e-3) & (np.abs(poles) < 3.0))
    least = min(swinging, key=lambda i: -poles[i].real / abs(poles[i]))
    sizes = np.abs(vectors[: len(MOTIONS), least]) * ([1.0] * 3 + [model.arm] * 3)  # positions come first
    motion = MOTIONS[int(np.argmax(sizes))].replace("_", " ")
    return Linear(poles, loop.margins(), "", poles[least], motion)


def loop_words(loop: Linear) -> list[tuple[str, str]]:
    """Return [(quantity, text)] of a Linear loop."""
    keys = (
        "stable",
        "gain margin",
        "phase margin (deg)",
        "delay margin (s)",
        "sensitivity peak",
        "least damping",
    )
    if loop.margins is None:
        return [(key, loop.note if key == "stable" else "–") for key in keys]
    found, least = loop.margins, loop.least
    pitch = found.loops.get("blade_pitch_command") if found.stable else None  # else there are no margins
    values = (
        "yes" if found.stable else "NO",
        _margin(pitch.gain, ".3g", pitch.gain_frequency) if pitch else "–",
        _margin(pitch.phase, ".1f", pitch.phase_frequency) if pitch else "–",
        _margin(pitch.delay, ".2f") if pitch else "–",
        _margin(found.sensitivity_peak, ".2f", found.peak_frequency) if found.stable else "–",
        f"{_margin(-least.real / abs(least), '.2g', abs(least))}, {loop.motion}",
    )
    return list(zip(keys, values, strict=True))


def _margin(value, style, frequency=None):
    """Return a margin as a text, with the frequency (rad/s) at which it is found."""
    if np.isinf(value):
        return "unlimited"
    return f"{value:{style}}" if frequency is None else f"{value:{style}} at {frequency:.2g} rad/s"


def responses(weather: Weather, law: Law) -> dict[str, np.ndarray]:
    """Return {"time", "step CHANNEL", "gust CHANNEL"} of RESPONSES in still water.

    A step of STEP and an extreme operating gust of class B about the mean wind, both at EVENT.
    """
    scene, result = weather.scene(), {}
    mean = scene.wind_speed
    winds = {
        "step": {"kind": "steps", "speeds": [mean, mean + STEP], "every": EVENT},
        "gust": {"kind": "eog", "speed": mean, "start": EVENT},
    }
    for event, wind in winds.items():
        still = build_scene(weather.platform, wind=wind)
        frame, _ = _frame(still, law, RESPONSE_TIME)
        whole = frame.reindex(range(round(RESPONSE_TIME / CONTROL_DT)))  # NaN after an early end
        result["time"] = np.arange(len(whole))[::EVERY] * CONTROL_DT - EVENT
        result |= {f"{event} {channel}": whole[channel].to_numpy()[::EVERY] for _, channel in RESPONSES}
    return result


class Ratio(NamedTuple):
    """Holds the ratio of a metric of two laws over some seeds, and its 95 % interval (NaN: too few)."""

    first: float
    second: float
    ratio: float
    low: float
    high: float

    @property
    def is_sure(self) -> bool:
        """Return whether the interval excludes equality."""
        return bool(self.low > 1.0 or self.high < 1.0)


def paired(first: list[dict[str, float]], second: list[dict[str, float]]) -> dict[str, Ratio]:
    """Return {metric: Ratio second / first} of SHOWN from the figures of two laws on the same seeds.

    Means over seeds and intervals are those of the leaderboard: cluster bootstrap of seeds, power means.
    """
    names = [name for name in SHOWN if all(np.isfinite(each[name]) for each in (*first, *second))]
    result = {}
    if not names:
        return result
    powers = np.array([mean_exponent(name) for name in names])
    one, two = (np.array([[each[name] for name in names] for each in runs]) for runs in (first, second))
    n = len(one)
    with np.errstate(all="ignore"):

        def ratios(weights):
            means = [case_means(values**powers, weights) ** (1.0 / powers) for values in (one, two)]
            return means[0], means[1], means[1] / means[0]

        a, b, ratio = (part[0] for part in ratios(np.ones((1, n))))
        low, high = interval(ratio, ratios(resample_weights(n))[2], n, positive=True)
    for i, name in enumerate(names):
        result[name] = Ratio(*(float(part[i]) for part in (a, b, ratio, low, high)))
    return result


def further_seeds(weather: Weather, count: int) -> list[Weather]:
    """Return the weather with its own and the next validation seeds, `count` in all."""
    first = weather.seed
    others = [seed for seed in range(VALIDATION.start + 1, VALIDATION.start + 1 + count) if seed != first]
    return [weather, *(replace(weather, seed=seed) for seed in others[: count - 1])]


def verdict(ratios: Mapping[str, Ratio], seeds: int) -> str:
    """Return one sentence on the second law against the first, with what is better and worse."""
    gaps: dict[str, list[str]] = {"better": [], "worse": []}
    for name, ratio in ratios.items():
        gap = 100.0 * (ratio.ratio - 1.0)
        if name not in SHORT or not abs(gap) >= 0.5 or seeds > 3 and not ratio.is_sure:
            continue
        kind = "better" if better(name) * gap > 0.0 else "worse"
        gaps[kind].append(f"{SHORT[name]} {percent_text(gap)}")
    parts = [f"{kind}: {', '.join(words)}" for kind, words in gaps.items() if words]
    return "; ".join(parts) if parts else "no difference"


def save(weather: Weather, law: Law, path: Any, command: str) -> Any:
    """Write a law with its settings as a design file; return its path. command: for information only.

    Raises: InputError for a controller that has no kind of design, or an invalid path.
    """
    scene, settings = weather.scene(), settings_of(law)
    kinds: dict[str, Callable[[], tuple[str, dict]]] = {
        "pi": lambda: ("pi", _gains(settings, scene)),
        "pi_tuned": lambda: ("pi", _gains(settings, scene)),
        "gspi_oc3": lambda: ("gspi", _gains(settings, scene)),
        "lqr": lambda: ("lqr", lqr_settings(made(law, scene).settings, design_models(scene))),
        "floating_feedback": lambda: ("floating_feedback", _record(made(law, scene).feedback)),
        "mpc": lambda: ("mpc", _record(made(law, scene).settings)),
        "rosco_float": lambda: ("rosco", _record(made(law, scene).settings)),
    }
    if law.controller not in kinds:
        raise InputError(f"controller {law.controller!r}: cannot be saved; can be: {', '.join(kinds)}")
    kind, content = kinds[law.controller]()
    return save_design(path, kind, scene, content, command)


def _gains(settings, scene):
    chosen = scaled_pi(settings, scene.turbine).for_scene(scene)
    return {key: getattr(chosen, key) for key in PI_KEYS}


def _record(settings):
    return {key: getattr(settings, key) for key in settings.__dataclass_fields__}


def command_of(weather: Weather, first: Law, second: Law) -> str:
    """Return the command line of fowt tune that opens the page with these laws in this weather."""
    usual, words = Weather(), ["fowt", "tune", "--controller", str(second), "--against", str(first)]
    for key in ("platform", "wind", "sea", "seed", "duration"):
        if (value := getattr(weather, key)) != getattr(usual, key):
            words += [f"--{key}", f"{value:g}" if isinstance(value, float) else str(value)]
    return shlex.join(words)
