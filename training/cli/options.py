"""Options that several commands share, each with its help text."""

from typing import Annotated

from typer import Option

RANGE = "a list (8,12,18) or START:STOP[:STEP], STOP included"
AS_SIMULATE = "As of fowt simulate --help."
WHOLE = "1,2,3 or 1:6:1 (6 included)"

PlatformOption = Annotated[
    str, Option(help="Platform: a name of fowt list platforms, or a path to a TOML file.")
]
OptionOption = Annotated[
    list[str] | None,
    Option("--option", metavar="KEY=VALUE", help="Option of the scene, of fowt list options; repeatable."),
]
RotorOption = Annotated[
    str | None, Option(help="Rotor model: bem, lookup or table; default: that of the fidelity.")
]
WindOption = Annotated[str, Option(help=AS_SIMULATE)]
SeaOption = Annotated[str, Option(help=AS_SIMULATE)]
FidelityOption = Annotated[str, Option(help="reference, standard or fast.")]
JobsOption = Annotated[int, Option(help="Worker processes.")]
EngineOption = Annotated[str, Option(help="Where the runs are done: processes or ray.")]
AddressOption = Annotated[str | None, Option(help="Address of a running Ray cluster.")]
SuiteOption = Annotated[str, Option(help="Suite whose cases are run.")]
ValidationSeeds = Annotated[
    str, Option(help="Validation seeds, 1000 and above: 1001,1002 or 1001:1006:1 (6 included).")
]
FolderOption = Annotated[str, Option("--out", help="Folder for the output.")]
CsvOption = Annotated[str, Option("--out", help="CSV to write.")]
TableOption = Annotated[str | None, Option("--out", help="Table: .csv or .parquet.")]
DesignOption = Annotated[str | None, Option("--out", help="Design: .json.")]
PlotsOption = Annotated[bool, Option("--plot/--no-plot", help="Make the plots.")]
PlotOption = Annotated[str | None, Option(help="Plot to write, e.g. plot.png.")]
