"""Writes what the reference pages take from the code: `python docs/tools/reference_pages.py`.

docs/reference/cli.md is written whole. In docs/reference/environment.md the text between a pair of marks

    <!-- from the code: NAME -->
    <!-- end -->

is what the function of that name in TABLES returns. A test fails while either is out of step.
"""

import re
from collections import Counter
from functools import partial
from pathlib import Path

import typer
from rich.text import Text

from fowt_env.controllers.bladed.library import MEMORY_SIZE
from fowt_env.controllers.bladed.records import FROM, RECORDS
from fowt_env.controllers.bladed.swap import BLADE_READINGS, READINGS, Swap
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.envs import goals, rewards
from fowt_env.envs.actions import TRACKING_DAMPING, TRACKING_FREQUENCY
from fowt_env.envs.observations import BLADE_CHANNELS, KNOWN, STANDARD, STOP_CHANNELS, entries
from fowt_env.envs.tables import action_table, observation_table
from fowt_env.envs.tasks import TASKS, Episode
from fowt_env.files.atomic import replacing
from fowt_env.files.markdown import markdown_table
from fowt_env.plant.advance import (
    BLOWN_UP,
    CAPSIZE,
    CAPSIZED,
    FASTEST,
    FASTEST_TURN,
    NON_FINITE,
    OVERSPEED,
    STOP_REASONS,
)
from fowt_env.plant.events import EVENTS
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.measurement import HEAD, BladeMeasurement, Measurement, measurement_rows
from fowt_env.registration import ENTRY_POINT, ENVIRONMENTS, LADDER, OBJECTIVES, STEPS
from fowt_env.scene.loads import LOADS
from fowt_env.training.cli.app import app
from fowt_env.training.evaluation.cases import read_suite, suite_names
from fowt_env.training.evaluation.metrics import metric_table

DOCS = Path(__file__).resolve().parents[1]
markdown = partial(markdown_table, aligned=True)
MARK = re.compile(r"(<!-- from the code: (\w+) -->\n).*?(<!-- end -->)", re.S)
PREVIEW = (2.0, 4.0)  # s, look-ahead times of the example in the table of channels

# Each reward term in the symbols of the page's table; tests evaluate them beside the kernels.
FORMULAS = {
    "power": "clip(P / P_rated, 0, 1) * tolerance(P / P_rated, 0, 1, {POWER_MARGIN:g})",
    "rotor_speed": "tolerance(W / W_rated, min(W_0, W_rated) / W_rated, 1, {SPEED_MARGIN:g})",
    "platform_motion": (
        "tolerance(hypot(theta - theta_0, rate * {TILT_PERIOD:g} / (2 * pi)), 0, 0, radians({tilt:g}))"
    ),
    "pitch_travel": "-clip(abs(beta - beta_before) / (beta_rate * control_dt), 0, 1)",
    "torque_travel": "-clip(abs(Q - Q_before) / (Q_rate * control_dt), 0, 1)",
    "failure": "-1 if failed else 0",
    "power_shortfall": "clip(P / P_rated, 0, 1) - 1",
    "standstill": "-clip(abs(W) / W_rated, 0, 1)",
    "platform_rate": "tolerance(abs(rate) * {TILT_PERIOD:g} / (2 * pi), 0, 0, radians({tilt:g}))",
    "tower_top": "-clip((a / {TOP_ACCELERATION:g})**2, 0, 1)",
}
OPTIONS = {  # of reset: the value that is taken in place of the drawn one
    "wind": "wind of the episode, in the form of `build_scene`",
    "sea": "sea of the episode, in the form of `build_scene`; `None`: still water",
    "weather_seed": "seed of turbulence and waves",
    "offsets": "`{channel: offset}` from the operating point, in its unit; replaces all sampled offsets",
    "exact_start": "start at the exact operating point (default if `wind` is set) or an interpolated one",
    "shutdown": "time of the stop signal (s) in a task with a stop; `None`: no stop",
    "faults": "Faults or mappings of their keys, in an environment with protection or faults",
}
assert set(OPTIONS) == set(Episode._fields) and set(FORMULAS) == set(rewards.REWARD_TERMS)


def turbine():
    """The turbine that the figures of the page belong to."""
    return read_turbine(read_platform("oc3_hywind").turbine)


def reward_formulas():
    """{term: its formula as a Python expression}."""
    values = {
        name: getattr(rewards, name)
        for name in ("POWER_MARGIN", "SPEED_MARGIN", "TILT_PERIOD", "TOP_ACCELERATION")
    }
    return {name: text.format(**values, tilt=rewards.TILT_MARGIN / DEGREE) for name, text in FORMULAS.items()}


