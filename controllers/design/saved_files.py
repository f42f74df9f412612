"""Saves and loads controllers as versioned JSON files and checks every value.

A design of kind "pi" or "gspi" contains gains and schedule, a design of kind "lqr" settings and linear
models, so that these run at any control period, independently of later changes of the plant. A design of kind
"floating_feedback", "mpc" or "rosco" contains the settings of the law, which is designed on the plant of
each run. Controller name: design:FILE.
"""

import json
import math
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path

import numpy as np

from fowt_env.controllers.floating_feedback import FeedbackSettings, FloatingFeedback
from fowt_env.controllers.gspi import GSPI
from fowt_env.controllers.lqr.design import MODEL_SHAPES, DesignModel, LQGSettings, lowest_design_wind
from fowt_env.controllers.lqr.law import LQR
from fowt_env.controllers.mpc.law import MPC
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.controllers.pi import PI, PISettings
from fowt_env.controllers.rosco import Rosco, RoscoSettings
from fowt_env.descriptions.checks import check_whole_number, is_number
from fowt_env.descriptions.files import parse_json, read_text
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing

DESIGN_PREFIX = "design:"
FORMAT, VERSION = "fowt-design", 2
KEYS = ("format", "version", "kind", "platform", "turbine", "command", "settings")
PI_KEYS = ("KP", "KI", "gain_schedule_pitch")
SPACING = 1.0  # m/s, between the models of a design of kind "lqr"


def save_design(path, kind, scene, settings, command, **further):
    """Write a design for the scene's platform and turbine; return its path.

    settings: PI_KEYS, or "lqg" and "models" for kind "lqr" (lqr_settings); command: command line of the
    design, for information only; further: tables of the design, which are not read back.
    Raises: InputError unless path ends with .json and the settings match the kind.
    """
    path = Path(path)
    if path.suffix.lower() != ".json":
        raise InputError(f"design file {str(path)!r}: must end with .json")
    known = (FORMAT, VERSION, kind, scene.platform.name, scene.turbine.name, command, settings)
    content = dict(zip(KEYS, known, strict=True)) | further
    _factory(content, f"design file {str(path)!r}")
    text = json.dumps(content, indent=1, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return path


def lqr_settings(chosen, models):
    """Return the settings of kind "lqr" for save_design, from LQGSettings and DesignModels."""
    rows = [{key: np.asarray(value).tolist() for key, value in vars(model).items()} for model in models]
    return {"lqg": asdict(chosen), "models": rows}


def load_design(path):
    """Return the factory (turbine, control_dt) -> controller of a saved design.

    Raises: InputError that names file, key and value; the factory raises InputError for another turbine.
    """
    where = f"design file {str(path)!r}"
    text = read_text(Path(path), "design")
    try:
        content = parse_json(text)
    except ValueError as error:
        raise InputError(f"{where} is not valid JSON: {error}") from None
    return _factory(content, where, Path(path).stem)


def _factory(content, where, name="design"):
    """Return the factory of the checked contents of a design."""
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f'{where}: is not a controller design ("format" must be {FORMAT!r})')
    if content.get("version") != VERSION:
        raise InputError(
            f"{where}: version = {content.get('version')!r}: must be {VERSION};"
            " repeat the design (its command is in the file)"
        )
    for key in KEYS:
        if key not in content:
            raise InputError(f"{where}: {key} is missing")
    if content["kind"] not in tuple(DESIGN_KINDS):  # a list cannot be looked up in a dict
        raise InputError(f"{where}: {unknown('kind', content['kind'], DESIGN_KINDS)}")
    _check_keys(content["settings"], DESIGN_KINDS[content["kind"]][0], "settings", where)
    make, turbine_name = DESIGN_KINDS[content["kind"]][1], content["turbine"]
    make = make(content["settings"], where)

    def factory(turbine, control_dt):
        if turbine.name != turbine_name:
            raise InputError(
                f"{where}: turbine = {turbine_name!r}: cannot control {turbine.name!r}; it was designed for"
                f" the platform {content['platform']!r}"
            )
        try:
            return make(turbine, control_dt, name)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None

    return factory


def _check_keys(table, expected, entry, where):
    """Raise InputError unless table is a dict with exactly the expected keys."""
    if not isinstance(table, dict):
        raise InputError(f"{where}: {entry}: must be an object with {', '.join(expected)}")
    for key in table:
        if key not in expected:
            raise InputError(f"{where}: {unknown(f'key in {entry}:', key, expected)}")
    for key in expected:
        if key not in table:
            raise InputError(f"{where}: {entry}.{key} is missing")


