"""Makes a controller that is ready for a run from a name, an import path or an object."""

import importlib
import inspect
import sys
from typing import Any

from fowt_env.control.protocol import (
    CheckedController,
    CompiledController,
    Controller,
    FunctionController,
    failure_of,
    named_failure,
)
from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError, unknown

CATALOGUE = "fowt_env.controllers"
LONGEST_CONTROL_DT = 1.0  # s; with a longer period the sampled loop deviates from the design


def check_control_dt(control_dt: float) -> float:
    """Return the control period as a float. Raises: InputError outside (0, 1] s."""
    allowed = f"in (0, {LONGEST_CONTROL_DT:g}] s"
    return check_number("control_dt", control_dt, 0.0, LONGEST_CONTROL_DT, low_open=True, allowed=allowed)


def catalogue() -> Any:
    """Return the package of built-in controllers: CONTROLLERS, PREFIXES, named(name), WindEstimator."""
    return importlib.import_module(CATALOGUE)


def make(controller: Any, turbine: Any, control_dt: float) -> Any:
    """Return a controller that is ready for a run, from a name, an import path or an object.

    controller: a built-in name ("pi"); "policy:NAME" or "policy:PATH" of a trained agent; "design:FILE" with
    a file of `fowt design`; "module:Name" with Name a class, a factory, a function or a controller (the
    working folder is searched too); such a class, factory or function itself; or an object with
    reset(measurement) and act(measurement). Classes and factories are called with (turbine, control_dt) if
    they take two arguments, else without arguments. A function with one required argument, not called
    turbine, is the control law: f(measurement) -> (torque, blade pitch). Compiled controllers are returned
    unchanged, others inside a CheckedController.
    Raises: InputError for unknown names (with a suggestion), paths that cannot be imported, unusable agents
    and designs, and objects without reset and act; ControllerError, with the line, for an error raised by a
    user's module or factory.
    """
    control_dt = check_control_dt(control_dt)
    name = None
    if isinstance(controller, str):
        name = controller
        imported = ":" in name and not name.startswith(tuple(catalogue().PREFIXES))
        controller = _imported(name) if imported else catalogue().named(name)
    if isinstance(controller, type) or not isinstance(controller, Controller):
        if not _is_law(controller):
            controller = _called(controller, name, turbine, control_dt)
        if _is_law(controller):
            controller = FunctionController(controller)
    for method in ("reset", "act"):
        if not callable(getattr(controller, method, None)):
            raise InputError(
                f"controller {name or controller!r} has no method {method}(measurement): a controller has"
                " reset(measurement) and act(measurement) -> (generator_torque, blade_pitch)"
            )
    if isinstance(controller, CompiledController | CheckedController):
        return controller
    return CheckedController(controller, name)


def _imported(path):
    """Return the attribute that the import path "module:Name" refers to."""
    module_name, _, attribute = path.partition(":")
    if not module_name or not attribute:
        raise InputError(f"controller {path!r}: an import path is 'module:Name'")
    sys.path.insert(0, "")  # a console script has its own folder on the path, not the working folder
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise InputError(f"controller {path!r}: cannot import {module_name!r}: {error}") from error
    except InputError:
        raise
    except Exception as error:
        raise failure_of(path, "when it was imported", error, None) from error
    finally:
        sys.path.remove("")
    if not hasattr(module, attribute):
        public = [key for key in vars(module) if not key.startswith("_")]
        raise unknown(f"name in module {module_name!r}:", attribute, public)
    return getattr(module, attribute)


def _is_law(function):
    """Return whether an object is a function of the measurement (FunctionController) and not a factory."""
    if not callable(function) or isinstance(function, type) or hasattr(function, "act"):
        return False
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:  # some built-in callables have no signature
        return False
    free = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    needed = [one for one in parameters if one.default is one.empty and one.kind not in free]
    if len(needed) != 1 or needed[0].kind is inspect.Parameter.KEYWORD_ONLY:
        return False
    return needed[0].name != "turbine"


def _called(factory, name, turbine, control_dt):
    """Return the result of a class or factory; an object that cannot be called is returned unchanged."""
    if not callable(factory):
        return factory
    try:
        signature = inspect.signature(factory)
    except ValueError:  # some built-in callables have no signature
        return factory
    for arguments in ((turbine, control_dt), ()):
        try:
            signature.bind(*arguments)
        except TypeError:
            continue
        with named_failure(str(name or getattr(factory, "__name__", factory)), "when it was made"):
            return factory(*arguments)
    raise InputError(
        f"controller {name or factory!r}: must take (turbine, control_dt) or no arguments, or be a function"
        f" of the measurement alone, not {signature}"
    )
