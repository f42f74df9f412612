"""Implements fowt list: tables of the names that the other commands accept, with meanings and sources."""

import json
from collections.abc import Callable
from typing import Annotated, NamedTuple

from rich.text import Text
from typer import Argument, Option

from fowt_env.descriptions.checks import parse_number
from fowt_env.display import number_text
from fowt_env.errors import InputError, unknown
from fowt_env.training.cli.console import command, out
from fowt_env.training.cli.tables import print_table

SITE_HUB = 100.0  # m, height of the winds of sites
LAST = ("DEMONSTRATION", "comparison only")  # marks of controllers not for use, which are listed last


class Kind(NamedTuple):
    """Describes a kind of names: the option that takes them, their use, headings and source of rows."""

    option: str
    use: str
    headings: tuple[str, ...]
    rows: Callable[[], list]
    remark: str = ""
    extra: tuple[str, ...] = ()  # further keys of the JSON, for the last texts of each row
    notes: int | None = None  # column whose texts are printed below the table, once each


def _platforms():
    from fowt_env.descriptions.platform import platform_names, read_platform

    return [
        (
            *(name, "strips" if platform.hull is not None else "panels", platform.turbine),
            *(f"{platform.environment.water_depth:.4g}", _one_line(platform.source)),
        )
        for name, platform in ((name, read_platform(name)) for name in platform_names())
    ]


def _one_line(text):
    """Return the text of a source on one line."""
    return " ".join((text or "not stated").split())


def _turbines():
    from fowt_env.descriptions.turbine import read_turbine, turbine_names
    from fowt_env.descriptions.units import RPM

    rows = []
    for turbine in map(read_turbine, turbine_names()):
        power = 1e-3 * turbine.torque_law.rated_power * turbine.drivetrain.generator_efficiency
        values = (number_text(turbine.rated_wind_speed), number_text(turbine.rated_rotor_speed / RPM))
        rows.append((turbine.name, f"{power:.5g}", *values, _one_line(turbine.source)))
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
    """Return a sort key that compares the numbers in a name by value."""
    parts = name.split("_")
    return [(0, float(part), "") if part.isdigit() else (1, 0.0, part) for part in parts]


def _controllers():
    from fowt_env.controllers import CONTROLLERS, information

    rows = []
    for name, factory in CONTROLLERS.items():
        summary, needs = factory.__doc__.splitlines()[0], information(name)
        preview, lidar, blades = (key in needs for key in ("wind_preview", "lidar", "azimuth"))
        ahead = preview or lidar
        motion = not {"nacelle_velocity", "nacelle_acceleration"}.isdisjoint(needs)
        extra = "blade loads" if blades else "motion" if motion else ""
        extra = "lidar" if lidar else "wind preview" if preview else extra
        last = any(mark in summary for mark in LAST) or name == "constant"
        rows.append((last, ahead, blades, (name, summary, extra, ", ".join(needs))))
    return [row[-1] for row in sorted(rows, key=lambda row: row[:-1])]


def _agents():
    from fowt_env.controllers.policy.controller import AGENTS, POLICY_PREFIX, shipped_agents
    from fowt_env.controllers.policy.network_file import read_policy

    rows = []
    for name in shipped_agents():
        settings, _ = read_policy(AGENTS / f"{name}.npz")
        about, ahead = settings["about"], settings["wind_preview"]
        acts = f"adds to {settings['baseline']}" if settings["action_mode"] == "residual" else "acts alone"
        sees = f"wind {max(ahead):g} s ahead" if ahead else "measurements, estimates"
        trained = f"{about['algo'].upper()}, seed {about['seed']}, {about['steps']:,} decisions"
        rows.append((f"{POLICY_PREFIX}{name}", acts, sees, trained))
    return rows


def _sites():
    from fowt_env.training.loads.site import Climate, read_site, site_names

    rows = []
    for name in site_names():
        site = read_site(name)
        wind, Hs, Tp, _, _ = Climate(site, SITE_HUB).extreme(50)
        depth = "" if site.water_depth is None else number_text(site.water_depth)
        rows.append((name, depth, number_text(wind), number_text(Hs), number_text(Tp), site.description))
    return rows


def _suites():
    from fowt_env.training.evaluation.cases import read_suite, suite_names

    return [
        (name, str(len(suite.cases)), f"{len(suite.seeds)} x {suite.duration:g} s", suite.description)
        for name, suite in ((name, read_suite(name)) for name in suite_names())
    ]


