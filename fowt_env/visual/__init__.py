"""Provides plots, images and animations. Plot functions of runs are imported from here on first use."""

from importlib import import_module
from typing import Any

_PLOTS = {
    "plot_run": "time_series",
    "plot_runs": "time_series",
    "plot_spectra": "time_series",
    "plot_boxes": "response",
    "plot_raos": "response",
    "plot_schedule": "response",
}
__all__ = sorted(_PLOTS)


def __getattr__(name: str) -> Any:
    if name in _PLOTS:
        return getattr(import_module(f"fowt_env.visual.{_PLOTS[name]}"), name)
    raise AttributeError(f"module 'fowt_env.visual' has no attribute {name!r}")
