"""Load cases on a plant that no controller knows: masses, moorings and actuators off, sensors noisy.

The run is that of the shifted plant. The controller is made for the nominal turbine and prepared with the
nominal scene in the same weather, so that one that designs itself on the plant's equations (lqr, rosco,
preview) designs on the wrong ones, as it would at sea. Metrics are of the true motions: noise is on the
controller's readings alone.
"""

from collections import deque
from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import Field

from fowt_env.control import CheckedController, CompiledController
from fowt_env.descriptions.records import NonNegative, Positive, Record
from fowt_env.envs.sensors import NOISE_STREAM, reading_scales
from fowt_env.plant.measurement import Measurement
from fowt_env.training.evaluation.plant_perturbation import PLANT, plant_settings


class Shift(Record):
    """How a case's plant differs from the one that its controller knows; names as in randomisation.PLANT.

    Factors on what the files say. noise: standard deviation of white noise on each reading, as a share of
    the scale that the channel has in observations (rotor speed: 20 % of rated; blade pitch: 15 deg; platform
    pitch: 5 deg, its rate: 1 deg/s; nacelle acceleration: 1 m/s2). delay: control periods from
    measurement to reading.
    """

    ballast_mass: Positive = 1.0
    upper_mass: Positive = 1.0
    added_mass: Positive = 1.0
    drag: Positive = 1.0
    mooring_stiffness: Positive = 1.0
    actuator_lag: Positive = 1.0
    air_density: Positive = 1.0
    noise: NonNegative = 0.0
    delay: Annotated[int, Field(ge=0, le=1000, strict=True)] = 0

    @property
    def factors(self):
        """{name of randomisation.PLANT: factor} of those that are not 1."""
        return {name: getattr(self, name) for name in PLANT if getattr(self, name) != 1.0}


@lru_cache(maxsize=64)
def shifted_parts(shift, platform="oc3_hywind"):
    """{"platform", "turbine"} of a built-in platform or file with a Shift, for build_scene."""
    return plant_settings(shift.factors, platform)


class Unaware:
    """A controller that was prepared for another scene than it runs in, on readings of worn sensors.

    inner: what controllers.make returned; known: the scene that it is told of; seed: of the noise.
    """

    def __init__(self, inner, known, shift, seed):
        if not isinstance(inner, CompiledController | CheckedController):
            inner = CheckedController(inner)
        self.name, self.information = inner.name, tuple(inner.information)
        self.inner, self.known, self.shift, self.seed = inner, known, shift, seed
        self.spread = shift.noise * reading_scales(known.turbine)

    def prepare(self, scene):
        """Hand the scene that it knows, not that of the run, to the controller inside."""
        self.inner.prepare(self.known)

    def reset(self, measurement):
        """Start afresh: full history of the first measurement, noise from its beginning."""
        self.rng = np.random.default_rng([self.seed, NOISE_STREAM])
        self.past = deque([measurement], maxlen=self.shift.delay + 1)
        self.reading, self.read_at = self._noisy(measurement), measurement.time
        self.inner.reset(self.reading)

    def act(self, measurement):
        """What the controller inside answers to its reading."""
        if measurement.time != self.read_at:  # the first instant has been read by reset
            self.past.append(measurement)
            late = self.past[0]._replace(time=measurement.time)  # a clock is not late
            self.reading, self.read_at = self._noisy(late), measurement.time
        return self.inner.act(self.reading)

    def _noisy(self, measurement):
        """The Measurement with noise; without any it is the same object."""
        if not self.shift.noise:
            return measurement
        values = np.array(measurement) + self.spread * self.rng.normal(size=len(measurement))
        return Measurement(*values.tolist())
