"""fowt list: what the other commands take by name, as tables with what each means and where it is from."""

import json
from collections.abc import Callable
from typing import Annotated, NamedTuple

import typer

from fowt_env.errors import InputError, unknown
from fowt_env.training.cli.console import app, out, reported
from fowt_env.training.cli.tables import figure, print_table

LAST = ("DEMONSTRATION", "comparison only")  # in the summaries of controllers that nobody should choose


class Kind(NamedTuple):
    """One kind of names: where it is used, what it is, its headings, and what makes its rows."""

    option: str
    use: str
    headings: tuple[str, ...]
    rows: Callable[[], list]
    prose: tuple[int, ...] = ()
    right: tuple[int, ...] = ()
    extra: tuple[str, ...] = ()  # further keys of the JSON, whose texts stand at the end of the rows
    notes: int | None = None  # column whose texts stand below the table, once each
    remark: str = ""


def _platforms():
    from fowt_env.descriptions.platform import platform_names, read_platform

    rows = []
    for name in platform_names():
        platform = read_platform(name)
        hull = "strips" if platform.hull is not None else "panels"
        depth = f"{platform.environment.water_depth:.4g}"
        rows.append((name, hull, platform.turbine, depth, _one_line(platform.source)))
    return rows


def _one_line(text):
    """Return the text of a source in one line."""
    return " ".join((text or "not stated").split())


def _turbines():
    from fowt_env.descriptions.turbine import read_turbine, turbine_names
    from fowt_env.descriptions.units import RPM

    rows = []
    for name in turbine_names():
        turbine = read_turbine(name)
        power = turbine.torque_law.rated_power * turbine.drivetrain.generator_efficiency
        values = (turbine.rated_wind_speed, turbine.rated_rotor_speed / RPM)
        rows.append((name, f"{1e-3 * power:.5g}", *map(figure, values), _one_line(turbine.source)))
    return rows


def _winds():
    from fowt_env.descriptions.wind import ALL_KINDS

    file = ("uniform", "wind.wnd, wind.hh", "OpenFAST's uniform wind file: speed, direction, shear over time")
    return [*((name, kind.form, kind.summary) for name, kind in ALL_KINDS.items()), file]


def _seas():
    from fowt_env.descriptions.sea_state import sea_states

    rows = []
    for name, state in sorted(sea_states().items(), key=lambda item: _natural(item[0])):
        period = state.T if state.kind == "regular" else state.Tp
        height = None if state.kind == "components" else state.height
        values = ("" if value is None else f"{value:.4g}" for value in (height, period, state.wind))
        rows.append((name, state.kind.replace("_", "-"), *values, _one_line(state.source)))
    return rows


def _natural(name):
    """Return the key that sorts names with the numbers at their end by size."""
    parts = name.split("_")
    return [(0, float(part), "") if part.isdigit() else (1, 0.0, part) for part in parts]


def _controllers():
    from fowt_env.controllers import CONTROLLERS, information

    rows = []
    for name, factory in CONTROLLERS.items():
        summary, needs = factory.__doc__.splitlines()[0], information(name)
        ahead, blades = "wind_preview" in needs, "azimuth" in needs
        motion = not {"nacelle_velocity", "nacelle_acceleration"}.isdisjoint(needs)
        extra = "wind ahead" if ahead else "blade loads" if blades else "motion" if motion else ""
        last = any(mark in summary for mark in LAST) or name == "constant"
        rows.append((last, ahead, blades, (name, summary, extra, ", ".join(needs))))
    return [row[-1] for row in sorted(rows, key=lambda row: row[:-1])]


def _agents():
    from fowt_env.controllers.policy.controller import AGENTS, POLICY_PREFIX, shipped_agents
    from fowt_env.controllers.policy.network_file import read_policy

    rows = []
    for name in shipped_agents():
        settings, _ = read_policy(AGENTS / f"{name}.npz")
        about = settings["about"]
        acts = f"adds to {settings['baseline']}" if settings["action_mode"] == "residual" else "acts alone"
        ahead = settings["wind_preview"]
        sees = f"wind {max(ahead):g} s ahead" if ahead else "measurements, estimates"
        trained = f"{about['algo'].upper()}, seed {about['seed']}, {about['steps']:,} decisions"
        rows.append((f"{POLICY_PREFIX}{name}", acts, sees, trained))
    return rows


def _suites():
    from fowt_env.training.evaluation.cases import read_suite, suite_names

    rows = []
    for name in suite_names():
        suite = read_suite(name)
        seeds = f"{len(suite.seeds)} x {suite.duration:g} s"
        rows.append((name, str(len(suite.cases)), seeds, suite.description))
    return rows


def _cases():
    from fowt_env.training.evaluation.cases import described, read_suite, suite_names
    from fowt_env.training.evaluation.conditions import described_texts

    rows = []
    for name in suite_names():
        suite = read_suite(name)
        for case in suite.cases:
            length = figure(case.duration or suite.duration)
            rows.append((case.name, name, *described_texts(described(case)), length))
    return rows


