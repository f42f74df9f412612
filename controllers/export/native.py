"""Writes the C code of compiled laws: a header and a file, which need no Python when they run.

The numbers of a law are those of its parameter array, so a prepared controller is exported with its gains,
models and limits. The laws themselves are in c/, one file each, with the names of the Python module's
entries; tests compare them with the compiled laws.
"""

import json
import re
from dataclasses import dataclass, field
from math import isinf, isnan, pi
from pathlib import Path

import numpy as np

import fowt_env
from fowt_env.control import CompiledController
from fowt_env.controllers.export.hosted import (
    MEAN_PITCH,
    RECORD_OF,
    VELOCITY,
    fields_of,
    velocity_decay,
)
from fowt_env.controllers.floating_feedback import (
    SIGNALS,
    FeedbackMemory,
    FeedbackParameter,
    FloatingFeedback,
)
from fowt_env.controllers.gspi import GSPI, LAST_SPEED, PERIODS
from fowt_env.controllers.ipc.law import IPC, NYQUIST_SHARE, TILT_NOTCHES, CyclicMemory, CyclicParameter
from fowt_env.controllers.ipc.law import N_MEMORY as IPC_MEMORY
from fowt_env.controllers.lqr import design, estimator
from fowt_env.controllers.lqr.law import FORGETTING, INTEGRAL_LIMIT, LQR, STARTING
from fowt_env.controllers.mpc import clone
from fowt_env.controllers.mpc import law as mpc
from fowt_env.controllers.mpc.clone import MPCClone
from fowt_env.controllers.pi import PI, Memory, Parameter
from fowt_env.controllers.policy.controller import PolicyController
from fowt_env.envs.actions import ActionMode
from fowt_env.envs.observations import ESTIMATED, ESTIMATES, FIRST_ACTION
from fowt_env.errors import InputError
from fowt_env.plant.drivetrain import TorqueCurve, build_torque_curve, build_torque_limits
from fowt_env.plant.measurement import BLADES_MEASURED, MEASURED, Measure

TEMPLATES = Path(__file__).parent / "c"
FAMILIES = {
    IPC: "ipc", GSPI: "gspi", FloatingFeedback: "floating_feedback", LQR: "lqr", PI: "pi",
    MPCClone: "mpc_clone",
}  # fmt: skip
METHODS = ("kernel", "reset", "act")  # that a law in C repeats


@dataclass
class Code:
    """Collects what the C file of a law begins with."""

    enums: dict = field(default_factory=dict)  # name -> int
    macros: dict = field(default_factory=dict)  # name -> float or text
    tables: dict = field(default_factory=dict)  # name -> (C type, values)
    texts: dict = field(default_factory=dict)  # name -> C text, in the order of their use

    def add(self, *names):
        """Add files of c/ unless they are there."""
        for name in names:
            self.texts.setdefault(name, template(name))

    def table(self, name):
        """Return the C text of a table."""
        kind, values = self.tables[name]
        write = {"int": str, "double": number, "float": "{!s}f".format}[kind]
        words = [write(value) for value in values]
        rows = [", ".join(words[i : i + 5]) for i in range(0, len(words), 5)]
        return f"static const {kind} {name}[{len(words)}] = {{\n    " + ",\n    ".join(rows) + "\n};\n"


def native_law(controller):
    """Return whether the law of a controller is available in C."""
    inner = getattr(controller, "controller", controller)
    if isinstance(inner, PolicyController):
        baseline = inner._baseline
        return not inner.preview_times and (baseline is None or native_law(baseline))
    return isinstance(inner, CompiledController) and family(inner) is not None


def family(controller):
    """Return the name of a compiled law in C, None without one: a subclass may have another law or start."""
    for kind, name in FAMILIES.items():
        if isinstance(controller, kind):
            own = type(controller)
            return name if all(getattr(own, key) is getattr(kind, key) for key in METHODS) else None
    return None


