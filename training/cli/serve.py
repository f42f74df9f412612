"""Implements fowt connect serve: the plant in real time for a controller outside."""

import json
from math import inf
from typing import Annotated

from typer import Option

from fowt_env.descriptions.checks import parse_number
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import SERIES_SUFFIXES
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.arguments import parse_fault, parse_names, parse_pairs, parse_protection
from fowt_env.training.cli.console import command, connect, note, output, wrote
from fowt_env.training.cli.simulate import FAULT, INITIAL, PROTECTION, REPEATED, save_run, scene_of
from fowt_env.training.cli.tables import print_table

LEAST_PATIENCE = 1.0  # s of silence after which another client may connect
WARM_PERIODS = 3  # before the clock starts, so that all kernels are loaded


@command(connect)
def serve(
    platform: shared.PlatformOption = "oc3_hywind",
    wind: shared.WindOption = "18",
    sea: shared.SeaOption = "none",
    duration: Annotated[float, Option(help="Length of the run, s.")] = 600.0,
    control_dt: Annotated[float, Option(help="Control period, s.")] = 0.01,
    dt: Annotated[float | None, Option(help="Physics time step, s; default: at most the period.")] = None,
    factor: Annotated[
        str, Option(help="Simulated over wall-clock time; inf: as fast as the client answers.")
    ] = "1",
    protocol: Annotated[str, Option(help="tcp or udp.")] = "tcp",
    listen: Annotated[
        str, Option(metavar="HOST:PORT", help="Address to listen at; others than loopback must be named.")
    ] = "127.0.0.1:5500",
    channels: Annotated[
        str | None, Option(help="Channels to send, e.g. GenSpeed,PtfmPitch; default: all.")
    ] = None,
    deadline: Annotated[float, Option(help="Time for an answer, as a fraction of the period.")] = 0.5,
    timeout: Annotated[float, Option(help="Time for an answer at factor inf, s.")] = 5.0,
    hold: Annotated[int, Option(help="Periods without a command before --then.")] = 10,
    then: Annotated[
        str, Option(help="After them: hold, stop (normal), feather (emergency) or end.")
    ] = "hold",
    seed: Annotated[int, Option(help="Seed of wind and waves.")] = 0,
    fidelity: shared.FidelityOption = "standard",
    start: Annotated[str, Option(help="trim (steady state at the mean wind) or zero.")] = "trim",
    initial: Annotated[REPEATED, Option(metavar="CHANNEL=VALUE", help=INITIAL)] = None,
    fault: Annotated[REPEATED, Option(metavar="KIND:TIME or JSON", help=FAULT)] = None,
    protection: Annotated[str, Option(help=PROTECTION)] = "none",
    option: shared.OptionOption = None,
    out_path: Annotated[str | None, Option("--out", help="Time series: .csv, .parquet or .outb.")] = None,
    report: Annotated[str | None, Option(help="Deadline statistics as JSON.")] = None,
):
    """Run the plant in real time for a controller outside.

    A client connects, receives the channels of each control period and answers with generator torque and
    blade pitch. Records, clients in Python and C, timing: docs, Hardware in the loop.

    Examples:
    fowt connect serve --wind ntm:18:B --duration 600 --control-dt 0.01  # 100 Hz on 127.0.0.1:5500
    fowt connect serve --protocol udp --listen 192.168.1.10:5500 --hold 5 --then feather  # a PLC
    fowt connect serve --factor inf --control-dt 0.1 --out run.outb  # as fast as the client answers
    """
    from fowt_env.realtime.server import Server, Timing, check_timing, open_link
    from fowt_env.run.stepped import SteppedRun

    output(out_path, endings=SERIES_SUFFIXES)
    host, port = parse_address(listen)
    number = parse_number(factor)
    pace = inf if factor.strip().lower() == "inf" else factor if number is None else number
    timing = check_timing(Timing(pace, deadline, timeout, hold, then))
    scene = scene_of(platform, wind, sea, duration, seed, fidelity, option)
    settings = {
        "dt": dt,
        "initial": {"start": start} | parse_pairs(initial, "initial"),
        "protection": parse_protection(protection),
        "faults": [parse_fault(text) for text in fault or ()],
    }
    patience = max(
        LEAST_PATIENCE, hold * control_dt / timing.factor, timeout if timing.factor == inf else 0.0
    )
    run = SteppedRun(scene, duration, control_dt, **settings)
    warm_up(SteppedRun(scene, min(WARM_PERIODS * control_dt, duration), control_dt, **settings))
    link = open_link(protocol, host, port, patience)
    server, reason = None, "interrupted"
    try:
        server = Server(run, link, timing, tuple(parse_names(channels) or ()))
        host, port = link.address
        note(f"listening on {protocol}://{host}:{port}; ends after {run.periods} periods or with Ctrl-C")
        reason = server.serve()
    except SimulationStopped as error:
        reason = str(error)
        raise
    finally:
        link.close()
        if server is not None:
            frame = run.frame()
            _print_statistics(server.statistics(), reason)
            save_run(frame, out_path)
            if report is not None:
                with replacing(report) as temporary:
                    temporary.write_text(
                        json.dumps({"reason": reason, **server.statistics()}, indent=1), encoding="utf-8"
                    )
                wrote(report)


def parse_address(text):
    """Return (host, port) of HOST:PORT; an IPv6 host may be in brackets. Raises: InputError."""
    host, sign, port = text.rpartition(":")
    if not sign or not host or not port.isdigit() or int(port) > 65535:
        raise InputError(
            f"listen = {text!r}: must be HOST:PORT with a port from 0 to 65535 (0: any free one)"
        )
    return host.strip("[]"), int(port)


def warm_up(run):
    """Load every kernel of a run, by its first periods."""
    while not run.has_ended:
        run.channels()
        run.advance(run.command)


def _print_statistics(statistics, reason):
    """Print counts and times of a served run."""
    counts = [
        (name.replace("_", " "), value) for name, value in statistics.items() if type(value) is not dict
    ]
    print_table(("count", "value"), counts, f"ended: {reason}")
    times = {name: value for name, value in statistics.items() if type(value) is dict and value}
    if times:
        heads = list(next(iter(times.values())))
        rows = [(name.replace("_", " "), *(row[key] for key in heads)) for name, row in times.items()]
        print_table(("time", *heads), rows)
