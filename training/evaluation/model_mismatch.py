"""Load cases on a plant that no controller knows: masses, moorings and actuators off, sensors noisy.

The run is that of the true plant, a perturbed one. The controller is made for the nominal turbine and
prepared with the nominal scene in the same weather, so that one that designs itself on the plant's equations
(lqr, rosco, preview) designs on the wrong ones, as it would at sea. Metrics are of the true motions: noise
is on the controller's readings alone.
"""

from collections import deque

import numpy as np

from fowt_env.control import CheckedController, CompiledController
from fowt_env.envs.sensors import NOISE_STREAM, reading_scales
from fowt_env.plant.measurement import Measurement


class ModelMismatch:
    """A controller that was prepared for another scene than it runs in, on readings of degraded sensors.

    inner: what controllers.make returned; nominal: the scene that it is prepared for; seed: of the noise.
    """

    def __init__(self, inner, nominal, perturbation, seed):
        if not isinstance(inner, CompiledController | CheckedController):
            inner = CheckedController(inner)
        self.name, self.information = inner.name, tuple(inner.information)
        self.inner, self.nominal, self.perturbation, self.seed = inner, nominal, perturbation, seed
        self.noise_std = perturbation.noise * reading_scales(nominal.turbine)

    def prepare(self, scene):
        """Hand the nominal scene, not that of the run, to the controller inside."""
        self.inner.prepare(self.nominal)

    def reset(self, measurement):
        """Start afresh: full history of the first measurement, noise from its beginning."""
        self.rng = np.random.default_rng([self.seed, NOISE_STREAM])
        self.delay_buffer = deque([measurement], maxlen=self.perturbation.delay + 1)
        self.reading, self.read_at = self._noisy(measurement), measurement.time
        self.inner.reset(self.reading)

    def act(self, measurement):
        """What the controller inside answers to its reading."""
        if measurement.time != self.read_at:  # the first instant has been read by reset
            self.delay_buffer.append(measurement)
            late = self.delay_buffer[0]._replace(time=measurement.time)  # a clock is not late
            self.reading, self.read_at = self._noisy(late), measurement.time
        return self.inner.act(self.reading)

    def _noisy(self, measurement):
        """The Measurement with noise; without any it is the same object."""
        if not self.perturbation.noise:
            return measurement
        values = np.array(measurement) + self.noise_std * self.rng.normal(size=len(measurement))
        return Measurement(*values.tolist())
