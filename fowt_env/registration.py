"""Registers the environments in Gymnasium by import path, so that none is loaded before its first use.

A name stands for its physics and reward: a change of either needs a new version. Gymnasium warns of an older
version of a name that has a newer one.
"""

from gymnasium.envs.registration import register, registry

ENTRY_POINT = "fowt_env.envs:FowtEnv"
VECTOR_ENTRY_POINT = "fowt_env.envs:FowtVectorEnv"
SCORE = {"reward": "score"}  # goals in [0, 1]: fowt_env/envs/goals.py
BLADES = ("1", "2", "3")
ENVIRONMENTS = {  # {name: settings}; those of before the reward in [0, 1] keep their bits
    "fowt_env/OC3Hywind-v1": {},
    "fowt_env/VolturnUS15MW-v0": {"platform": "iea15_volturnus_s"},
    "fowt_env/ITIBarge-v0": {"platform": "nrel5mw_iti_barge"},
    "fowt_env/OC4Semi-v0": {"platform": "nrel5mw_oc4_semi"},
    "fowt_env/OC3Hywind-v2": SCORE,
    "fowt_env/VolturnUS15MW-v1": {"platform": "iea15_volturnus_s", **SCORE},
    "fowt_env/ITIBarge-v1": {"platform": "nrel5mw_iti_barge", **SCORE},
    "fowt_env/OC4Semi-v1": {"platform": "nrel5mw_oc4_semi", **SCORE},
}
# Tasks of rising difficulty for agents. Observations are of order 1, so that algorithms learn without another
# normalisation: {entry: (centre, scale, change from decision to decision)}, SI.
TURBINE = {
    "rotor_speed": (1.267, 0.09, 0.03),
    "generator_torque": (43093.0, 4000.0, 2000.0),
    "blade_pitch": (0.2, 0.1, 0.02),
    "platform_pitch": (0.035, 0.02, 0.002),
    "platform_pitch_rate": (0.0, 0.003, 0.001),
    "nacelle_velocity": (0.0, 0.4, 0.15),
    "nacelle_acceleration": (0.0, 0.25, 0.25),
}
EASY = {
    "task": "above_rated",
    "action_mode": "residual",
    "baseline": "pi",
    "duration": 300.0,
    # reached slowly: the low pass lets 6 % of a decision of 0.5 s through
    "residual_torque": 0.25,
    "residual_pitch": 5.0,
    "decisions": {"hold": 5, "smoothing": 8.0, "history": 1, "washout": 60.0},
    "observation": (*TURBINE, "previous_action"),
    "normalise": TURBINE,
    **SCORE,
}
MEDIUM = EASY | {"task": "full_range", "sensors": "standard"}
HARD = {name: value for name, value in MEDIUM.items() if not name.startswith(("residual", "baseline"))} | {
    "task": "above_rated",
    "action_mode": "direct",
    "decisions": {"hold": 5, "smoothing": 0.5, "history": 3},
}
SENSOR_FAULTS = (  # each at a time, and of a size, drawn for the episode
    {"kind": "sensor_bias", "field": "platform_pitch", "time": (30.0, 270.0), "value": (-0.03, 0.03)},
    {"kind": "sensor_freeze", "field": "nacelle_velocity", "time": (30.0, 270.0)},
)
ROOTS = {  # at the same scale, so that an observation can be turned from blade to blade
    name: scaling
    for channel, scaling in (("blade_pitch", (0.2, 0.1, 0.02)), ("root_out_of_plane", (5e6, 3e6, 1e6)))
    for name in (f"{channel}_{blade}" for blade in BLADES)
}
INDIVIDUAL_PITCH = {
    "task": "above_rated",
    "fidelity": "elastic",
    "action_mode": "individual_residual",
    "baseline": "pi",
    "duration": 120.0,
    "residual_torque": 0.05,
    "residual_pitch": 2.0,
    # a rotation takes 5 s: the low pass must let through additions that turn with the rotor
    "decisions": {"hold": 2, "smoothing": 0.2, "history": 1, "washout": 30.0},
    "observation": (*TURBINE, "azimuth", *ROOTS, "previous_action"),
    "normalise": TURBINE | ROOTS,
    "reward": "score_blades",
}
AHEAD = (1.5, 3.0, 4.5)  # s; with blocked shots 4.9 s is the horizon of the lidar at 24 m/s
LADDER = {  # tasks for agents, of rising difficulty
    "fowt_env/OC3HywindEasy-v0": EASY,
    "fowt_env/OC3HywindMedium-v0": MEDIUM,
    "fowt_env/OC3HywindHard-v0": HARD,
    "fowt_env/OC3HywindFaults-v0": MEDIUM
    | {"task": "above_rated", "protection": "turbine", "faults": SENSOR_FAULTS},
    "fowt_env/OC3HywindLidar-v0": MEDIUM
    | {
        "task": "above_rated",
        "preview": "circular_cw",
        "wind_preview": AHEAD,
        "observation": (*TURBINE, "previous_action", "wind_preview"),
        "normalise": TURBINE | {f"wind_preview_{lead:g}s": (17.0, 4.0, 1.0) for lead in AHEAD},
    },
    "fowt_env/OC3HywindUnknown-v0": MEDIUM | {"task": "above_rated"},
    "fowt_env/OC3HywindIndividualPitch-v0": INDIVIDUAL_PITCH,
}
OBJECTIVES = {"fowt_env/OC3HywindObjectives-v0": EASY}  # a vector of rewards, for MO-Gymnasium
STEPS = 600  # decisions of an episode of the ladder
SOLVED = {  # reward of a decision: a third of the way from pi to the best of pi, lqr and mpc
    "fowt_env/OC3HywindEasy-v0": 0.70,
    "fowt_env/OC3HywindMedium-v0": 0.76,
    "fowt_env/OC3HywindHard-v0": 0.70,
    "fowt_env/OC3HywindFaults-v0": 0.70,
    "fowt_env/OC3HywindLidar-v0": 0.70,
    "fowt_env/OC3HywindUnknown-v0": 0.70,
    "fowt_env/OC3HywindIndividualPitch-v0": 0.69,
}
ENTRY_POINTS = {  # of names with others than the usual two
    "fowt_env/OC3HywindUnknown-v0": (
        "fowt_env.training.rl.randomisation:unknown_plant",
        "fowt_env.training.rl.randomisation:unknown_plants",
    ),
    "fowt_env/OC3HywindObjectives-v0": ("fowt_env.envs:FowtObjectivesEnv", None),
}


def register_environments():
    """Add the names to Gymnasium's registry; names already registered are skipped."""
    for name, settings in (ENVIRONMENTS | LADDER | OBJECTIVES).items():
        if name not in registry:
            entry_point, of_vectors = ENTRY_POINTS.get(name, (ENTRY_POINT, VECTOR_ENTRY_POINT))
            more = {} if name in ENVIRONMENTS else {"max_episode_steps": STEPS}
            more |= {"reward_threshold": STEPS * SOLVED[name]} if name in SOLVED else {}
            # the checker of Gymnasium expects a number as the reward
            more |= {"disable_env_checker": True} if name in OBJECTIVES else {}
            register(name, entry_point, vector_entry_point=of_vectors, kwargs=settings, **more)