def _range(value, unit=""):
    """A fixed value, or the range (low, high) that an episode draws from, as text."""
    if not isinstance(value, tuple):
        return f"{value:g}{unit}" if isinstance(value, int | float) else str(value)
    return f"{value[0]:g} to {value[1]:g}{unit}"


def _weather(spec):
    """A wind or sea of a task as text."""
    if spec is None:
        return "none (still water)"
    return ", ".join(f"{key} {_range(value)}" for key, value in spec.items())


def _drawn(task, of):
    """The wind (0) or sea (1) of a task as text; of a mixture each with its share, those alike together."""
    if len(task.weathers) == 1:
        return _weather(task.weathers[0][1 + of])
    total, shares = sum(share for share, _, _ in task.weathers), {}
    for entry in task.weathers:
        text = _weather(entry[1 + of])
        shares[text] = shares.get(text, 0.0) + entry[0] / total
    return "; ".join(f"{100.0 * share:.0f} %: {text}" for text, share in shares.items())


def environments():
    """Registered names, the older version of a name behind the newest."""
    rows = []
    for name, settings in ENVIRONMENTS.items():
        reward = "goals in [0, 1]" if settings.get("reward") else "weighted terms"
        rows.append((f"`{name}`", f"`{settings.get('platform', 'oc3_hywind')}`", reward, f"`{ENTRY_POINT}`"))
    return markdown(("name", "platform", "reward", "class"), rows)


def ladder():
    """Settings of the names for agents."""
    rows = []
    for name, settings in (LADDER | OBJECTIVES).items():
        reach = "-"
        if "residual_pitch" in settings:
            torque = f"{100.0 * settings['residual_torque']:g} % of torque"
            reach = f"{settings['residual_pitch']:g} deg, {torque}"
        decisions = settings["decisions"]
        more = [f"{key} {settings[key]}" for key in ("sensors", "protection", "preview") if key in settings]
        more += [fault["kind"] + " of " + fault["field"] for fault in settings.get("faults", ())]
        more += ["unknown plant"] if "Unknown" in name else []
        more += ["vector of rewards"] if name in OBJECTIVES else []
        rows.append(
            (
                f"`{name}`",
                f"`{settings['task']}`",
                f"{settings['action_mode']}"
                + (f" on `{settings['baseline']}`" if "baseline" in settings else ""),
                reach,
                f"{decisions['hold'] / 10:g} s, low pass {decisions['smoothing']:g} s"
                + (f", washout {decisions['washout']:g} s" if "washout" in decisions else ""),
                ", ".join(more) or "-",
            )
        )
    head = ("name", "task", "actions", "largest additions", "decisions", "more")
    return markdown(head, rows) + f"\n\nAn episode has {STEPS} decisions."


def goals_and_costs():
    """Goals of the reward "score" with weights and usual deviations, and costs."""
    units = {
        "rotor_speed": ("% of rated", 100.0),
        "platform_pitch": ("deg", 1.0 / DEGREE),
        "pitch_travel": ("deg/s", 1.0 / DEGREE),
        "shaft": ("% of rated", 100.0),
    }
    rows = []
    for name, weight in zip(goals.GOALS, goals.WEIGHTS, strict=True):
        unit, factor = units[name]
        usual = ", ".join(f"{factor * value:.3g}" for value in goals.USUAL[name][[0, 1, 3, 6]])
        rows.append((f"`reward/{name}`", f"{weight:.3f}", goals.GOALS[name], f"{usual} {unit}"))
    rows += [(f"`cost/{name}`", "-", text.format_map(vars(goals)), "-") for name, text in goals.COSTS.items()]
    head = ("key of info", "weight", "meaning", "usual deviation at 12, 14, 18, 24 m/s")
    return markdown(head, rows)


def tasks():
    """What sets the tasks apart, and what each episode draws."""
    chosen = list(TASKS.values())
    rated = turbine().rated_rotor_speed / RPM
    rows = [
        ("wind", *(_drawn(task, 0) for task in chosen)),
        ("sea", *(_drawn(task, 1) for task in chosen)),
        ("episode", *(f"{task.duration:g} s" for task in chosen)),
        ("rotor model", *(task.rotor or "the fidelity's" for task in chosen)),
        ("blade-pitch range", *(_range(task.blade_pitch, " deg") for task in chosen)),
        (
            "set-point range",
            *(_range(tuple(fraction * rated for fraction in task.setpoint), " rpm") for task in chosen),
        ),
        (
            "time of the stop signal",
            *("-" if task.shutdown is None else _range(task.shutdown, " s") for task in chosen),
        ),
        ("weather seeds", *(f"{task.weather_seeds[0]} to {task.weather_seeds[1] - 1}" for task in chosen)),
    ]
    return markdown(("", *(f"`{task.name}`" for task in chosen)), rows)


