"""Implements fowt study: a deck or platform and a controller in, one page with a verdict out."""

import filecmp
import html
import json
import re
import shutil
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.markup import escape
from typer import Argument, Option

from fowt_env.analysis.threads import one_thread
from fowt_env.display import number_text
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.console import command, note, output, progress_bar
from fowt_env.training.cli.tables import out

PLATFORM = "Deck of OpenFAST (.fst), platform file (.toml) or the name of a platform."
THEIRS = "Run of OpenFAST (.outb, .out) of the first controller, to compare with; needs --controller."
SHEAR = "Shear exponent of the wind of --compare, which its file does not tell; default: the site's."
MINE = "Controllers to study: names, policy:NAME, design:FILE, dll:FILE.so, module:Name, comma-separated."
SHOWN_WIND = 14.0  # m/s, nearest case of the suite for margins and the animation
START = 200.0  # s of a run that are not compared, as in suites: surge settles slowly
LEAST_COMPARED = 120.0  # s, some periods of platform pitch; less is said to be too little
ROUNDING = 1e-9  # of the mean: a smaller deviation is none
RUNS = "runs/*/*.parquet"  # finished runs in the folder of a study
FILM = 48.0  # s of the animation, where the motions of the platforms differ most
COMPARED = ("RotSpeed", "BldPitch1", "GenTq", "GenPwr", "PtfmPitch", "PtfmSurge", "TwrBsMyt")