def write_law(controller, turbine, control_dt, stem, title):
    """Return (header, file) of the C code of a prepared controller with a native_law.

    stem: prefix of the names in C and name of both files; title: first line of both.
    """
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", stem):
        raise InputError(f"export: {stem!r}: must be a C identifier, which names the functions")
    code = Code()
    fields = fields_of(controller)
    _common(code, controller, fields, turbine, control_dt)
    inner = getattr(controller, "controller", controller)
    code.add("common.c")
    if isinstance(inner, PolicyController):
        size, name, table = _policy(code, inner, fields), "policy", ""
    else:
        size, name, table = _law(code, inner, "PARAMETERS"), family(inner), "PARAMETERS, "
    start, step = f"{name}_start({table}memory, reading)", f"{name}_step({table}memory, reading, command)"
    code.texts["law"] = (
        _function("start_law", "double *memory, const double *reading", [start])
        + "\n"
        + _function("step_law", "double *memory, const double *reading, double *command", [step])
    )
    marks = {
        "TITLE": title, "VERSION": fowt_env.__version__, "STEM": stem, "GUARD": stem.upper(),
        "CONTROL_DT": f"{control_dt:g}", "MEMORY": str(size), "FIELDS": _field_lines(stem, fields),
    }  # fmt: skip
    header = template("law.h")
    for name, text in marks.items():
        header = header.replace(f"@{name}@", text)
    code.add("step.c")
    parts = [template(name) for name in ("curve.c", "records.c", "discon.c") if name not in code.texts]
    interface, body = "\n".join([code.table("CURVE"), *parts]), "\n".join(code.texts.values())
    lines = [
        f"/* {title}\n   Made by fowt_env {fowt_env.__version__}; the laws are those of its folder"
        " controllers/export/c. */",
        "#include <math.h>", "#include <stddef.h>", "#include <string.h>", f'#include "{stem}.h"', "",
        *(f"#define controller_{name} {stem}_{name}" for name in ("type", "start", "step")), "",
        _beginning(code), body, "#ifndef FOWT_WITHOUT_DISCON", "",
        f"#define LIBRARY {json.dumps(title)}", template("records.h"), _reads(fields), interface, "#endif",
    ]  # fmt: skip
    return header, "\n".join(lines) + "\n"


def template(name):
    """Return the text of a file of c/."""
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _function(name, arguments, calls):
    """Return a C function that makes calls; arguments that these do not use are marked."""
    words = [word.split()[-1].lstrip("*") for word in arguments.split(", ")]
    unused = [] if calls else [f"(void){word}" for word in words]
    body = "".join(f"    {line};\n" for line in (*calls, *unused))
    return f"static void {name}({arguments})\n{{\n{body}}}\n"


def _common(code, controller, fields, turbine, control_dt):
    """Add fields and limits, and the torque curve on which a law starts in a host."""
    code.tables["CURVE"] = "double", [*build_torque_curve(turbine.torque_law)]
    limits, drive = build_torque_limits(turbine.torque_law), turbine.pitch_drive
    individual = int(bool(controller.individual))
    code.enums |= {name.upper(): i for i, name in enumerate(fields)}
    first = fields.index("blade_pitch_1" if individual else "blade_pitch")
    code.enums |= {"N_FIELDS": len(fields), "INDIVIDUAL": individual, "FIRST_PITCH": first}
    code.enums |= {f"CURVE_{name.upper()}": i for i, name in enumerate(TorqueCurve._fields)}
    code.macros |= {
        "LIMIT_DT": control_dt, "LIMIT_TORQUE": limits.maximum, "LIMIT_TORQUE_RATE": limits.rate_limit,
        "LIMIT_PITCH_MINIMUM": drive.minimum, "LIMIT_PITCH_MAXIMUM": drive.maximum,
        "LIMIT_PITCH_RATE": drive.rate_limit, "VELOCITY_LEFT": velocity_decay(control_dt),
    }  # fmt: skip


