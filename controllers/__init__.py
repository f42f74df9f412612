"""Controllers by name, by import path, or the user's own objects."""

import importlib
import inspect
import sys

from fowt_env.controllers.base import CheckedController, CompiledController, Controller, check_control_dt
from fowt_env.controllers.design.saved_files import PREFIX as DESIGN
from fowt_env.controllers.design.saved_files import load_design
from fowt_env.controllers.policy.controller import PREFIX as POLICY
from fowt_env.controllers.policy.controller import policy, shipped_agents
from fowt_env.controllers.registry import CONTROLLERS
from fowt_env.descriptions.platform import read_turbine
from fowt_env.errors import InputError, unknown

if __name__ != "fowt_env.controllers":  # a module that is imported under two names exists twice
    raise ImportError("this package is fowt_env.controllers: import it by that name")

__all__ = ["CONTROLLERS", "CheckedController", "CompiledController", "Controller", "information", "make"]


def make(controller, turbine, control_dt):
    """Controller ready for a run, from a name, an import path or an object.

    controller: a name of CONTROLLERS; "policy:NAME" or "policy:PATH" of a trained agent; "design:FILE" with
    a file of `fowt design`; "module:Name" with Name a class, a factory or a controller (looked for in
    the working folder too); such a class or factory itself; or an object with reset(measurement) and
    act(measurement). Classes and factories are called with (turbine, control_dt) where they take two
    arguments, else with none. Compiled controllers come back as they are, others inside a
    CheckedController.
    Raises: InputError for unknown names (with a suggestion), paths that cannot be imported, agents and
    designs that cannot be used, and objects without reset and act.
    """
    control_dt = check_control_dt(control_dt)
    name = None
    if isinstance(controller, str):
        name = controller
        if name.startswith(DESIGN):
            controller = load_design(name.removeprefix(DESIGN))
        elif name.startswith(POLICY):
            controller = policy(name)
        else:
            controller = _imported(name) if ":" in name else CONTROLLERS.get(name)
        if controller is None:
            agents = (f"{POLICY}{agent}" for agent in shipped_agents())
            raise unknown("controller", name, (*CONTROLLERS, *agents))
    if isinstance(controller, type) or not isinstance(controller, Controller):
        controller = _called(controller, name, turbine, control_dt)
    for method in ("reset", "act"):
        if not callable(getattr(controller, method, None)):
            raise InputError(
                f"controller {name or controller!r} has no method {method}(measurement): a controller has"
                " reset(measurement) and act(measurement) -> (generator_torque, blade_pitch)"
            )
    if isinstance(controller, CompiledController | CheckedController):
        return controller
    return CheckedController(controller, name)


def information(name):
    """What a controller of CONTROLLERS or an agent uses: Measurement fields and entries of base.EXTRA.

    Raises: InputError for an unknown name.
    """
    return make(name, read_turbine("nrel5mw"), 0.1).information


def _imported(path):
    """What "module:Name" points at."""
    module_name, _, attribute = path.partition(":")
    if not module_name or not attribute:
        raise InputError(f"controller {path!r}: an import path is 'module:Name'")
    sys.path.insert(0, "")  # a console script has its own folder on the path, not the user's
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise InputError(f"controller {path!r}: cannot import {module_name!r}: {error}") from error
    finally:
        sys.path.remove("")
    if not hasattr(module, attribute):
        public = [key for key in vars(module) if not key.startswith("_")]
        raise unknown(f"name in module {module_name!r}:", attribute, public)
    return getattr(module, attribute)


def _called(factory, name, turbine, control_dt):
    """What a class or factory makes; anything that cannot be called comes back as it is."""
    if not callable(factory):
        return factory
    try:
        signature = inspect.signature(factory)
    except ValueError:  # some built-in callables have none
        return factory
    for arguments in ((turbine, control_dt), ()):
        try:
            signature.bind(*arguments)
        except TypeError:
            continue
        return factory(*arguments)
    raise InputError(
        f"controller {name or factory!r}: must take (turbine, control_dt) or no arguments, not {signature}"
    )
