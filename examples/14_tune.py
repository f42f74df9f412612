"""Gains of your own: design a PI on linear models, look at its closed loop, and try it in turbulence.

The rotor loop of a pitch controller has a frequency and a damping ratio. On land one wants it quick; on a
floating platform a loop as quick as the platform's own pitch motion (0.21 rad/s) takes that motion's damping
away. So: linearise over the wind, design for several frequencies, keep the platform's damping in view, and
let simulations decide. The seeds for tuning are not those that controllers are scored on (1 to 6).
`fowt design pi` and `fowt design lqr` do the same from the command line; linear-design.md has the background.
"""

import fowt_env
from fowt_env.controllers.design.pi import design_pi
from fowt_env.controllers.pi import PI, PISettings
from fowt_env.training.design.sweeps import models_over
from fowt_env.training.evaluation.evaluate import evaluate

WINDS = (13.0, 15.0, 18.0, 21.0, 24.0)  # m/s, above rated
OMEGAS = (0.12, 0.2, 0.35)  # rad/s
ZETA = 0.7
SEEDS = (1001, 1002)

scene = fowt_env.build_scene(wind=18.0, fidelity="standard")
models = models_over(scene, WINDS)

candidates = {}
print("rotor loop   KP         KI          least platform damping, 13 to 24 m/s")
for omega in OMEGAS:
    found = design_pi(models, scene.turbine, omega, ZETA)
    damping = min(row["platform_zeta_[-]"] for row in found.table)
    print(f"{omega:5.2f} rad/s  {found.KP:.6f}  {found.KI:.7f}  {damping:+.3f}")
    gains = {"KP": found.KP, "KI": found.KI, "gain_schedule_pitch": found.gain_schedule_pitch}
    candidates[f"omega {omega:g}"] = PI(PISettings.published(scene.turbine, **gains), control_dt=0.1)

table = evaluate(
    {"gspi_oc3": "gspi_oc3", **candidates}, "ntm_14,ntm_18", duration=150.0, skip=30.0, seeds=SEEDS
)
columns = {
    "RotSpeed_std_[rpm]": "rotor speed",
    "PtfmPitch_std_[deg]": "platform pitch",
    "blade_pitch_travel_[deg/s]": "pitch travel",
}
means = table.groupby("controller", sort=False)[list(columns)].mean()
ratios = (means / means.loc["gspi_oc3"]).rename(columns=columns)
print("\nover those of gspi_oc3, two winds, two seeds")
print(ratios.round(3).to_string())
best = ratios.drop(index="gspi_oc3")[["rotor speed", "platform pitch"]].mean(axis=1).idxmin()
print(f"least mean of both deviations: {best} rad/s")