def offsets():
    """What each task adds to the operating point at the start."""
    chosen = list(TASKS.values())
    names = list(dict.fromkeys(name for task in chosen for name in task.offsets))
    units = {"PtfmSurge": "m", "PtfmSway": "m", "PtfmHeave": "m", "RotSpeed": "rpm"}
    rows = [
        (f"`{name}`", units.get(name, "deg"), *(_range(task.offsets.get(name, 0.0)) for task in chosen))
        for name in names
    ]
    return markdown(("channel", "unit", *(f"`{name}`" for name in TASKS)), rows)


def actions():
    """Both actions in each mode."""
    return action_table(TASKS["full_range"], turbine())


def actuators():
    """Limits between a command and the plant."""
    machine = turbine()
    law, drive = machine.torque_law, machine.pitch_drive
    rows = [
        (
            "generator torque",
            f"0 to {law.max_torque * 1e-3:.3f} kN m",
            f"{law.max_torque_rate * 1e-3:g} kN m/s",
        ),
        (
            "blade pitch",
            f"{drive.minimum / DEGREE:g} to {drive.maximum / DEGREE:g} deg",
            f"{drive.rate_limit / DEGREE:g} deg/s, first-order lag of {drive.time_constant:g} s",
        ),
        (
            "loop of the mode `setpoint`",
            "as the generator torque",
            f"PI on rotor speed, {TRACKING_FREQUENCY:g} rad/s, damping ratio {TRACKING_DAMPING:g}",
        ),
    ]
    return markdown(("", "range", "speed"), rows)


def observation():
    """Entries of the tasks' observation."""
    same = {task.observation for task in TASKS.values() if task.shutdown is None}
    assert same == {STANDARD}, "tasks that differ in what is seen need a table each"
    return observation_table(TASKS["above_rated"], turbine())


def channels():
    """Entries of the channels that the tasks leave out."""
    return _entries_of([name for name in (*KNOWN, *STOP_CHANNELS) if name not in STANDARD])


def blades():
    """Entries of the channels of single blades."""
    return _entries_of(BLADE_CHANNELS)


def _entries_of(others):
    machine = turbine()
    rows = [
        (
            f"`{name}`",
            entry.name,
            entry.unit,
            *(f"{value:.4g}" for value in (entry.centre, entry.scale)),
            *(f"{(end - entry.centre) / entry.scale:.4g}" for end in (entry.low, entry.high)),
            entry.meaning,
        )
        for name in others
        for entry in entries((name,), machine, PREVIEW, individual=True)
    ]
    return markdown(("channel", "entry", "unit", "centre", "scale", "low", "high", "meaning"), rows)


def reward():
    """Formula, range and weights of each term."""
    formulas = reward_formulas()
    rows = [
        (
            f"`{name}`",
            f"`{formulas[name]}`",
            f"{term.low:g} to {term.high:g}",
            *(f"{task.weights.get(name, 0.0):g}" for task in TASKS.values()),
        )
        for name, term in rewards.REWARD_TERMS.items()
    ]
    return markdown(("term", "formula", "range", *(f"`{name}`" for name in TASKS)), rows)


def meanings():
    """What each term rewards, in words."""
    return markdown(
        ("term", "meaning"), [(f"`{name}`", term.meaning) for name, term in rewards.REWARD_TERMS.items()]
    )


def terminations():
    """Reasons that end an episode in failure."""
    limits = {
        NON_FINITE: "a number of the state is infinite or not a number",
        CAPSIZED: f"platform pitch beyond +-{CAPSIZE:g} rad ({CAPSIZE / DEGREE:.0f} deg)",
        BLOWN_UP: f"the platform moves faster than {FASTEST:g} m/s or {FASTEST_TURN:g} rad/s",
        OVERSPEED: f"rotor speed above {turbine().overspeed / RPM:g} rpm (the turbine's `overspeed_rpm`)",
    }
    return markdown(
        ('`info["termination"]`', "when"),
        [(f"`{STOP_REASONS[status]}`", text) for status, text in limits.items()],
    )


def measurements():
    """Fields of a Measurement."""
    return _measured(Measurement)


def blade_measurements():
    """Fields of a BladeMeasurement."""
    return _measured(BladeMeasurement)


def _measured(of):
    rows = [(f"`{name}`", *rest) for name, *rest in measurement_rows(of)]
    return markdown(HEAD, rows)


