"""Defines environments whose episodes are runs of a load case, to train on the conditions of evaluate."""

from fowt_env.control import EXACT
from fowt_env.descriptions.platform import turbine_of
from fowt_env.descriptions.sensors import sensor_chain
from fowt_env.envs.observations import STANDARD
from fowt_env.envs.tasks import Task
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement
from fowt_env.training.evaluation.run_case import SHORTEST_CASE_WEATHER, faults_of, protection_of


def environment_settings(case, duration):
    """Return the settings of a FowtEnv in which an episode of `duration` (s) is a run of a Case.

    An episode with reset(options={"weather_seed": seed}) of an environment with the residual action mode, the
    case's controller as baseline and actions of zero gives the rows of evaluate; frame() returns them.
    Raises: InputError for a case with a perturbed plant, or with initial values other than the trim.
    """
    if case.shift is not None or case.displaced is not None or case.initial is not None:
        raise InputError(f"case {case.name!r}: an environment begins at the trim of the nominal plant")
    turbine = turbine_of(case.platform, case.options.get("turbine"))
    chain = sensor_chain(case.sensors)
    lacking = () if chain is None else set(Measurement._fields) - set(chain.available)
    shown = tuple(name for name in STANDARD if name not in lacking)
    return {
        "task": Task(
            name=case.name, wind=case.wind, sea=case.sea, duration=duration, offsets={}, observation=shown
        ),
        "platform": case.platform,
        "sensors": case.sensors,
        "preview": EXACT,
        "protection": protection_of(case, turbine, not case.parked, case.fault is None),
        "faults": faults_of(case),
        "record": True,
        "weather_duration": max(SHORTEST_CASE_WEATHER, duration),
        **case.options,
    }
