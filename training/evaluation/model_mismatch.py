"""Model mismatch of load cases: a perturbed plant and noisy sensors, with a controller of the nominal plant.

The run uses the perturbed plant. The controller is made for the nominal turbine and prepared with the nominal
scene, so that model-based designs (lqr, rosco, preview) are based on a wrong model, as they would be at sea.
Metrics are of the true motions: noise is only on the controller's readings.
"""

from fowt_env.descriptions.sensors import Sensor, SensorChain
from fowt_env.envs.sensors import reading_scales
from fowt_env.plant.measurement import Measurement


def perturbed_sensors(perturbation, turbine, control_dt):
    """Return the SensorChain of a PlantPerturbation's noise and delay on every reading; None without both."""
    if perturbation.noise == 0.0 and perturbation.delay == 0:
        return None
    scales = dict(zip(Measurement._fields, reading_scales(turbine).tolist(), strict=True))
    delay = perturbation.delay * control_dt
    sensors = {
        name: Sensor(noise=perturbation.noise * scale, delay=delay)
        for name, scale in scales.items()
        if name != "time"
    }
    return SensorChain("shifted", sensors, "equal relative noise and delay on every reading")
