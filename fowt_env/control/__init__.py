"""Defines the protocol of controllers, the information that they read, and controllers by name."""

from fowt_env.control.information import (
    EXACT,
    PRIVILEGED_INPUTS,
    USUAL_LIDAR,
    check_pitches,
    declares_blades,
    foreseen,
    hidden,
    known_scene,
    lidar_of,
    mask,
    preview_leads,
)
from fowt_env.control.making import catalogue, check_control_dt, make
from fowt_env.control.protocol import (
    CheckedController,
    CompiledController,
    Controller,
    FunctionController,
    call_law,
)
from fowt_env.control.units import CommandUnits
from fowt_env.control.views import (
    BladeView,
    MeasurementView,
    values_of_blades,
    view_of,
    whole_view,
    wind_ahead,
    with_wind_ahead,
)

__all__ = [
    "BladeView",
    "CheckedController",
    "CommandUnits",
    "CompiledController",
    "Controller",
    "EXACT",
    "FunctionController",
    "MeasurementView",
    "PRIVILEGED_INPUTS",
    "USUAL_LIDAR",
    "call_law",
    "catalogue",
    "check_control_dt",
    "check_pitches",
    "declares_blades",
    "foreseen",
    "hidden",
    "known_scene",
    "lidar_of",
    "make",
    "mask",
    "preview_leads",
    "values_of_blades",
    "view_of",
    "whole_view",
    "wind_ahead",
    "with_wind_ahead",
]
