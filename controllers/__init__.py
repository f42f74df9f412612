"""Provides the built-in controllers and resolves controller names for fowt_env.control."""

from fowt_env.control import CheckedController, CompiledController, Controller, make
from fowt_env.controllers.bladed.controller import DLL_PREFIX as DLL
from fowt_env.controllers.bladed.controller import named_library
from fowt_env.controllers.design.saved_files import DESIGN_PREFIX as DESIGN
from fowt_env.controllers.design.saved_files import load_design
from fowt_env.controllers.lqr.law import WindEstimator
from fowt_env.controllers.policy.controller import POLICY_PREFIX as POLICY
from fowt_env.controllers.policy.controller import policy, shipped_agents
from fowt_env.controllers.registry import CONTROLLERS
from fowt_env.descriptions.checks import parse_names
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import unknown

if __name__ != "fowt_env.controllers":  # a module that is imported under two names exists twice
    raise ImportError("this package is fowt_env.controllers: import it by that name")

__all__ = [
    "CONTROLLERS",
    "PREFIXES",
    "CheckedController",
    "CompiledController",
    "Controller",
    "WindEstimator",
    "controller_names",
    "information",
    "make",
    "named",
]
PREFIXES = (DESIGN, DLL, POLICY)  # of names other than "module:Name"


def named(name):
    """Return the factory (turbine, control_dt) of a name with one of PREFIXES, or of a built-in name.

    Raises: InputError for unknown names (with a suggestion) and invalid files.
    """
    if name.startswith(DLL):
        return named_library(name)
    if name.startswith(DESIGN):
        return load_design(name.removeprefix(DESIGN))
    if name.startswith(POLICY):
        return policy(name)
    if name not in CONTROLLERS:
        agents = (f"{POLICY}{agent}" for agent in shipped_agents())
        raise unknown("controller", name, (*CONTROLLERS, *agents))
    return CONTROLLERS[name]


def controller_names(text):
    """Return the names in a comma-separated text; an input file and keys after "dll:PATH" belong to it."""
    names = []
    for part in parse_names(text):
        option = "=" in part or not (":" in part or part in CONTROLLERS)
        if names and names[-1].startswith(DLL) and option:
            names[-1] += f",{part}"
        else:
            names.append(part)
    return names


def information(name, turbine=None):
    """Return the inputs of a controller or agent: Measurement fields and PRIVILEGED_INPUTS.

    turbine: a descriptions.turbine.Turbine; None: NREL 5 MW. Without published gains a control law also uses
    the plant's equations. Raises: InputError for an unknown name.
    """
    return make(name, read_turbine("nrel5mw") if turbine is None else turbine, 0.1).information