def _cases():
    from fowt_env.training.evaluation.cases import described, read_suite, suite_names
    from fowt_env.training.evaluation.conditions import described_texts

    return [
        (case.name, name, *described_texts(described(case)), number_text(case.duration or suite.duration))
        for name, suite in ((name, read_suite(name)) for name in suite_names())
        for case in suite.cases
    ]


def _tasks():
    from fowt_env.envs.tasks import TASKS
    from fowt_env.training.evaluation.conditions import STILL

    rows = []
    for name, task in TASKS.items():
        winds = [wind for _, wind, _ in task.weathers]
        speeds = {f"{wind['speed'][0]:g} to {wind['speed'][1]:g} m/s" for wind in winds}
        kinds = dict.fromkeys(wind["kind"] for wind in winds)
        sea = STILL if all(sea is None for *_, sea in task.weathers) else "of the site, by the wind"
        rows.append((name, task.summary, ", ".join([*kinds, *speeds]), sea, f"{task.duration:g}"))
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
    return [(one.name, one.unit, channel_meaning(one.name) + scene) for one, scene in scenes.items()]


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

    exact = ("exact", "every reading is the exact value of the plant")
    return [exact, *((name, chain.description) for name, chain in built_in_chains().items())]


def _lidars():
    from fowt_env.descriptions.lidar import lidars

    exact = ("exact", "the exact wind, averaged over the rotor")
    return [exact, *((name, _one_line(lidar.source)) for name, lidar in lidars().items())]


KINDS = {
    "platforms": Kind(
        "--platform", "floating platforms with turbine, water depth, source",
        ("name", "hull", "turbine", "depth\nm", "source"), _platforms,
        "hull: wave loads by strips (Morison) or from panels (potential flow)."
        " Your own file: --platform mine.toml",
    ),
    "turbines": Kind(
        "--option turbine=", "turbines; every platform has one",
        ("name", "power\nkW", "rated\nwind m/s", "rated\nrpm", "source"), _turbines,
    ),
    "winds": Kind(
        "--wind", "kinds of wind and their syntax", ("kind", "--wind", "what it is"), _winds,
        "All kinds also as JSON, with further keys. Speeds in m/s at hub height.",
    ),
    "seas": Kind(
        "--sea", "sea states with Hs, Tp, source",
        ("name", "kind", "Hs or H\nm", "Tp or T\ns", "wind\nm/s", "source"), _seas, notes=5,
        remark="Also jonswap:HS:TP[:GAMMA], regular:H:T (m, s), JSON, or none. wind: associated wind speed.",
    ),
    "controllers": Kind(
        "--controller", "built-in control laws", ("name", "what it is", "also uses"), _controllers,
        "Also policy:NAME (fowt list agents), design:FILE (fowt design), dll:FILE.so\n"
        "(fowt connect check-dll) and module:Name (your own).\n"
        "All use generator speed, torque and blade pitch; motion: nacelle and platform. Full list: --json.",
        extra=("measurements and models",),
    ),
    "agents": Kind(
        "--controller", "trained agents shipped with the package",
        ("name", "how it acts", "what it sees", "training"), _agents,
        "Your own agent: policy:PATH/best.npz",
    ),
    "suites": Kind(
        "--suite", "sets of load cases with seeds and rules",
        ("name", "cases", "seeds", "what it is"), _suites, "Cases of a suite:  fowt list cases above_rated",
    ),
    "sites": Kind(
        "loads --site", "sites with the joint climate of wind and sea",
        ("name", "depth m", "50-year wind m/s", "Hs m", "Tp s", "what it is"), _sites,
        f"Winds of 10 min at {SITE_HUB:g} m. Your own site: the path of a .toml file or of a .csv table",
    ),
    "cases": Kind(
        "--cases", "load cases: wind, sea, duration", ("name", "suite", "wind", "sea", "s"), _cases
    ),
    "tasks": Kind(
        "make(ID, task=)", "tasks of the Gymnasium environments",
        ("name", "what is to be done", "wind", "sea", "s"), _tasks,
    ),
    "metrics": Kind(
        "results.csv", "metrics by which runs are judged", ("name", "unit", "meaning", "better"), _metrics,
        'A column is NAME_[UNIT]: "RotSpeed_std_[rpm]".',
    ),
    "channels": Kind(
        "--initial", "outputs of a run, with OpenFAST names", ("name", "unit", "meaning"), _channels,
        'A column is NAME_[UNIT]: "RotSpeed_[rpm]". FAIRTEN2, ...: further mooring lines.',
    ),
    "options": Kind(
        "--option", "parts of the model, as in build_scene",
        ("option", "what it is", "values, default first"), _options,
        "None: set by the fidelity, platform or turbine. Values other than texts are JSON: null.",
    ),
    "faults": Kind(
        "--fault", "faults during a run", ("kind", "--fault", "what happens"), _faults,
        'As JSON: {"kind": "pitch_offset", "time": 100, "offset": 2}',
    ),
    "sensors": Kind(
        "--sensors", "sensors between plant and controller", ("name", "what it is"), _sensors
    ),
    "lidars": Kind("--preview", "lidars for wind preview", ("name", "what it is, and its source"), _lidars),
}  # fmt: skip


