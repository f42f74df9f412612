"""A load of your own, by adding to a part of the plant: the wind drag of the nacelle.

The model has no nacelle drag. A scene's model is a tuple of parts, each of plain numbers and arrays, that
the compiled kernels read; with_model() puts a changed part in place, without compiling anew. Here the
tower's drag, which is summed over points along its axis, gets one more point at the nacelle. What no part
can express needs a kernel in the package: CONTRIBUTING.md, "Adding a load".
"""

import numpy as np

import fowt_env

AREA = 30.0  # m2, nacelle seen from the front
DRAG_COEFFICIENT = 0.8
HEIGHT = 89.35  # m above still water

scene = fowt_env.build_scene(wind=24.0, fidelity="standard")
factor = 0.5 * scene.platform.environment.air_density * DRAG_COEFFICIENT * AREA  # force / speed^2
tower = scene.model.tower
tower = tower._replace(z=np.append(tower.z, HEIGHT), factor=np.append(tower.factor, factor))
loaded = scene.with_model(tower=tower)

before, after = (fowt_env.trim(s) for s in (scene, loaded))
print(f"platform pitch {before['PtfmPitch']:.3f} -> {after['PtfmPitch']:.3f} deg")
print(f"surge          {before['PtfmSurge']:.3f} -> {after['PtfmSurge']:.3f} m")
print(f"drag on the nacelle at rest: {factor * 24.0**2 / 1e3:.1f} kN")

run = fowt_env.simulate(loaded, controller="pi", duration=60.0)
print(f"simulated: surge {run['PtfmSurge_[m]'].iloc[-1]:.2f} m after 60 s")