def options():
    """What reset takes as options."""
    return markdown(("option", "meaning"), [(f"`{name}`", text) for name, text in OPTIONS.items()])


def events():
    """Counters of rare events."""
    rows = [(f"`{c.name}`", e.meaning, "yes" if e.harmful else "no", e.advice) for c, e in EVENTS.items()]
    return markdown(("counter", "counted event", "loads less accurate", "remedy"), rows)


def bladed_records():
    """Records that a library with the Bladed interface is given, with what each holds here."""
    turbine = read_turbine("nrel5mw")
    fine = turbine.pitch_drive.model_copy(update={"minimum": 0.01})  # 0 would look like a record of nothing
    turbine = turbine.model_copy(update={"pitch_drive": fine})
    swap = Swap(bytearray(MEMORY_SIZE), turbine, 0.1, "DISCON.IN", "run", individual=True)
    values = {
        name: f"`{'-' if sign < 0.0 else ''}{field.name.lower()}`" for name, (field, sign) in READINGS.items()
    }
    values |= {name: f"`{field.name.lower()}`" for name, field in BLADE_READINGS.items()}
    values |= dict.fromkeys(("shaft_power", "electrical_power"), "`generator_torque`, `generator_speed`")
    values |= dict.fromkeys(("status", "last_pitch_demand"), "run")
    rows = []
    for record in RECORDS:
        if record.direction != FROM:
            constant = "turbine, run" if swap.records[record.index] else "0"
            value = values.get(record.name, constant)
            rows.append((record.number, f"`{record.name}`", record.unit, record.meaning, value))
    return markdown(("record", "name", "unit", "meaning", "value here"), rows)


def loads():
    """The loads of the plant, with what leaves each out."""
    rows = []
    for name, load in LOADS.items():
        absent = [f"`{option}={value!r}`" for option, value in load.without.items()]
        absent += [f"`{key}` zero in the platform file" for key in load.keys]
        files = ", ".join(f"`{file}`" for file in load.file.split(", "))
        rows.append((name, load.summary, load.section, files, ", ".join(absent) or "never"))
    return markdown(("load", "description", "section", "in `fowt_env/plant/`", "disabled by"), rows)


def suites():
    """Cases, seeds and times of the built-in suites."""
    rows = []
    for name in suite_names():
        suite = read_suite(name)
        scored = f"{suite.duration:g} s after {suite.skip:g} s" if suite.skip else f"{suite.duration:g} s"
        rows.append((f"`{name}`", len(suite.cases), len(suite.seeds), scored, suite.description))
    return markdown(("suite", "cases", "seeds", "run", "description"), rows)


def metrics():
    """Metrics that are more than statistics of one channel."""
    statistics = tuple(f"_{name}" for name in ("mean", "std", "min", "max"))
    rows = [
        (f"`{name}_[{unit}]`", meaning)
        for name, unit, meaning, _ in metric_table()
        if not name.endswith(statistics) or "capped" in name
    ]
    return markdown(("metric", "definition"), rows)


def integrators():
    """Facts of the integrators."""
    rows = [
        (
            f"`{name}`", method.order, method.evaluations, f"{method.dt:g}", f"{method.decay_limit:g}",
            f"{method.oscillation_limit:g}" if method.oscillation_limit else "none",
        )
        for name, method in INTEGRATORS.items()
    ]  # fmt: skip
    head = ("name", "order", "evaluations per step", "default step, s", "decay", "oscillation")
    return markdown(head, rows)


TABLES = {
    "reference/environment.md": (
        environments, ladder, tasks, offsets, actions, actuators, observation, channels, blades,
        goals_and_costs, reward, meanings, terminations, options, events,
    ),
    "reference/controllers.md": (measurements, blade_measurements),
    "explanation/theory.md": (loads, integrators),
    "guides/your-dll.md": (bladed_records,),
    "reference/suites.md": (suites, metrics),
}  # fmt: skip


def with_tables(page, text):
    """Text of a page of TABLES with each marked table as the code gives it now."""
    made = {table.__name__: table for table in TABLES[page]}
    found = [match.group(2) for match in MARK.finditer(text)]
    if sorted(found) != sorted(made):
        raise ValueError(f"marks {found} are not one for each of {list(made)}")
    return MARK.sub(lambda match: f"{match.group(1)}\n{made[match.group(2)]()}\n\n{match.group(3)}", text)


