"""Load cases on a plant that no controller knows: masses, moorings and actuators off, sensors noisy.

The run is that of the true plant, a perturbed one. The controller is made for the nominal turbine and
prepared with the nominal scene, so that one that designs itself on the plant's equations (lqr, rosco,
preview) designs on the wrong ones, as it would at sea. Metrics are of the true motions: noise is on the
controller's readings alone.
"""

from fowt_env.descriptions.sensors import Sensor, SensorChain
from fowt_env.envs.sensors import reading_scales
from fowt_env.plant.measurement import Measurement


def perturbed_sensors(perturbation, turbine, control_dt):
    """SensorChain of a PlantPerturbation's noise and delay on every reading; None where it has neither."""
    if perturbation.noise == 0.0 and perturbation.delay == 0:
        return None
    scales = dict(zip(Measurement._fields, reading_scales(turbine).tolist(), strict=True))
    delay = perturbation.delay * control_dt
    sensors = {
        name: Sensor(noise=perturbation.noise * scale, delay=delay)
        for name, scale in scales.items()
        if name != "time"
    }
    return SensorChain("shifted", sensors, "every reading with the same share of noise and the same delay")
