"""Operating point, linear model, its modes with and without the controller, and a file for MATLAB."""

import fowt_env
from fowt_env.analysis.linear_model import modes
from fowt_env.controllers.design.closed_loop import closed_loop_matrix
from fowt_env.controllers.pi import PISettings
from fowt_env.files.matlab import write_mat

scene = fowt_env.build_scene(wind=18.0, fidelity="standard")
point = fowt_env.trim(scene)
print(f"blade pitch {point['BldPitch1']:.2f} deg, thrust {point['RotThrust']:.0f} kN")

model = fowt_env.linearize(scene, point)


def show(title, found):
    print(title)
    for mode in found:
        print(f"    {mode.name:14} period {mode.period:7.2f} s, damping ratio {mode.damping_ratio:7.4f}")


show("plant alone", model.modes())
for gains in ("oc3", "land"):  # the land gains drive the platform's pitch unstable or nearly so
    settings = PISettings.published(scene.turbine, gains)
    matrix, names = closed_loop_matrix(model, settings)
    show(f"with the PI controller, {gains} gains", modes(matrix, names, model.cm_height, model.arm))

print("wrote", write_mat(model, "results/examples/plant_18mps.mat"))
