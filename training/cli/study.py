"""Implements fowt study: a deck or platform and a controller in, one page with a verdict out."""

import html
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.markup import escape
from typer import Argument, Option

from fowt_env.display import number_text
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.console import command, note, output, progress_bar
from fowt_env.training.cli.tables import out

PLATFORM = "Deck of OpenFAST (.fst), platform file (.toml) or the name of a platform."
THEIRS = "Run of OpenFAST (.outb, .out) of the first controller, to compare with; needs --controller."
MINE = "Controllers to study: names, policy:NAME, design:FILE, dll:FILE.so, module:Name, comma-separated."
SHOWN_WIND = 14.0  # m/s, nearest case of the suite for margins and the animation
FILM = 48.0  # s of the animation, where the motions of the platforms differ most
COMPARED = ("RotSpeed", "BldPitch1", "GenTq", "GenPwr", "PtfmPitch", "PtfmSurge", "TwrBsMyt")


@command()
def study(
    platform: Annotated[str, Argument(help=PLATFORM)] = "oc3_hywind",
    controller: Annotated[str, Option(help=MINE)] = "mpc",
    against: Annotated[
        str, Option(help="Controllers to compare with; the first is the baseline.")
    ] = "gspi_oc3",
    compare: Annotated[str | None, Option(help=THEIRS)] = None,
    suite: shared.SuiteOption = "above_rated",
    seeds: Annotated[str, Option(help=f"Seeds: {shared.WHOLE}.")] = "1:4:1",
    jobs: shared.JobsOption = 1,
    animation: Annotated[bool, Option(help="Animate the first controller beside the baseline.")] = True,
    out_folder: shared.FolderOption = "results/study",
):
    """Study a controller on your deck, with a verdict.

    Check, linear margins, evaluation and one page in HTML. A deck is imported first (fowt import). With
    --compare, the first controller also runs in the wind and waves of the user's file, from its first state.

    Examples:
    fowt study deck/5MW_OC4Semi.fst --controller dll:my.so,mine:Law --against gspi_oc3,mpc
    fowt study deck/5MW_OC4Semi.fst --controller dll:my.so --compare deck/run.outb --seeds 1
    fowt study --controller mymodule:Mine  # OC3-Hywind, against its published PI law, four seeds

    [bold]Files written[/bold]: platform/ (of a deck), those of fowt evaluate, animation.gif, report.html.
    """
    from fowt_env.controllers import controller_names
    from fowt_env.descriptions.checks import parse_whole_numbers
    from fowt_env.training.evaluation.cases import chosen_cases, mean_speed
    from fowt_env.training.evaluation.evaluate import evaluate
    from fowt_env.training.evaluation.leaderboard_file import write_leaderboard
    from fowt_env.training.reports.html_page import write_report

    mine, others = controller_names(controller), controller_names(against)
    if not mine or not others:
        raise InputError("--controller and --against: must each name a controller")
    names, folder = list(dict.fromkeys([*others, *mine])), Path(output(out_folder, folder=True))
    numbers = parse_whole_numbers(seeds, "seeds")
    platform, sections = _checked(platform, folder)
    usual = platform == "oc3_hywind"
    chosen = chosen_cases(suite, None, None if usual else platform)
    if compare is not None:
        sections.append(_compared(platform, mine[0], compare))
    with progress_bar("evaluating") as update:
        table = evaluate(
            names, chosen, seeds=numbers, jobs=jobs, folder=folder,
            progress=lambda done, total, _: update(done, total, f"evaluating, {done} of {total} runs done"),
        )  # fmt: skip
    board = write_leaderboard(table, folder, others[0])
    windy = [each for each in getattr(chosen, "cases", chosen) if mean_speed(each) is not None]
    if not windy:
        raise InputError(f"--suite {suite}: has no case with a mean wind speed")
    case = min(windy, key=lambda each: abs(mean_speed(each) - SHOWN_WIND))
    with progress_bar("margins and animation"):
        sections.append(_margins(platform, case, names))
        if animation and (film := _film(case, (others[0], mine[0]), numbers[0], folder)):
            sections.insert(0, film)
    with progress_bar("report") as update:
        page = write_report(folder, schedule=False, progress=update, sections=sections)
    _say(board, table, others[0])
    out.print(f"open {escape(str(page))}", soft_wrap=True)


def _checked(platform, folder):
    """Return (name or path of the platform, sections of the report on import and check)."""
    from fowt_env.analysis.check import check_platform
    from fowt_env.descriptions.platform import platform_names
    from fowt_env.files.openfast_deck.importer import import_deck

    sections = []
    if platform.lower().endswith(".fst"):
        report = import_deck(platform, folder / "platform", replace_files=True)
        platform = str(folder / "platform" / "platform.toml")
        rows = [*report.differences, *report.contradictions]
        sections.append(
            ("The deck", _html_table(("in the deck", "here"), rows) if rows else "nothing differs")
        )
        out.print(f"imported {escape(report.title)}: {len(report.differences)} differences from the deck")
    elif platform in platform_names():  # checked by the tests of the package
        return platform, sections
    faults = check_platform(platform).faults
    text = (
        "<br>".join(map(html.escape, faults))
        or "no contradictions found: weight, buoyancy, stability, periods"
    )
    sections.append(("Check of the platform at rest", text))
    for fault in faults:
        out.print(f"[yellow]{escape(fault)}[/yellow]")
    return platform, sections