def _tasks():
    from fowt_env.envs.tasks import TASKS
    from fowt_env.training.evaluation.conditions import STILL

    rows = []
    for name, task in TASKS.items():
        weathers = task.weathers
        speeds = {f"{wind['speed'][0]:g} to {wind['speed'][1]:g} m/s" for _, wind, _ in weathers}
        kinds = ", ".join(dict.fromkeys(wind["kind"] for _, wind, _ in weathers))
        sea = STILL if all(sea is None for *_, sea in weathers) else "of the site, by the wind"
        rows.append((name, task.summary, f"{kinds}, {', '.join(speeds)}", sea, f"{task.duration:g}"))
    return rows


def _metrics():
    from fowt_env.training.evaluation.metrics import metric_table

    return metric_table()


def _channels():
    from fowt_env.descriptions.channel_meanings import channel_meaning
    from fowt_env.plant.channels import BLADE_CHANNELS, TOWER_CHANNELS, channels

    scenes = dict.fromkeys(channels(1), "")
    scenes |= dict.fromkeys(TOWER_CHANNELS, "; with --option tower=modes")
    scenes |= dict.fromkeys(BLADE_CHANNELS, "; with --option pitch=individual")
    return [
        (channel.name, channel.unit, channel_meaning(channel.name) + scene)
        for channel, scene in scenes.items()
    ]


def _options():
    from fowt_env.scene.options import OPTIONS

    rows = []
    for name, (default, allowed, summary) in OPTIONS.items():
        text = f"{allowed}; default {default}"
        if type(allowed) is tuple:
            text = ", ".join(str(value) for value in sorted(allowed, key=lambda value: value != default))
        rows.append((name, summary, text))
    return rows


def _faults():
    from fowt_env.descriptions.faults import FAULTS

    texts = {kind: fault.summary for kind, fault in FAULTS.items()}
    return [(kind, f"{kind}:100" if "JSON" not in text else "JSON", text) for kind, text in texts.items()]


def _sensors():
    from fowt_env.descriptions.sensors import built_in_chains

    exact = ("exact", "every reading is the plant's own value")
    return [exact, *((name, chain.description) for name, chain in built_in_chains().items())]


def _lidars():
    from fowt_env.descriptions.lidar import lidars

    rows = [(name, _one_line(lidar.source)) for name, lidar in lidars().items()]
    return [("exact", "the wind itself, averaged over the rotor"), *rows]


KINDS = {
    "platforms": Kind(
        "--platform", "floating platforms with turbine, water depth, source",
        ("name", "hull", "turbine", "depth\nm", "source"), _platforms, prose=(4,), right=(3,),
        remark="hull: wave loads by strips (Morison) or from panels (potential flow)."
        " A file of your own: --platform mine.toml",
    ),
    "turbines": Kind(
        "--option turbine=", "turbines, of which every platform has one",
        ("name", "power\nkW", "rated\nwind m/s", "rated\nrpm", "source"), _turbines,
        prose=(4,), right=(1, 2, 3),
    ),
    "winds": Kind(
        "--wind", "kinds of wind, and how each is written",
        ("kind", "--wind", "what it is"), _winds,
        prose=(1, 2), remark="Any of them as JSON, with further keys. Speeds in m/s at hub height.",
    ),
    "seas": Kind(
        "--sea", "sea states with Hs, Tp, source",
        ("name", "kind", "Hs or H\nm", "Tp or T\ns", "wind\nm/s", "source"), _seas,
        prose=(5,), right=(2, 3, 4, 5), notes=5,
        remark="Also jonswap:HS:TP[:GAMMA], regular:H:T (m, s), JSON, or none. wind: that belongs to it.",
    ),
    "controllers": Kind(
        "--controller", "built-in control laws",
        ("name", "what it is", "also uses"), _controllers, prose=(1,),
        extra=("measurements and models",),
        remark="Also policy:NAME (fowt list agents), design:FILE (fowt design) and module:Name (your own).\n"
        "All use generator speed, torque and blade pitch; motion: nacelle and platform. All of it: --json.",
    ),
    "agents": Kind(
        "--controller", "trained agents that come with the package",
        ("name", "how it acts", "what it sees", "training"), _agents, prose=(1, 2, 3),
        remark="An agent of your own: policy:PATH/best.npz",
    ),
    "suites": Kind(
        "--suite", "sets of load cases with seeds and rules",
        ("name", "cases", "seeds", "what it is"), _suites, prose=(3,), right=(1,),
        remark="The cases of one:  fowt list cases above_rated",
    ),
    "cases": Kind(
        "--cases", "load cases: wind, sea, duration",
        ("name", "suite", "wind", "sea", "s"), _cases, prose=(2, 3), right=(4,),
    ),
    "tasks": Kind(
        "make(ID, task=)", "tasks of the Gymnasium environments",
        ("name", "what is to be done", "wind", "sea", "s"), _tasks, prose=(1, 2, 3), right=(4,),
    ),
    "metrics": Kind(
        "results.csv", "what runs are judged by",
        ("name", "unit", "meaning", "better"), _metrics, prose=(2,),
        remark='A column is NAME_[UNIT]: "RotSpeed_std_[rpm]".',
    ),
    "channels": Kind(
        "--initial", "outputs of a run, by OpenFAST's names",
        ("name", "unit", "meaning"), _channels, prose=(2,),
        remark='A column is NAME_[UNIT]: "RotSpeed_[rpm]". FAIRTEN2, ...: further lines.',
    ),
    "options": Kind(
        "--option", "parts of the model, as of build_scene",
        ("option", "what it is", "values, default first"), _options, prose=(1, 2),
        remark="None: that of the fidelity, the platform or the turbine. What is no text is JSON: null.",
    ),
    "faults": Kind(
        "--fault", "what goes wrong in a run",
        ("kind", "--fault", "what happens"), _faults, prose=(2,),
        remark='As JSON: {"kind": "pitch_offset", "time": 100, "offset": 2}',
    ),
    "sensors": Kind(
        "--sensors", "what stands between plant and controller", ("name", "what it is"), _sensors, prose=(1,)
    ),
    "lidars": Kind(
        "--preview", "what sees the wind ahead", ("name", "what it is, and its source"), _lidars, prose=(1,)
    ),
}  # fmt: skip
LIST_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt list[/cyan]  # the kinds of names, how many there are of each, and where they are used