def cli_page():
    """The reference of the command line as markdown."""
    root = typer.main.get_command(app)
    shared = _shared([list(_inner(command)) for command in root.commands.values() if not command.hidden])
    lines = [
        "# Command line",
        "Generated by `python docs/tools/reference_pages.py`; `--help` prints the same text.",
        "Exit codes: 0 done; 1 a run stopped, or a check failed; 2 invalid argument; 130 interrupted.",
        "New folders are created in the working folder only, with a message. Ranges include their"
        " end: `--winds 4:24:1` includes 24, `--seeds 1:6:1` includes 6.",
        "## Options of several commands",
        _options_table(shared),
    ]
    for group, names in root.by_group().items():
        lines.append(f"## {group}")
        lines += [text for name in names for text in _sections(root.commands[name], f"fowt {name}", shared)]
    return "\n\n".join(lines) + "\n"


def _inner(command):
    """The command, or those of a group and of its groups."""
    if not hasattr(command, "commands"):
        return [command]
    return [each for inner in command.commands.values() if not inner.hidden for each in _inner(inner)]


def _entries(command):
    """[(names, default, meaning)] of a command's parameters that are shown."""
    return [_parameter(p) for p in command.params if p.name != "help" and not getattr(p, "hidden", False)]


def _shared(families):
    """Entries of options that commands of two or more families, lists of commands, have alike, in order."""
    count = Counter(
        entry
        for family in families
        for entry in dict.fromkeys(e for command in family for e in _entries(command))
    )
    return [entry for entry, times in count.items() if times > 1 and entry[0].startswith("--")]


def _sections(command, name, shared):
    """Sections of a command, or of a group with its commands and groups."""
    level = "#" * (2 + len(name.split()) - 1)
    if not hasattr(command, "commands"):
        return [_section(command, name, shared, level)]
    inner = {key: each for key, each in command.commands.items() if not each.hidden}
    own = [entry for entry in _shared([_inner(each) for each in inner.values()]) if entry not in shared]
    lines = [f"{level} `{name}`", _plain(command.help)] + ([_options_table(own)] if own else [])
    known = [*shared, *own]
    return lines + [text for key in inner for text in _sections(inner[key], f"{name} {key}", known)]


def _section(command, name, shared, level):
    """Heading, purpose, parameters and examples of one command."""
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    wanted = "".join(f" {p.name.upper()}" if p.required else f" [{p.name.upper()}]" for p in arguments)
    lines = [f"{level} `{name}{wanted}`", _plain(command.help)]
    entries = _entries(command)
    own = [entry for entry in entries if entry not in shared]
    also = [f"`{entry[0].split()[0]}`" for entry in entries if entry in shared]
    if own:
        lines.append(_options_table(own))
    if also:
        lines.append(f"Also {', '.join(also)}.")
    if command.epilog:
        lines.append(_examples(command.epilog))
    return "\n\n".join(lines)


def _parameter(parameter):
    """(names, default, meaning) of an option or argument, as texts."""
    if parameter.param_type_name == "argument":
        names = parameter.name.upper()
    else:
        names = " ".join((*parameter.opts, *parameter.secondary_opts))
    default, pair = parameter.default, parameter.secondary_opts
    shown = "" if default in (None, []) else str(default)
    if getattr(parameter, "is_flag", False):
        shown = (parameter.opts if default else pair)[0] if pair else ""
    return names, shown, _plain(parameter.help or "")


def _options_table(entries):
    """Table of (names, default, meaning): the default stands in brackets behind the names."""
    rows = [
        (
            " ".join(f"`{name}`" for name in names.split()) + (f" (`{default}`)" if default else ""),
            meaning,
        )
        for names, default, meaning in entries
    ]
    return markdown_table(("option (default)", "meaning"), rows)


def _examples(epilog):
    """The coloured examples of a help text as a block of code, and what stands beside them."""
    lines, rest = [], []
    for paragraph in epilog.split("\n\n"):
        text = " ".join(paragraph.split())
        example = re.fullmatch(r"\[cyan\](.*?)\[/cyan\]\s*(.*)", text)
        if example:
            remark = f"  {_plain(example.group(2))}" if example.group(2) else ""
            lines.append(_plain(example.group(1)) + remark)
        elif text not in ("[bold]Examples[/bold]", "[bold]Example[/bold]"):
            rest.append(_plain(text))
    block = "```bash\n" + "\n".join(lines) + "\n```" if lines else ""
    return "\n\n".join(part for part in (block, *rest) if part)


def _plain(text):
    """Text without rich's markup."""
    return " ".join(Text.from_markup(text or "").plain.split())


def main():
    """Write the pages."""
    pages = {page: with_tables(page, (DOCS / page).read_text()) for page in TABLES}
    for page, text in (pages | {"reference/cli.md": cli_page()}).items():
        with replacing(DOCS / page) as target:
            target.write_text(text)


if __name__ == "__main__":
    main()