@command()
def list_command(
    kind: Annotated[str | None, Argument(help=f"Kind: {', '.join(KINDS)}; or all.")] = None,
    part: Annotated[str | None, Argument(help="Show only rows that contain this text.")] = None,
    as_json: Annotated[bool, Option("--json", help="Print JSON.")] = False,
):
    """List the names that the other commands accept.

    Examples:
    fowt list  # kinds of names, their number and where they are used
    fowt list seas  # sea states with Hs, Tp and source
    fowt list cases above_rated  # wind, sea and duration of the cases of a suite
    fowt list channels tower  # rows that contain "tower"
    fowt list metrics --json  # as JSON, for a program
    """
    if kind is not None and kind != "all" and kind not in KINDS:
        raise unknown("kind of name", kind, ("all", *KINDS))
    if kind is None:
        headings = ("kind", "names", "used in", "what")
        rows = [(name, str(len(each.rows())), each.option, each.use) for name, each in KINDS.items()]
        if as_json:
            out.print_json(json.dumps(_as_mappings(headings, rows)))
            return
        print_table(headings, rows, left=(0, 2, 3), prose=(3,))
        out.print("\nfowt list KIND  shows one kind,  fowt list KIND TEXT  its rows that contain TEXT")
        return
    pattern = (part or "").lower()
    tables = {
        name: [row for row in KINDS[name].rows() if any(pattern in cell.lower() for cell in row)]
        for name in (KINDS if kind == "all" else [kind])
    }
    if part is not None and not any(tables.values()):
        raise InputError(f"no {kind} with {part!r}: fowt list {kind} shows all")
    if as_json:
        mappings = {
            name: _as_mappings((*KINDS[name].headings, *KINDS[name].extra), rows)
            for name, rows in tables.items()
        }
        out.print_json(json.dumps(mappings if kind == "all" else mappings[kind]))
        return
    for number, (name, rows) in enumerate(item for item in tables.items() if item[1]):
        if number:
            out.print()
        _print_kind(name, KINDS[name], rows)


def _as_mappings(headings, rows):
    """Return [{heading: text}] of rows of texts."""
    keys = [" ".join(heading.split()) for heading in headings]
    return [dict(zip(keys, row, strict=True)) for row in rows]


def _print_kind(name, kind, rows):
    """Print rows of a Kind: numbers aligned right, texts with spaces wrapped as prose."""
    columns = [[row[i] for row in rows] for i in range(len(kind.headings))]
    numbered = {}
    if kind.notes is not None:
        numbered = {text: str(number) for number, text in enumerate(dict.fromkeys(columns[kind.notes]), 1)}
        columns[kind.notes] = [numbered[text] for text in columns[kind.notes]]
    texts = [
        i for i, column in enumerate(columns) if any(cell and parse_number(cell) is None for cell in column)
    ]
    prose = [i for i in texts if any(" " in cell for cell in columns[i])]
    title = f"{name}: {kind.use} ({kind.option})"
    print_table(kind.headings, zip(*columns, strict=True), title, left=texts, prose=prose)
    if numbered:
        out.print()
        notes = [(number, text) for text, number in numbered.items()]
        print_table((kind.headings[kind.notes], ""), notes, left=(1,), prose=(1,))
    if kind.remark:
        out.print(Text(kind.remark, style="dim"), soft_wrap=False)