[cyan]fowt list seas[/cyan]  # sea states with Hs, Tp and source

[cyan]fowt list cases above_rated[/cyan]  # wind, sea and duration of the cases of a suite

[cyan]fowt list channels tower[/cyan]  # rows with "tower" in them

[cyan]fowt list metrics --json[/cyan]  # for a program"""


@app.command(name="list", epilog=LIST_EXAMPLES)
@reported
def list_names(
    kind: Annotated[str | None, typer.Argument(help=f"{', '.join(KINDS)}; or all.")] = None,
    part: Annotated[str | None, typer.Argument(help="Show the rows with this text in them.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
):
    """Names that the other commands take, with what each is."""
    if kind is None:
        _print_overview(as_json)
        return
    if kind != "all" and kind not in KINDS:
        raise unknown("kind of name", kind, ("all", *KINDS))
    chosen = list(KINDS) if kind == "all" else [kind]
    found = {name: _rows_with(KINDS[name].rows(), part) for name in chosen}
    if part is not None and not any(found.values()):
        raise InputError(f"no {kind} with {part!r} in them: fowt list {kind} shows them all")
    if as_json:
        tables = {name: _as_mappings(KINDS[name], rows) for name, rows in found.items()}
        out.print_json(json.dumps(tables if kind == "all" else tables[kind]))
        return
    for number, (name, rows) in enumerate(item for item in found.items() if item[1]):
        if number:
            out.print()
        _print_kind(name, rows)


def _rows_with(rows, part):
    """Return the rows in which a text is found; all for None."""
    wanted = (part or "").lower()
    return [row for row in rows if any(wanted in cell.lower() for cell in row)]


def _as_mappings(kind, rows):
    """Return [{heading: text}] of the rows of a Kind."""
    keys = [" ".join(heading.split()) for heading in (*kind.headings, *kind.extra)]
    return [dict(zip(keys, row, strict=True)) for row in rows]


def _print_overview(as_json):
    headings = ("kind", "names", "used in", "what")
    rows = [(name, str(len(kind.rows())), kind.option, kind.use) for name, kind in KINDS.items()]
    if as_json:
        out.print_json(json.dumps([dict(zip(headings, row, strict=True)) for row in rows]))
        return
    print_table(out, headings, rows, left=(0, 2, 3), prose=(3,))
    out.print("\nfowt list KIND  shows one kind,  fowt list KIND TEXT  its rows with that text")


def _print_kind(name, rows):
    kind = KINDS[name]
    left = [i for i in range(len(kind.headings)) if i not in kind.right]
    rows, found = [row[: len(kind.headings)] for row in rows], {}
    if kind.notes is not None:
        found = {row[kind.notes]: "" for row in rows}
        found = {text: str(number) for number, text in enumerate(found, 1)}
        rows = [(*row[: kind.notes], found[row[kind.notes]], *row[kind.notes + 1 :]) for row in rows]
    title = f"{name}: {kind.use} ({kind.option})"
    print_table(out, kind.headings, rows, title, left=left, prose=kind.prose)
    if found:
        out.print()
        notes = [(number, text) for text, number in found.items()]
        print_table(out, (kind.headings[kind.notes], ""), notes, left=(1,), prose=(1,))
    if kind.remark:
        out.print(kind.remark, style="dim", markup=False, highlight=False)