def _law(code, controller, table):
    """Add a compiled law with its parameters as a table, shared if equal; return the size of its memory."""
    name = family(controller)
    code.add("rate_limit.c", "curve.c")
    same = [key for key, (_, values) in code.tables.items() if np.array_equal(values, controller.parameters)]
    if same:
        code.macros[table] = same[0]
    else:
        code.tables[table] = "double", controller.parameters
    if name == "lqr":
        _lqr_names(code)
        code.add("estimator.c", "speed_integral.c", "lqr.c")
        return len(controller.memory)
    if name == "mpc_clone":
        _lqr_names(code)
        _clone_names(code)
        code.add("estimator.c", "speed_integral.c", "mpc_clone.c")
        return len(controller.memory)
    code.enums |= {f"PI_{entry.name}": int(entry) for entry in Parameter}
    code.enums |= {f"PI_M_{entry.name}": int(entry) for entry in Memory}
    code.add("pi.c")
    if name == "gspi":
        code.enums |= {"GSPI_PERIODS": int(PERIODS), "GSPI_M_LAST_SPEED": LAST_SPEED}
    elif name == "floating_feedback":
        code.enums |= {f"FEEDBACK_{entry.name}": int(entry) for entry in FeedbackParameter}
        code.enums |= {f"FEEDBACK_M_{entry.name}": int(entry) for entry in FeedbackMemory}
        signal = Measure(int(controller.parameters[FeedbackParameter.SIGNAL])).name.lower()
        code.enums["FEEDBACK_SIGNAL_FIELD"] = code.enums[next(s for s in SIGNALS if s == signal).upper()]
    elif name == "ipc":
        code.enums |= {f"IPC_{entry.name}": int(entry) for entry in CyclicParameter}
        code.enums |= {f"IPC_M_{entry.name}": int(entry) for entry in CyclicMemory}
        code.enums |= {"IPC_TILT_NOTCHES": TILT_NOTCHES, "IPC_N_MEMORY": int(IPC_MEMORY)}
        code.enums["IPC_IN_PLANE"] = code.enums.get("ROOT_IN_PLANE_1", 0)  # read by flapwise laws alone
        code.macros["IPC_HIGHEST_ANGLE"] = NYQUIST_SHARE * pi
    if name != "floating_feedback":
        code.add("pi_step.c")
    code.add("pi_law.c" if name == "pi" else f"{name}.c")
    return len(controller.memory)


def _lqr_names(code):
    """Add the names of the LQG law's arrays."""
    e = estimator
    code.enums |= {f"LQR_{entry.name}": int(entry) for entry in e.Head}
    code.enums |= {f"LQR_B_{name}": getattr(e, name) for name in "TRIM TORQUE PITCH A B C L K".split()}
    entries = "OPERATING_WIND INTEGRAL TORQUE_COMMAND PITCH_COMMAND INNOVATION DEVIATION FED_BACK STARTED"
    code.enums |= {f"LQR_M_{name}": getattr(e, name) for name in entries.split()}
    sizes = ("N_PLANT", "N_SENSORS", "N_STATE", "N_FEEDBACK")
    code.enums |= {f"LQR_{name}": getattr(design, name) for name in sizes}
    code.enums |= {
        "LQR_BLOCKS": e.BLOCKS, "LQR_BLOCK": e.BLOCK, "LQR_ROTOR": e.ROTOR, "LQR_N_MEMORY": e.N_MEMORY,
        "LQR_WIND": design.WIND, "LQR_MOMENT": design.MOMENT,
    }  # fmt: skip
    code.macros |= {
        "LQR_INTEGRAL_LIMIT": INTEGRAL_LIMIT, "LQR_FORGETTING": FORGETTING, "LQR_STARTING": STARTING,
    }  # fmt: skip


