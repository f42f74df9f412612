"""Defines the options shared by several commands, with their help texts."""

from typing import Annotated

from typer import Option

RANGE = "a list (8,12,18) or START:STOP[:STEP], STOP included"
AS_SIMULATE = "As in fowt simulate --help."
WHOLE = "1,2,3 or 1:6:1 (6 included)"

PlatformOption = Annotated[
    str, Option(help="Platform: a name from fowt list platforms or the path of a TOML file.")
]
OptionOption = Annotated[
    list[str] | None,
    Option("--option", metavar="KEY=VALUE", help="Scene option, see fowt list options; repeatable."),
]
RotorOption = Annotated[
    str | None, Option(help="Rotor model: bem, lookup or table; default: set by the fidelity.")
]
WindOption = Annotated[str, Option(help=AS_SIMULATE)]
SeaOption = Annotated[str, Option(help=AS_SIMULATE)]
FidelityOption = Annotated[str, Option(help="Fidelity: reference, standard, elastic or fast.")]
JobsOption = Annotated[int, Option(help="Number of worker processes.")]
EngineOption = Annotated[str, Option(help="Engine that distributes the runs: processes or ray.")]
AddressOption = Annotated[str | None, Option(help="Address of a running Ray cluster.")]
SuiteOption = Annotated[str, Option(help="Suite of load cases.")]
ValidationSeeds = Annotated[
    str, Option(help="Validation seeds, 1000 and above: 1001,1002 or 1001:1006:1 (6 included).")
]
FolderOption = Annotated[str, Option("--out", help="Output folder.")]
CsvOption = Annotated[str, Option("--out", help="Output CSV file.")]
TableOption = Annotated[str | None, Option("--out", help="Output table: .csv or .parquet.")]
DesignOption = Annotated[str | None, Option("--out", help="Output design file: .json.")]
PlotsOption = Annotated[bool, Option("--plot/--no-plot", help="Write the plots.")]
PlotOption = Annotated[str | None, Option(help="Output plot, e.g. plot.png.")]