def _compared(platform, name, path):
    """Return the section that compares a run of OpenFAST with one in its recorded wind and waves."""
    import fowt_env
    from fowt_env.files.tables import read_series
    from fowt_env.run.initial_conditions import INITIAL
    from fowt_env.training.reports.compare import compare
    from fowt_env.visual.time_series import TIME
    from fowt_env.weather.waves import recorded_sea

    theirs, wind, waves = read_series(path), "Wind1VelX_[m/s]", "Wave1Elev_[m]"
    if wind not in theirs.columns:
        raise InputError(f"--compare {path}: needs the channel Wind1VelX, in whose wind the controller runs")
    time = theirs[TIME].to_numpy() - theirs[TIME].iloc[0]
    series = {"kind": "series", "time": time.tolist(), "speed": theirs[wind].tolist()}
    sea = recorded_sea(time, theirs[waves].to_numpy()) if waves in theirs.columns else None
    scene = fowt_env.build_scene(platform, wind=series, sea=sea)
    begun = {
        column: float(value) for column, value in theirs.iloc[0].items() if column.split("_[")[0] in INITIAL
    }
    run = fowt_env.simulate(scene, name, duration=float(np.floor(time[-1])), output_dt=0.1, initial=begun)
    theirs = theirs.assign(**{TIME: time})
    known = [one for one in COMPARED if any(column.startswith(f"{one}_[") for column in theirs.columns)]
    result = compare(run, theirs, min(60.0, 0.2 * time[-1]), None, tuple(known))
    rows = []
    for row in result.rows:
        values = map(number_text, (row.mean, row.mean_other, row.std, row.std_other))
        rows.append((f"{row.channel} {row.unit}", *values, f"{row.correlation:.3f}"))
    heads = ("channel", "mean here", "mean there", "std here", "std there", "correlation")
    notes = "".join(f"<li>{html.escape(f'{which}: {text}')}</li>" for which, text in result.notes)
    water = "with its waves, towards +x" if sea else f"no waves: the file has no {waves}"
    remark = f"{html.escape(name)} in the wind of {html.escape(Path(path).name)}, {water}."
    return "Beside your own run", f"<p>{remark}</p>{_html_table(heads, rows)}<ul>{notes}</ul>"


def _margins(platform, case, names):
    """Return the section of the linear margins at the mean wind of a case."""
    from fowt_env.training.evaluation.cases import mean_speed
    from fowt_env.training.live.tuning import Law, Weather, linear, loop_words

    speed, rows = mean_speed(case), []
    weather = Weather(platform, f"{speed:g}", "none")
    for name in names:
        try:
            words = loop_words(linear(weather, Law(name)))
        except (InputError, SimulationStopped) as error:
            words = [("stable", str(error))]
        rows.append((name, *(text for _, text in words)))
    heads = ("controller", *(key for key, _ in words))
    return f"Linear margins at {speed:g} m/s", _html_table(heads, rows)


def _film(case, pair, seed, folder):
    """Return the section with an animation of two saved runs, where their platform pitch differs most."""
    import base64

    from fowt_env.files.tables import read_table
    from fowt_env.scene.build import build_scene
    from fowt_env.training.evaluation.evaluate import run_file
    from fowt_env.visual.animation import animate

    paths = {name: run_file(folder / "runs", name, case.name, seed) for name in dict.fromkeys(pair)}
    runs = {name: read_table(path) for name, path in paths.items() if path.is_file()}
    if len(runs) < 2:
        return None
    start = most_different(*(run["PtfmPitch_[deg]"].to_numpy() for run in runs.values()))
    cut = {name: run[run["Time_[s]"] <= start + FILM] for name, run in runs.items()}
    scene = build_scene(case.platform, case.wind, case.sea, seed=seed, duration=700.0, **case.options)
    try:
        path = animate(scene, cut, folder / "animation.gif", speed=4.0, fps=12, start=start)
    except InputError as error:  # without pygame or pillow
        note(f"no animation: {error}")
        return None
    picture = base64.b64encode(path.read_bytes()).decode("ascii")
    words = f"{html.escape(' and '.join(runs))} in the same wind and waves, {case.name}, at 4 times real time"
    return (
        "Motion",
        f'<p>{words}</p><img alt="{words}" style="max-width:100%" src="data:image/gif;base64,{picture}">',
    )


def most_different(first, second, step=0.1):
    """Return the start (s) of the FILM seconds in which the first signal swings most beyond the second."""
    size, least = min(len(first), len(second)), round(FILM / step)
    starts = range(round(60.0 / step), max(size - least, round(60.0 / step) + 1), round(2.0 / step))
    return step * max(starts, key=lambda i: first[i : i + least].std() - second[i : i + least].std())


def _html_table(heads, rows):
    from fowt_env.training.reports.page_words import table_rows

    cells = [[html.escape(str(cell)) for cell in row] for row in rows]
    body = table_rows(map(html.escape, heads), cells, texts=range(len(heads)))
    return f'<div class="scroll"><div tabindex="0"><table class="figures texts">{body}</table></div></div>'


def _say(board, table, baseline):
    """Print what each controller does better and worse than the baseline, a line each."""
    from fowt_env.training.evaluation.failures import lost_text
    from fowt_env.training.live.tuning import paired, verdict

    good = table[table["status"] == "ok"]
    for entry in board["controllers"]:
        name = entry["controller"]
        if name == baseline:
            continue
        pair = [good[good["controller"] == each].set_index(["case", "seed"]) for each in (baseline, name)]
        common = pair[0].index.intersection(pair[1].index)
        figures = [part.loc[common].to_dict("records") for part in pair]
        words = verdict(paired(*figures), 1) if len(common) else "no run in common"
        lost = f", {lost_text(entry)} of {entry['runs']}" if entry["lost"] else ""
        heading = f"[bold]{escape(name)}[/bold] against {escape(baseline)}"
        out.print(f"{heading}, {len(common)} runs each{escape(lost)}")
        for line in words.split("; "):
            out.print(f"  {escape(line)}")
