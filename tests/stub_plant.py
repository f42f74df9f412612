"""A plant that no kernel is needed for, and controllers that do what none should."""

import itertools
import os
import signal
import sys
import time
import warnings
from types import SimpleNamespace

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.controllers import make
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.measurement import Measurement
from fowt_env.training.evaluation import guard

CHANNELS = {  # channel: (mean, amplitude)
    "RotSpeed_[rpm]": (12.0, 1.0),
    "GenPwr_[kW]": (5000.0, 300.0),
    "PtfmPitch_[deg]": (3.0, 1.0),
    "PtfmSurge_[m]": (15.0, 4.0),
    "BldPitch1_[deg]": (10.0, 2.0),
    "GenTq_[kN-m]": (43.0, 1.0),
    "TwrBsMyt_[kN-m]": (80000.0, 9000.0),
    "FAIRTEN1_[kN]": (900.0, 80.0),
    "FAIRTEN2_[kN]": (950.0, 60.0),
}


def build_scene(platform="oc3_hywind", wind=None, **options):
    """What an evaluation asks of a scene: its turbine and whether there is wind."""
    speed = wind["speed"] if isinstance(wind, dict) else wind
    return SimpleNamespace(turbine=read_turbine(read_platform(platform).turbine), wind_speed=speed, **options)


def simulate(scene, controller=None, duration=10.0, initial=None, **options):
    """Made-up series of the scene's seed, once the controller has been called as in a run."""
    controller = make(controller, scene.turbine, 0.1)
    measurement = Measurement(*[0.0] * len(Measurement._fields))
    controller.prepare(scene)
    controller.reset(measurement)
    times = 0.1 * np.arange(round(10 * duration) + 1)
    rng = np.random.default_rng(round(1e6 * duration) + scene.seed)
    series = {name: mean + width * rng.normal(size=times.size) for name, (mean, width) in CHANNELS.items()}
    for i, t in enumerate(times):
        try:
            controller.act(measurement._replace(time=float(t)))
        except KeyboardInterrupt as interrupt:
            interrupt.frame = pd.DataFrame({"Time_[s]": times, **series})[:i]
            raise
    frame = pd.DataFrame({"Time_[s]": times, **series})
    frame.attrs["events"] = {"BEM_FALLBACK": 0, "MOORING_UNCONVERGED": 3} if scene.seed == 2 else {}
    frame.attrs["tripped"] = None
    if scene.seed == 2:  # as simulate does, for the line that called it
        warnings.warn("MOORING_UNCONVERGED 3", fowt_env.PlantWarning, stacklevel=2)
    return frame


def install(monkeypatch=None):
    """Put the plant in place of the real one; without a monkeypatch for as long as the process lives."""
    put = setattr if monkeypatch is None else monkeypatch.setattr
    put(fowt_env, "build_scene", build_scene)
    put(fowt_env, "simulate", simulate)
    put(guard, "GRACE", 0.5)


def arrived(kind):
    """A controller in a worker process, where it brings the plant with it."""
    install()
    return kind()


class Still:
    """Asks nothing and answers always the same."""

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return 1.0, 0.25

    def __reduce__(self):
        return arrived, (type(self),)


class Acting(Still):
    """Does something after a second, and then goes on."""

    def act(self, measurement):
        if measurement.time > 1.0:
            self.do()
        return super().act(measurement)


class Exits(Acting):
    def do(self):
        sys.exit(0)


class Interrupts(Acting):
    def do(self):
        raise KeyboardInterrupt


class Wanders(Acting):
    def do(self):
        os.chdir("/")


class Mute(Acting):
    """Raises what has no message."""

    def do(self):
        class Odd(Exception):
            def __str__(self):
                raise SystemExit("no text")

        raise Odd


class Smuggles(Acting):
    """Raises the error of a file whose name is no text, with what a terminal would obey."""

    def do(self):
        raise FileNotFoundError("none\udcff\x1b[31m\n\u202efound")


class Floods(Acting):
    def act(self, measurement):
        return [0.0] * 10**6


class Nameless(Acting):
    """Answers with what cannot be shown."""

    def act(self, measurement):
        class Odd:
            def __repr__(self):
                raise RuntimeError("no repr")

        return Odd()


class Unborn(Still):
    def __init__(self):
        sys.exit(3)


class Sleeps(Acting):
    def do(self):
        time.sleep(100.0)


class Swallows(Acting):
    """Never ends, and catches whatever is raised."""

    def do(self):
        end = time.monotonic() + 1.2  # of what it can swallow: the limit comes again
        while True:
            try:
                while True:
                    time.sleep(0.01)
            except BaseException:
                if time.monotonic() > end:
                    raise


class Compiled(Acting):
    """Never comes back to Python."""

    def do(self):
        sum(itertools.repeat(0))


class Dies(Acting):
    def do(self):
        os._exit(0)


class Signalled(Acting):
    """A signal from outside comes while it acts."""

    number = signal.SIGINT

    def do(self):
        signal.raise_signal(self.number)


class Terminated(Signalled):
    number = signal.SIGTERM


class Deaf(Signalled):
    """The same, and it catches what the signal raises."""

    def do(self):
        try:
            super().do()
        except BaseException:
            pass
