"""The commands of linear design: fowt linearize and fowt design."""

import json
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from fowt_env.cli_arguments import parse_numbers, parse_pairs

LINEARIZE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt linearize --winds 18[/cyan]  modes with periods and damping at one wind

[cyan]fowt linearize --winds 4:25:1 --out modes.csv[/cyan]  the sweep, cut-in to cut-out

Modes are those of the plant with torque and blade pitch held. A right-half-plane zero from blade pitch to
rotor speed bounds how fast any pitch controller on speed alone may be."""
LQR_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt design lqr[/cyan]  the shipped weights against gspi_oc3 on training seeds

[cyan]fowt design lqr --vary pitch_rate=3,6,12 --out sweep.csv[/cyan]  a front: less travel, more speed error

Raising pitch_rate saves travel, platform_pitch calms the platform, power holds the power and spends speed."""


def register(app, reported, progress_bar, out, note):
    """Add the design commands to the fowt app."""
    design = typer.Typer(no_args_is_help=True, rich_markup_mode="rich", help="Tune controllers.")
    app.add_typer(design, name="design")

    def show(frame, title):
        table = Table(title=escape(title), title_justify="left")
        for name in frame.columns:
            table.add_column(escape(name.replace("_[", "\n[")), justify="right")
        for row in frame.itertuples(index=False):
            table.add_row(*(escape(v) if isinstance(v, str) else f"{v:.4g}" for v in row))
        out.print(table)

    @app.command(epilog=LINEARIZE_EXAMPLES)
    @reported
    def linearize(
        platform: Annotated[str, typer.Option(help="Platform: a name or a path.")] = "oc3_hywind",
        winds: Annotated[str, typer.Option(help="Winds, m/s: 12,18 or START:STOP:STEP.")] = "4:25:1",
        out_path: Annotated[str | None, typer.Option("--out", help="Modes: .csv or .parquet.")] = None,
    ):
        """Print modes and right-half-plane zeros of the floating turbine over the wind."""
        import fowt_env
        from fowt_env.outputs import write_table
        from training.linear_design import mode_table, models_over, zero_table

        speeds = parse_numbers(winds, "winds")
        scene = fowt_env.build_scene(platform, wind=speeds[0])
        with progress_bar("linearising", len(speeds)) as update:
            models = models_over(scene, speeds, lambda done, total: update(done, total=total))
        modes, zeros = mode_table(models), zero_table(models)
        show(modes, f"{platform}: modes, torque and blade pitch held")
        if len(zeros):
            show(zeros, "right-half-plane zeros, blade pitch to rotor speed")
        else:
            out.print("no right-half-plane zeros from blade pitch to rotor speed")
        if out_path is not None:
            note(f"wrote {write_table(modes, out_path)}")

    @design.command(epilog=LQR_EXAMPLES)
    @reported
    def lqr(
        vary: Annotated[
            list[str] | None, typer.Option(metavar="WEIGHT=A,B,C", help="Weight and its values; repeats.")
        ] = None,
        weight: Annotated[
            list[str] | None, typer.Option(metavar="WEIGHT=VALUE", help="A weight for all variants; repeats.")
        ] = None,
        cases: Annotated[str, typer.Option(help="Cases or suites.")] = "ntm_14,ntm_18,ntm_22",
        seeds: Annotated[str, typer.Option(help="Training seeds, 1000 and above.")] = "1001,1002",
        out_path: Annotated[str | None, typer.Option("--out", help="All runs: .csv.")] = None,
    ):
        """Sweep the weights of lqr on training seeds, beside gspi_oc3."""
        from training.linear_design import SHOWN, sweep

        fixed = parse_pairs(weight, "weight")
        variants = [fixed]
        for pair in vary or ():
            name, _, values = pair.partition("=")
            numbers = parse_numbers(values, f"weight {name}")
            variants = [variant | {name: number} for variant in variants for number in numbers]
        numbers = [int(number) for number in parse_numbers(seeds, "seeds")]
        with progress_bar("simulating", None) as update:
            table = sweep(variants, cases, numbers, out_path, lambda done, total: update(done, total=total))
        means = table.groupby(["case", "variant"], sort=False)[list(SHOWN)].mean().reset_index()
        show(means, f"means over seeds {json.dumps(numbers)}")
        if out_path is not None:
            note(f"wrote {out_path}")