def _clone_names(code):
    """Add the names of the arrays of the clone of mpc."""
    code.enums |= {f"CLONE_{entry.name}": int(entry) for entry in mpc.Entry}
    code.enums |= {f"CLONE_M_{entry.name}": int(entry) for entry in (*mpc.Memory, *clone.CloneMemory)}
    entries = (
        "CURVE EVERY ESTIMATOR MEAN SCALE WEIGHT_0 BIAS_0 WEIGHT_1 BIAS_1 WEIGHT_2 BIAS_2 HIDDEN N_INPUTS"
    )
    code.enums |= {f"CLONE_{name}": int(getattr(clone, name)) for name in entries.split()}
    code.enums |= {
        "CLONE_X_TORQUE": clone.TORQUE_STATE, "CLONE_X_PITCH": clone.COMMAND,
        "CLONE_X_INTEGRAL": clone.INTEGRAL, "CLONE_X_FILTER": clone.FILTER,
    }  # fmt: skip
    code.macros["CLONE_RESTING"] = mpc.RESTING


def _policy(code, policy, fields):
    """Add an agent with its estimator and baseline; return the size of its memory."""
    settings, network, decisions = policy.settings, policy.network, policy._decisions
    observed, chosen, actions = policy._observation_map, decisions.settings, policy._actions
    channels, instants = len(observed.signal), chosen.history + 1
    size = channels * instants
    at, entries = 0, {}
    for name, length in (
        ("ACCEPTED", 2), ("ACTION", 2), ("SMOOTHED", 2), ("LASTING", 2), ("MEAN", 1), ("VARIANCE", 1),
        ("DECISION", 2), ("TRACKING", 1), ("CALLS", 1), ("PERIOD", 1), ("NEWEST", channels),
        ("HISTORY", size), ("ESTIMATOR", 0),
    ):  # fmt: skip
        entries[f"POLICY_M_{name}"] = at
        at += length
    baseline_at = at + (0 if policy._estimator is None else len(policy._estimator.memory))
    total = baseline_at
    start, estimate, baseline = [], [], []
    if policy._estimator is not None:
        _lqr_names(code)
        code.tables["ESTIMATOR"] = "double", policy._estimator.parameters
        code.add("estimator.c")
        start.append("estimator_start(ESTIMATOR, memory + POLICY_M_ESTIMATOR, reading)")
        estimate.append("estimate(ESTIMATOR, memory + POLICY_M_ESTIMATOR, reading, command)")
    if policy._baseline is not None:
        name = family(policy._baseline)
        total += _law(code, policy._baseline, "BASELINE")
        start.append(f"{name}_start(BASELINE, memory + {baseline_at}, reading)")
        baseline.append(f"{name}_step(BASELINE, memory + {baseline_at}, reading, command)")
    code.enums |= entries
    shape = decisions.constants
    sizes = [size, *(len(bias) for bias in network.biases)]
    layers = zip(network.weights, network.biases, strict=True)
    weights = np.concatenate([np.append(weight.ravel(), bias) for weight, bias in layers])
    code.enums |= {f"POLICY_{mode.name}": int(mode) for mode in ActionMode}
    code.enums |= {
        "POLICY_CHANNELS": channels, "POLICY_INSTANTS": instants, "POLICY_WIND_ENTRY": shape.wind,
        "POLICY_HOLD": chosen.hold, "POLICY_LAYERS": len(network.weights), "POLICY_WIDEST": max(sizes),
        "POLICY_TANH": int(network.activation is np.tanh), "POLICY_SHAPED": int(shape.shaped),
        "POLICY_SQUASH_TANH": int(settings["squash"] == "tanh"), "POLICY_MODE": int(policy._mode),
        "POLICY_FIRST_ACTION": len(fields), "POLICY_ESTIMATES": len(fields) + 2,
    }  # fmt: skip
    code.macros |= {
        "POLICY_WIND_SCALE": shape.wind_scale, "POLICY_WIND_CENTRE": shape.wind_centre,
        "POLICY_LASTING": shape.lasting,
        "POLICY_FRACTION": shape.fraction, "POLICY_PASSING": shape.passing,
        "POLICY_AUTHORITY_LOW": shape.weak, "POLICY_AUTHORITY_RANGE": shape.strong - shape.weak,
        "POLICY_CLIP": network.clip,
        "POLICY_ACTION_LOW": actions.low, "POLICY_ACTION_HIGH": actions.high,
        "POLICY_PITCH_LOW": actions.pitch_low, "POLICY_PITCH_HIGH": actions.pitch_high,
        "POLICY_RESIDUAL_TORQUE": actions.residual_torque, "POLICY_RESIDUAL_PITCH": actions.residual_pitch,
        "POLICY_TRACKING_GAIN": actions.tracking_gain, "POLICY_TRACKING_RATE": actions.tracking_rate,
    }  # fmt: skip
    code.tables |= {
        "POLICY_SIGNAL": ("int", [_signal(int(signal), fields) for signal in observed.signal]),
        "POLICY_CENTRE": ("double", observed.centre), "POLICY_SCALE": ("double", observed.scale),
        "POLICY_LOW": ("double", observed.low), "POLICY_HIGH": ("double", observed.high),
        "POLICY_MEAN": ("double", network.mean), "POLICY_DEVIATION": ("double", network.scale),
        "POLICY_SIZES": ("int", sizes), "POLICY_WEIGHTS": ("float", weights),
    }  # fmt: skip
    reads = "double *memory, const double *reading"
    code.texts["parts of the policy"] = "\n".join((
        _function("policy_start_parts", reads, start),
        _function("policy_estimate", f"{reads}, const double *command", estimate),
        _function("policy_baseline", f"{reads}, double *command", baseline),
    ))  # fmt: skip
    code.add("policy.c")
    return total


