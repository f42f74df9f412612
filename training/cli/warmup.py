"""Implements fowt warmup: compiles the usual kinds of scene in advance."""

from typing import Annotated

from typer import Option

from fowt_env.training.cli.arguments import parse_names
from fowt_env.training.cli.console import command, err, note, progress_bar
from fowt_env.training.cli.options import PlatformOption
from fowt_env.training.cli.tables import print_table


@command()
def warmup(
    platform: PlatformOption = "oc3_hywind",
    kinds: Annotated[str, Option(help="Kinds of scene, comma-separated, or all.")] = "standard,environment",
    jobs: Annotated[int, Option(help="Number of processes; each needs about 1 GB.")] = 1,
):
    """Compile kernels of the usual scenes in advance.

    Examples:
    fowt warmup  # one to three minutes: simulate and the environment, OC3-Hywind; later runs start at once
    fowt warmup --kinds standard,vector,linear --jobs 2  # other kinds, after the first in parallel
    fowt warmup --kinds all  # standard, environment, easy, vector, steady, linear, fast and reference
    """
    from fowt_env.warmup import KINDS
    from fowt_env.warmup import warmup as compile_kinds

    named = [kind for name in parse_names(kinds) for kind in (KINDS if name == "all" else (name,))]
    names, said = list(dict.fromkeys(named)), -1  # said: kinds done in the last line; -1: no line yet
    with progress_bar("compiling", len(names)) as update:

        def show(kind, done, kernels):  # not called for arguments that are refused
            nonlocal said
            update(done, text=f"{kind}: {kernels} kernels" if kernels else kind)
            if not err.is_terminal and said < 0:
                note(f"compiling {len(names)} kinds of scene: {', '.join(names)}")
            if not err.is_terminal and done > max(said, 0):
                note(f"{done} of {len(names)}: {kind}")
            said = done

        table = compile_kinds(platform, names, jobs, show)
    rows = [(row.kind, KINDS[row.kind][0], row.kernels, f"{row.seconds:.1f}") for row in table.itertuples()]
    print_table(("kind", "used for", "compiled", "s"), rows, platform, left=(0, 1))
