"""Writes Markdown tables of the actions, observation and reward of a task."""

from math import isinf

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs.observations import entries
from fowt_env.envs.rewards import REWARD_TERMS
from fowt_env.files.markdown import markdown_table


def _formatted(value):
    return str(value) if isinf(value) else f"{value:.4g}"


def action_table(task, turbine):
    """Return a table with the meaning of the actions in each mode."""
    law = turbine.torque_law
    rpm = 30.0 / 3.141592653589793
    low, high = (fraction * turbine.rated_rotor_speed * rpm for fraction in task.setpoint)
    pitch = f"blade-pitch command, {task.blade_pitch[0]:g} to {task.blade_pitch[1]:g} deg"
    rows = [
        ("direct", 0, f"generator torque, 0 to {law.max_torque * 1e-3:.2f} kN m (high-speed shaft)"),
        ("direct", 1, pitch),
        ("setpoint", 0, f"rotor-speed set-point, {low:.2f} to {high:.2f} rpm, tracked by generator torque"),
        ("setpoint", 1, pitch),
        (
            "residual",
            0,
            f"added to the baseline's torque, +-{task.residual_torque * law.rated_torque * 1e-3:.2f} kN m",
        ),
        ("residual", 1, f"added to the baseline's blade pitch, +-{task.residual_pitch:g} deg"),
        ("individual", 0, f"generator torque, 0 to {law.max_torque * 1e-3:.2f} kN m (high-speed shaft)"),
        ("individual", "1 to 3", f"{pitch}, of each blade"),
        ("individual_residual", 0, "as residual"),
        ("individual_residual", "1 to 3", "as residual, of each blade"),
    ]
    return markdown_table(("mode", "action", "from -1 to 1"), rows, aligned=True)


def observation_table(task, turbine):
    """Return a table with index, channel, unit, scaling and bounds of each observation entry."""
    rows = [
        (
            index,
            entry.name,
            entry.unit,
            _formatted(entry.centre),
            _formatted(entry.scale),
            _formatted((entry.low - entry.centre) / entry.scale),
            _formatted((entry.high - entry.centre) / entry.scale),
            entry.meaning,
        )
        for index, entry in enumerate(entries(task.observation, turbine, task.wind_preview))
    ]
    header = ("index", "channel", "unit", "centre", "scale", "low", "high", "meaning")
    return markdown_table(header, rows, aligned=True)


def reward_table(task):
    """Return a table with weight, range and meaning of each reward term."""
    rows = [
        (name, f"{task.weights.get(name, 0.0):g}", f"{term.low:g} to {term.high:g}", term.meaning)
        for name, term in REWARD_TERMS.items()
    ]
    return markdown_table(("term", "weight", "range", "meaning"), rows, aligned=True)


def task_tables(task, turbine=None):
    """Return the action, observation and reward tables of a task in Markdown; turbine: default NREL 5 MW."""
    if turbine is None:
        turbine = read_turbine(read_platform("oc3_hywind").turbine)
    return (
        f"Actions:\n\n{action_table(task, turbine)}\n\n"
        f"Observation, (value - centre)/scale:\n\n{observation_table(task, turbine)}\n\n"
        f"Reward:\n\n{reward_table(task)}\n"
    )