def _finite(key, value):
    """Return a finite number as a float. Raises: InputError with the value as plain text."""
    if not is_number(value):
        raise InputError(f"{key} = {str(value)[:60]}: must be a finite number")
    return float(value)


def _scheduled(law, settings, where):
    """Return a function that makes a PI controller; a gain_schedule_pitch of null means no schedule."""
    values = {}
    for key, value in settings.items():
        free = key == "gain_schedule_pitch" and value is None
        values[key] = math.inf if free else _finite(f"{where}: settings.{key}", value)
    return lambda turbine, control_dt, name: law(PISettings.published(turbine, **values), control_dt, name)


def _of_settings(record, law, settings, where):
    """Return a function that makes a law of a record of settings, law(record, turbine, control_dt, name)."""
    values, default = {}, record()
    for key, value in settings.items():
        usual, entry = getattr(default, key), f"{where}: settings.{key}"
        if isinstance(usual, str | bool):
            if type(value) is not type(usual):
                raise InputError(f"{entry} = {str(value)[:60]}: must be a {type(usual).__name__}")
            values[key] = value
        else:
            values[key] = (check_whole_number if isinstance(usual, int) else _finite)(entry, value)
    try:
        chosen = record(**values)
    except InputError as error:
        raise InputError(f"{where}: settings: {error}") from None
    return lambda turbine, control_dt, name: law(chosen, turbine, control_dt, name)


def _lqr(settings, where):
    """Return a function that makes an lqr controller from its LQGSettings and models."""
    known = [item.name for item in fields(LQGSettings)]
    _check_keys(settings["lqg"], known, "settings.lqg", where)
    values = {key: _finite(f"{where}: settings.lqg.{key}", value) for key, value in settings["lqg"].items()}
    try:
        chosen = LQGSettings(**values)
    except InputError as error:
        raise InputError(f"{where}: settings.lqg: {error}") from None
    rows = settings["models"]
    if not isinstance(rows, list) or len(rows) < 2:
        raise InputError(f"{where}: settings.models: must list models of at least two winds")
    models = [_model(row, f"settings.models[{i}]", where) for i, row in enumerate(rows)]
    for i in range(1, len(models)):
        if not math.isclose(models[i].wind - models[i - 1].wind, SPACING, rel_tol=1e-9):
            raise InputError(
                f"{where}: settings.models[{i}].wind = {models[i].wind:g}: must be {SPACING:g} m/s above"
                " the last"
            )

    def make(turbine, control_dt, name):
        lowest = lowest_design_wind(turbine)
        if models[-1].wind < lowest:
            raise InputError(
                f"settings.models: the last wind is {models[-1].wind:g} m/s: must be at least {lowest} m/s"
            )
        try:
            return LQR(turbine, control_dt, chosen, name, models=models)
        except (np.linalg.LinAlgError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"models: cannot be stabilised: {error}") from None

    return make


def _model(row, entry, where):
    """Return the DesignModel of one entry of settings.models."""
    _check_keys(row, MODEL_SHAPES, entry, where)
    values = {}
    for key, shape in MODEL_SHAPES.items():
        if not shape:
            values[key] = _finite(f"{where}: {entry}.{key}", row[key])
            continue
        try:
            array = np.array(row[key], dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != shape or not np.isfinite(array).all():
            raise InputError(f"{where}: {entry}.{key}: must be {' x '.join(map(str, shape))} finite numbers")
        values[key] = array
    return DesignModel(**values)


def _names(record):
    return tuple(item.name for item in fields(record))


def _feedback(chosen, turbine, control_dt, name):
    return FloatingFeedback(PISettings.published(turbine), chosen, control_dt, name)


# kind: (keys of settings, function that returns the maker of the controller)
DESIGN_KINDS = {
    "pi": (PI_KEYS, partial(_scheduled, PI)),
    "gspi": (PI_KEYS, partial(_scheduled, GSPI)),
    "lqr": (("lqg", "models"), _lqr),
    "floating_feedback": (_names(FeedbackSettings), partial(_of_settings, FeedbackSettings, _feedback)),
    "mpc": (_names(MPCSettings), partial(_of_settings, MPCSettings, lambda s, t, dt, n: MPC(t, dt, s, n))),
    "rosco": (
        _names(RoscoSettings),
        partial(_of_settings, RoscoSettings, lambda s, t, dt, n: Rosco(s, dt, n)),
    ),
}