@command()
@one_thread
def study(
    platform: Annotated[str, Argument(help=PLATFORM)] = "oc3_hywind",
    controller: Annotated[str, Option(help=MINE)] = "mpc",
    against: Annotated[
        str, Option(help="Controllers to compare with; the first is the baseline.")
    ] = "gspi_oc3",
    compare: Annotated[str | None, Option(help=THEIRS)] = None,
    shear: Annotated[float | None, Option(help=SHEAR)] = None,
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

    [bold]Files written[/bold]: the imported deck, those of fowt evaluate, animation.gif, report.html.
    """
    from fowt_env.controllers import controller_names, make
    from fowt_env.controllers.bladed.check import start_once
    from fowt_env.controllers.bladed.controller import DLL_PREFIX, named_library
    from fowt_env.descriptions.checks import parse_whole_numbers
    from fowt_env.descriptions.platform import turbine_of
    from fowt_env.training.evaluation.cases import chosen_cases, mean_speed
    from fowt_env.training.evaluation.evaluate import evaluate
    from fowt_env.training.evaluation.leaderboard_file import write_leaderboard
    from fowt_env.training.evaluation.run_case import CONTROL_DT
    from fowt_env.training.reports.html_page import write_report
    from fowt_env.visual.style import short_names

    mine, others = controller_names(controller), controller_names(against)
    if not mine or not others:
        raise InputError("--controller and --against: must each name a controller")
    if both := [name for name in mine if name in others]:
        raise InputError(f"--against {both[0]}: is also a --controller: a study compares different ones")
    if shear is not None and compare is None:
        raise InputError("--shear: is used with --compare alone")
    labels, folder = short_names([*others, *mine]), Path(output(out_folder, folder=True))
    named = {label: name for name, label in labels.items()}
    first, second = labels[others[0]], labels[mine[0]]
    numbers = parse_whole_numbers(seeds, "seeds")

    def cases_on(platform):
        """Return the suite on a platform, and its cases with a mean wind."""
        suite_on = chosen_cases(suite, None, None if platform == "oc3_hywind" else platform)
        windy = [each for each in getattr(suite_on, "cases", suite_on) if mean_speed(each) is not None]
        if not windy:
            raise InputError(f"--suite {suite}: has no case with a mean wind speed")
        return suite_on, windy

    with _imported(platform, folder) as (platform, sections, keep):
        turbine = turbine_of(platform)
        for name in labels:  # what cannot run is refused before the first kernel is compiled
            make(name, turbine, CONTROL_DT)
            if name.startswith(DLL_PREFIX):
                start_once(named_library(name), turbine, CONTROL_DT)
        sections += _checked(platform)
        cases_on(platform)
        if compare is not None:
            sections.append(_compared(platform, mine[0], second, compare, shear))
        platform = keep()
        chosen, windy = cases_on(platform)
        with progress_bar("evaluating") as update:
            table = evaluate(
                named, chosen, seeds=numbers, jobs=jobs, folder=folder,
                progress=lambda done, total, _: update(
                    done, total, f"evaluating, {done} of {total} runs done"
                ),
            )  # fmt: skip
    write_leaderboard(table, folder, first)
    case = min(windy, key=lambda each: abs(mean_speed(each) - SHOWN_WIND))
    with progress_bar("margins and animation"):
        sections.append(_margins(platform, case, named))
        if animation and (film := _film(case, (first, second), numbers[0], folder)):
            sections.insert(0, film)
    with progress_bar("report") as update:
        page = write_report(folder, schedule=False, progress=update, sections=sections)
    for line in _verdict(folder / "leaderboard.json", len(numbers)):
        out.print(escape(line), soft_wrap=True)
    out.print(f"open {escape(str(page))}", soft_wrap=True)


@contextmanager
def _imported(platform, folder):
    """Yield (name or path of the platform, sections of the report on what differs from a deck, keep).

    A deck is imported into a temporary folder; keep() copies the platform into the folder of the study and
    returns its path there. If the block raises before a run is finished, folders that are new are removed.
    Raises: InputError for files there that differ, which somebody may have edited.
    """
    from fowt_env.files.openfast_deck.importer import import_deck

    if not platform.lower().endswith(".fst"):
        yield platform, [], lambda: platform
        return
    made = folder / Path(platform).stem
    with tempfile.TemporaryDirectory(prefix="fowt-study-") as temporary:
        trial = Path(temporary, made.name)
        report = import_deck(platform, trial)
        if made.exists() and not made.is_dir():
            raise InputError(f"folder {str(made)!r} is a file; must be a folder, or not exist")
        for file in (path for path in trial.rglob("*") if path.is_file()):
            there = made / file.relative_to(trial)
            if there.exists() and not filecmp.cmp(file, there, shallow=False):
                raise InputError(
                    f"{there}: differs from what {platform} gives now; if it was edited, study"
                    f" {made / 'platform.toml'} itself, or name another --out"
                )
        rows = [*report.differences, *report.contradictions]
        table = _html_table(("in the deck", "here"), rows, texts=2)
        differing = f"<details><summary>{len(rows)} differences</summary>{table}</details>"
        new = [path for path in (made, folder, *folder.parents) if not path.exists()]
        runs = set(folder.glob(RUNS))

        def keep():
            shutil.copytree(trial, made, dirs_exist_ok=True)
            where = f"{len(report.differences)} differences, listed in {made / 'report.md'}"
            out.print(escape(f"imported {platform}: {where}"), soft_wrap=True)
            return str(made / "platform.toml")

        try:
            yield str(trial / "platform.toml"), [("The deck", differing if rows else "nothing differs")], keep
        except Exception:
            if made in new and set(folder.glob(RUNS)) == runs:
                shutil.rmtree(made, ignore_errors=True)
                with suppress(OSError):  # a folder that is not empty, and its parents
                    for path in new[1:]:
                        path.rmdir()
            raise


def _checked(platform):
    """Return the sections of the report on the check of a platform at rest."""
    from fowt_env.analysis.check import check_platform
    from fowt_env.descriptions.platform import platform_names

    if platform in platform_names():  # checked by the tests of the package
        return []
    faults = check_platform(platform).faults
    text = (
        "<br>".join(map(html.escape, faults))
        or "no contradictions found: weight, buoyancy, stability, periods"
    )
    for fault in faults:
        out.print(f"[yellow]{escape(fault)}[/yellow]")
    return [("Check of the platform at rest", text)]


def _compared(platform, name, label, path, shear):
    """Return the section that compares a run of OpenFAST with one in its recorded wind and waves."""
    import fowt_env
    from fowt_env.descriptions.platform import read_platform
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
    shear = read_platform(platform).environment.shear_exponent if shear is None else shear
    scene = fowt_env.build_scene(platform, wind=series, sea=sea, shear_exponent=shear)
    begun = {
        column: float(value) for column, value in theirs.iloc[0].items() if column.split("_[")[0] in INITIAL
    }
    run = fowt_env.simulate(scene, name, duration=float(np.floor(time[-1])), output_dt=0.1, initial=begun)
    theirs = theirs.assign(**{TIME: time})
    known = [one for one in COMPARED if any(column.startswith(f"{one}_[") for column in theirs.columns)]
    start = min(START, 0.3 * time[-1])
    result = compare(run, theirs, start, None, tuple(known))
    rows = []
    for row in result.rows:
        least = ROUNDING * max(abs(row.mean), abs(row.mean_other))
        stds = (0.0 if std < least else std for std in (row.std, row.std_other))
        values = map(number_text, (row.mean, row.mean_other, *stds))
        alike = f"{row.correlation:.3f}" if np.isfinite(row.correlation) else "–"
        rows.append((f"{row.channel} ({row.unit})", *values, alike))
    heads = ("channel", "mean here", "mean there", "std here", "std there", "correlation")
    texts = (f"{which}: {text.removesuffix(' (--from)')}" for which, text in result.notes)
    notes = "".join(f"<li>{html.escape(text)}</li>" for text in texts)
    water = "with its waves, towards +x" if sea else f"no waves: the file has no {waves}"
    where = (
        f"{html.escape(label)} in the wind of {html.escape(Path(path).name)}, {water}, from {start:.0f} s on"
    )
    remark = (
        f"{where}; shear exponent {shear:g} (--shear), which moves the mean platform pitch. The recorded wind"
        " is that of one point and acts on the whole rotor here: of a full-field wind, this one varies more."
    )
    if time[-1] - start < LEAST_COMPARED:
        remark += f" Only {time[-1] - start:.0f} s are compared: too few for means and deviations."
    return "Beside your own run", f"<p>{remark}</p>{_html_table(heads, rows)}<ul>{notes}</ul>"


def _margins(platform, case, named):
    """Return the section of the linear margins at the mean wind of a case."""
    from fowt_env.training.evaluation.cases import mean_speed
    from fowt_env.training.live.tuning import Law, Weather, linear, loop_words

    speed, rows = mean_speed(case), []
    # linear models leave the sea of this weather out; without one, kernels of still water would be compiled
    weather = Weather(platform, f"{speed:g}")
    for label, name in named.items():
        try:
            words = loop_words(linear(weather, Law(name)))
        except (InputError, SimulationStopped) as error:
            words = [("stable", str(error))]
        rows.append((label, *(text for _, text in words)))
    heads = ("controller", *(key for key, _ in words))
    water = (
        "<p>In still water, where quadratic drag damps no small motion: surge, sway and heave of a hull"
        " without other damping are better damped in the runs.</p>"
    )
    return f"Linear margins at {speed:g} m/s", water + _html_table(heads, rows, texts=len(heads))


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
        f'<p>{words}</p><img alt="{words}" style="width:100%" src="data:image/gif;base64,{picture}">',
    )


def most_different(first, second, step=0.1):
    """Return the start (s) of the FILM seconds in which the first signal swings most beyond the second."""
    size, least = min(len(first), len(second)), round(FILM / step)
    starts = range(round(60.0 / step), max(size - least, round(60.0 / step) + 1), round(2.0 / step))
    return step * max(starts, key=lambda i: first[i : i + least].std() - second[i : i + least].std())


def _html_table(heads, rows, texts=1):
    """Return the HTML of a table of texts, the first columns, and numbers."""
    from fowt_env.training.reports.page_words import table_rows

    cells = [[html.escape(str(cell)) for cell in row] for row in rows]
    body = table_rows(map(html.escape, heads), cells, texts=range(texts))
    kind = "figures texts" if texts > 1 else "figures"
    return f'<div class="scroll"><div tabindex="0"><table class="{kind}">{body}</table></div></div>'


def _verdict(path, seeds):
    """Return the lines of the verdict of the page, from the file of a leaderboard."""
    from fowt_env.training.evaluation.leaderboard_file import check_leaderboard
    from fowt_env.training.reports.verdict import verdict

    board = check_leaderboard(json.loads(path.read_text(encoding="utf-8")), path)
    text = verdict(board, seeds, board.interval.least_seeds)
    return [html.unescape(re.sub("<[^>]+>", "", line)) for line in text.replace("<li>", "\n  ").splitlines()]
