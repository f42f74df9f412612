"""Registers the environments in Gymnasium by import path, so that none is loaded before its first use."""

from gymnasium.envs.registration import register, registry

ENVIRONMENTS = {"fowt_env/OC3Hywind-v1": "fowt_env.envs:FowtEnv"}
OTHER_PLATFORMS = {  # name: platform; FowtEnv takes any platform, these have an identifier for citation
    "fowt_env/VolturnUS15MW-v0": "iea15_volturnus_s",
    "fowt_env/ITIBarge-v0": "nrel5mw_iti_barge",
    "fowt_env/OC4Semi-v0": "nrel5mw_oc4_semi",
}
ENTRY_POINT = "fowt_env.envs:FowtEnv"
VECTOR_ENTRY_POINT = "fowt_env.envs:FowtVectorEnv"  # the same for every name


def register_environments():
    """Add the names to Gymnasium's registry; names already registered are skipped."""
    for name, entry_point in (ENVIRONMENTS | dict.fromkeys(OTHER_PLATFORMS, ENTRY_POINT)).items():
        if name not in registry:
            settings = {"platform": OTHER_PLATFORMS[name]} if name in OTHER_PLATFORMS else {}
            register(name, entry_point, vector_entry_point=VECTOR_ENTRY_POINT, kwargs=settings)
