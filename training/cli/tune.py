"""Implements fowt tune: a live page on which settings of a controller are moved."""

from typing import Annotated

from typer import Option

from fowt_env.analysis.threads import one_thread
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.console import command, note, out

LAW = "Controller: a name, also with settings of its sliders, as in pi[KP=1.5]."
WEATHER = f"{shared.AS_SIMULATE} With a mean wind speed."


@command()
@one_thread
def tune_command(
    controller: Annotated[str, Option(help=LAW)] = "pi",
    against: Annotated[str, Option(help="Controller beside it, in the same form.")] = "pi",
    platform: shared.PlatformOption = "oc3_hywind",
    wind: Annotated[str, Option(help=WEATHER)] = "ntm:14:B",
    sea: shared.SeaOption = "jonswap:3.6:9.4",
    seed: Annotated[int, Option(help="Seed of wind and waves.")] = 1001,
    duration: Annotated[float, Option(help="Length of a run, s; the first 60 s are not scored.")] = 660.0,
    further: Annotated[str, Option(help="Further controllers for the menus, comma-separated.")] = "",
    port: Annotated[int, Option(help="Port on this machine; 0: a free one.", min=0, max=65535)] = 0,
    browser: Annotated[bool, Option("--browser/--no-browser", help="Open the page.")] = True,
):
    """Tune a controller by hand on a live page.

    Moves of a slider redraw time series, spectra, fatigue loads, margins, poles, responses and the moving
    turbine, of two settings side by side in the same wind and waves. The page is served on this machine
    alone.

    Examples:
    fowt tune  # the published PI law at 14 m/s, beside itself
    fowt tune --controller floating_feedback --against pi --wind ntm:18:B
    fowt tune --controller 'pi[KP=1.5]' --platform nrel5mw_oc4_semi
    fowt tune --controller mymodule:Mine --against mpc  # your own law, without sliders

    In a notebook: fowt_env.training.live.server.tune(). A search by computer: fowt design search.
    """
    import webbrowser

    from fowt_env.control.making import make
    from fowt_env.controllers import controller_names
    from fowt_env.descriptions.platform import turbine_of
    from fowt_env.training.live.server import tune

    turbine, others = turbine_of(platform, None), controller_names(further) if further else ()
    for name in (controller, against, *others):  # before a page is served that could only show the error
        make(name.partition("[")[0], turbine, 0.1)
    weather = {"platform": platform, "wind": wind, "sea": sea, "seed": seed, "duration": duration}
    server = tune(controller, against, others, port, **weather)
    out.print(server.url)
    note("press Ctrl+C to end")
    if browser:
        webbrowser.open(server.url)
    server.wait()