def _signal(signal, fields):
    """Return the index of an observed signal: of a reading, an action or an estimate."""
    if signal >= ESTIMATES and signal < ESTIMATES + len(ESTIMATED):
        return len(fields) + 2 + signal - ESTIMATES
    if signal in (FIRST_ACTION, FIRST_ACTION + 1):
        return len(fields) + signal - FIRST_ACTION
    return fields.index(Measure(signal).name.lower())


def _field_lines(stem, fields):
    """Return the lines of the enum of readings in the header."""
    table, lines = MEASURED | BLADES_MEASURED, []
    for name in fields:
        known = table[name]
        positive = f", positive {known.positive}" if known.positive else ""
        lines += [f"    /* {known.unit}: {known.meaning}{positive} */", f"    {stem.upper()}_{name.upper()},"]
    return "\n".join([*lines, f"    {stem.upper()}_READINGS"])


def _reads(fields):
    """Return the C table of the records that are read."""
    special = {MEAN_PITCH: "MEAN_PITCH", VELOCITY: "NACELLE_VELOCITY_INTEGRAL"}
    rows = []
    for name in fields:
        number = RECORD_OF[name]
        lacking = f"{name}, record {number}, is not sent: it needs the extended interface, as of OpenFAST 5"
        rows.append(f'    {{{special.get(number, number)}, "{lacking}"}}')
    kinds = _enum({"MEAN_PITCH": MEAN_PITCH, "NACELLE_VELOCITY_INTEGRAL": VELOCITY})
    table = "static const struct { int record; const char *lacking; } READ[N_FIELDS] = {\n"
    return kinds + "\n" + table + ",\n".join(rows) + "\n};\n"


def _enum(values):
    """Return the C text of an enum of {name: int}."""
    rows = ",\n".join(f"    {name} = {value}" for name, value in values.items())
    return f"enum {{\n{rows}\n}};\n"


def number(value):
    """Return a number as C text, with all its digits."""
    value = float(value)
    if isnan(value):
        return "NAN"
    if isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(value)


def _beginning(code):
    """Return the C text of enums, macros and tables."""
    lines = [_enum(code.enums)]
    for name, value in code.macros.items():
        lines.append(f"#define {name} {value if isinstance(value, str) else f'({number(value)})'}")
    lines.append("")
    lines += [code.table(name) for name in code.tables if name != "CURVE"]
    return "\n".join(lines)
