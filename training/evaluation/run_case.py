"""Runs one controller on one case and returns its row. All sources that affect a result are imported here."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

import fowt_env
from fowt_env.analysis.trim import trim
from fowt_env.controllers import make
from fowt_env.controllers.constant import Constant
from fowt_env.descriptions.checks import is_number
from fowt_env.descriptions.faults import Fault
from fowt_env.descriptions.protection import END_AT_OVERSPEED, TripLimit, read_protection
from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.descriptions.units import DEGREE
from fowt_env.descriptions.wind import read_wind
from fowt_env.errors import (
    ControllerInputError,
    InputError,
    PlantWarning,
    muted,
)
from fowt_env.training.evaluation.guard import attempt, reason_of
from fowt_env.training.evaluation.metrics import METRICS, TIME, turbine_metrics
from fowt_env.training.evaluation.plant_perturbation import perturbed_parts, perturbed_sensors
from fowt_env.training.evaluation.wind_boxes import cached_box
from fowt_env.weather.wind import GUSTS
from fowt_env.weather.wind_field import is_field

STATUSES = OK, TRIPPED, FAILED, LOST_POWER = ("ok", "tripped", "failed", "lost power")
PARKED = "parked"  # name in place of the controller of a parked turbine
REFERENCE = "reference"  # name of the runs of the suite's baseline without trip and protection
CONTROL_DT = 0.1  # s, default of simulate
SHORTEST_CASE_WEATHER = 700.0  # s of wind and waves: shorter runs use the start of the same realisation
COLUMNS = (
    *("controller", "case", "seed", "status", "reason", "events", "warning"),
    *("stopped_[s]", "scored_[s]", "weight_[-]"),
    *METRICS,
)


@dataclass(frozen=True)
class Run:
    """Defines a run: one controller on one realisation of one case."""

    label: str
    controller: object  # name or object, as simulate takes it
    case: Any  # training.evaluation.cases.Case
    seed: int
    duration: float
    skip: float
    options: dict  # further options of simulate
    frame_path: Path | None  # file for the time series
    time_limit: float | None = None  # s of wall clock
    weight: float = float("nan")  # fraction of the lifetime spent in the case; NaN: equal weights

    @property
    def key(self):
        """Return the key of the run within its evaluation."""
        return self.label, self.case.name, self.seed


def scored(run, measure=None):
    """Return (row, time series or None) of one run; a failed run has a reason instead of metrics.

    measure: what is measured of a run, in place of `run_metrics` and with its arguments.
    If the turbine's protection ends the run, the row has the metrics until then, the time and the reason.
    Raises: InputError for settings that no controller could use.
    """
    case = run.case
    options = {"duration": max(SHORTEST_CASE_WEATHER, run.duration), **case.options}
    wind = case.wind
    if is_field(wind):
        wind = cached_box(wind, case.platform, run.seed, options)
    weather = {"wind": wind, "sea": case.sea, "seed": run.seed, **options}
    with muted():  # extreme weather is the purpose of a case
        nominal = scene = fowt_env.build_scene(case.platform, **weather)
    settings = {"sensors": case.sensors, **run.options}
    if case.shift is not None:
        if case.shift.factors:
            scene = fowt_env.build_scene(**weather | perturbed_parts(case.shift, case.platform))
        control_dt = run.options.get("control_dt", CONTROL_DT)
        chain = perturbed_sensors(case.shift, nominal.turbine, control_dt)
        settings |= {} if chain is None else {"sensors": chain}
    protected = not case.parked and run.label != REFERENCE  # the reference needs metrics
    ends = run.label != REFERENCE and case.fault is None

    def work():
        initial = case.initial
        if case.displaced is not None:
            point = trim(scene)
            initial = {name: point[name] + change for name, change in case.displaced.items()}
        elif initial is None and case.parked and _is_operable(scene):
            initial = "parked"  # its steady state would be one of production
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PlantWarning)  # reported in the row's events and warning
            frame = fowt_env.simulate(
                scene,
                controller=run_controller(run, nominal),
                duration=run.duration,
                initial=initial,
                protection=protection_of(case, scene.turbine, protected, ends),
                faults=faults_of(case),
                nominal=nominal,
                **settings,
            )
        return frame, (measure or run_metrics)(frame, case, nominal, run.skip)

    # an error of the controller fails this run, not the evaluation
    outcome, error = attempt(work, run.time_limit)
    if error is None:
        frame, values = outcome
        ended = frame.attrs["tripped"]
        if ended is None:
            return _row(run, OK, frame) | values, frame
        # a trip after a fault that ends operation is due to the case, not to the controller
        fault = case.fault
        expected = fault is not None and fault.ends_operation and ended >= fault.time - 1e-9
        reason = _trip_reason(frame.attrs["trip"], ended, case, nominal.turbine)
        about = {"reason": reason, "stopped_[s]": ended}
        return _row(run, OK if expected else TRIPPED, frame) | values | about, frame
    if isinstance(error, InputError) and not isinstance(error, ControllerInputError):
        raise error  # wrong settings of the run
    frame, stopped = _end(error)
    return _row(run, FAILED, frame) | {"reason": reason_of(error), "stopped_[s]": stopped}, frame


def _is_operable(scene):
    """Return whether the turbine could operate in the mean wind of a scene."""
    return scene.wind_speed is not None and 0.0 < scene.wind_speed <= scene.turbine.cut_out_wind_speed


def faults_of(case):
    """Return the faults of a Case; a parked turbine is disconnected from the grid."""
    parked = (Fault(kind="grid_loss", time=0.0),) if case.parked else ()
    return parked if case.fault is None else (case.fault, *parked)


def protection_of(case, turbine, protected, ends):
    """Return the protection of a run of a Case. Without trips: None, or END_AT_OVERSPEED if `ends`."""
    if not protected or (case.trip is None and case.protection is None):
        return END_AT_OVERSPEED if ends else None
    limits = read_protection(case.protection, turbine.protection)
    if case.trip is None:
        return limits
    return limits.model_copy(update={"overspeed": TripLimit(limit=case.trip)})


def lost_row(run, reason):
    """Return the row of a failed run whose process ended without a result."""
    return _row(run, FAILED, None) | {"reason": reason}


def run_metrics(frame, case, scene, skip):
    """Return {metric: value} of the time series of a run of a Case in its nominal scene, after `skip` s."""
    fault = case.fault
    stop = fault.time if fault is not None and fault.ends_operation else None
    kind = case.wind.get("kind") if isinstance(case.wind, dict) else "steady"
    gust = read_wind(case.wind)["start"] if kind in GUSTS and not case.parked else None
    # in steady wind above rated and still water a controller must settle
    steady = kind == "steady" and case.wind is not None and not case.parked and fault is None
    steady = steady and scene.wind_speed > scene.turbine.rated_wind_speed
    steady = steady and sea_state_of(case.sea).height == 0.0
    return turbine_metrics(frame, scene.turbine, skip, steady, gust, stop)


def _row(run, status, frame):
    """Return the row of a run without reason and metrics."""
    row = dict.fromkeys(COLUMNS, float("nan"))
    row |= {"controller": run.label, "case": run.case.name, "seed": run.seed, "status": status, "reason": ""}
    row["warning"] = "" if frame is None else frame.attrs.get("doubtful_commands", "")
    counts = {} if frame is None else frame.attrs.get("events", {})
    row["events"] = "; ".join(f"{name} {count}" for name, count in counts.items() if count)
    row["scored_[s]"], row["weight_[-]"] = run.duration - run.skip, run.weight
    return row


def _end(error):
    """Return (rows so far or None, time of the end in s or NaN) that simulate attached to an exception."""
    frame, stopped = getattr(error, "frame", None), getattr(error, "time", None)
    frame = frame if isinstance(frame, pd.DataFrame) and TIME in frame else None
    if not is_number(stopped):
        stopped = float("nan") if frame is None or frame.empty else frame[TIME].iloc[-1]
    return frame, float(stopped)


TRIPS = {  # reason of each trip, with its limit
    "overspeed": "rotor speed above {:g} of rated",
    "overpower": "generator power above {:g} of rated",
    "acceleration": "tower-top acceleration above {:g} m/s2",
    "pitch_deviation": "a blade pitch more than {:.3g} deg from its command",
}


def _trip_reason(trip, time, case, turbine):
    """Return the reason of a trip: its name, time and limit."""
    limit = case.trip
    if trip != "overspeed" or limit is None:
        limit = getattr(read_protection(case.protection, turbine.protection), trip).limit
    if trip == "pitch_deviation":
        limit /= DEGREE
    return f"{trip.replace('_', ' ')} trip at {time:.1f} s: {TRIPS[trip].format(limit)}"


def run_controller(run, nominal):
    """Return the controller of a run for simulate; for a parked turbine, idling with feathered blades.

    nominal: the scene for which the controller is prepared.
    Raises: ControllerInputError if the controller cannot be created.
    """
    case = run.case
    if case.parked:
        # no generator torque, blades feathered, rotor free to turn
        feather = nominal.turbine.pitch_drive.maximum
        return Constant(torque=0.0, blade_pitch=feather, name=PARKED) if nominal.wind_speed else None
    control_dt = run.options.get("control_dt", CONTROL_DT)
    try:
        return make(run.controller, nominal.turbine, control_dt)
    except InputError as error:
        raise ControllerInputError(str(error)) from error
