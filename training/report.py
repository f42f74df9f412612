"""What people look at after an evaluation: the printed table and the plots."""

from fowt_env.description import Platform, read_platform
from fowt_env.outputs import read_table
from fowt_env.plots import plot_evaluation, plot_runs, plot_spectra
from training.evaluate import run_file

# printed columns: heading, metric, format
HEADLINE = (
    ("rotor\nspeed\nmean\nrpm", "RotSpeed_mean_[rpm]", ".2f"),
    ("rotor\nspeed\nstd\nrpm", "RotSpeed_std_[rpm]", ".3f"),
    ("over-\nspeed\nmax\n%", "overspeed_[%]", ".1f"),
    ("power\n\nmean\nkW", "GenPwr_mean_[kW]", ".0f"),
    ("power\n\nstd\nkW", "GenPwr_std_[kW]", ".0f"),
    ("ptfm\npitch\nmean\ndeg", "PtfmPitch_mean_[deg]", ".2f"),
    ("ptfm\npitch\nstd\ndeg", "PtfmPitch_std_[deg]", ".3f"),
    ("ptfm\npitch\nmax\ndeg", "PtfmPitch_max_[deg]", ".2f"),
    ("surge\n\nmean\nm", "PtfmSurge_mean_[m]", ".1f"),
    ("blade\npitch\ntravel\ndeg/s", "blade_pitch_travel_[deg/s]", ".3f"),
    ("nac.\nacc.\nrms\nm/s²", "NcIMUTAxs_rms_[m/s^2]", ".3f"),
    ("line\ntension\nmax\nkN", "FAIRTEN_max_[kN]", ".0f"),
)


# dropped from the printed table, first to last, where it is wider than the terminal
DROPPED_FIRST = (
    "PtfmSurge_mean_[m]",
    "FAIRTEN_max_[kN]",
    "NcIMUTAxs_rms_[m/s^2]",
    "RotSpeed_mean_[rpm]",
    "GenPwr_mean_[kW]",
    "PtfmPitch_max_[deg]",
    "PtfmPitch_mean_[deg]",
)


def summary_rows(means, width):
    """(headings, rows of texts, failures per row) of what training.evaluate.summary gives.

    Columns are dropped until headings and values, two spaces between them, take at most `width` characters.
    """
    columns = [
        ("controller", list(means["controller"])),
        ("case", list(means["case"])),
        ("runs", [f"{n - failed}/{n}" for n, failed in zip(means["runs"], means["failed"], strict=True)]),
    ]
    optional = {}
    for heading, name, form in HEADLINE:
        texts = ["-" if value != value else format(value, form) for value in means[name]]
        optional[name] = (heading, texts)
    for name in (None, *DROPPED_FIRST):
        optional.pop(name, None)
        shown = [*columns, *optional.values()]
        if sum(2 + max(map(len, [*heading.split("\n"), *texts])) for heading, texts in shown) <= width:
            break
    headings, texts = zip(*shown, strict=True)
    return headings, list(zip(*texts, strict=True)), list(means["failed"])


def evaluation_plots(table, folder, cases, skip=0.0):
    """Paths of the plots made of an evaluation of Cases whose runs lie in folder/runs.

    metrics.png compares the controllers over all cases; timeseries_CASE.png and spectra_CASE.png show
    the first seed of each case that went well. skip: s left out of the spectra.
    """
    good = table[table["status"] == "ok"]
    if good.empty:
        return []
    paths = [folder / "metrics.png"]
    plot_evaluation(table, [name for _, name, _ in HEADLINE], paths[0], "Mean over seeds, with their range")
    for case in cases:
        rows = good[good["case"] == case.name]
        if rows.empty:
            continue
        seed = rows["seed"].iloc[0]
        names = rows.loc[rows["seed"] == seed, "controller"]
        runs = {name: read_table(run_file(folder / "runs", name, case.name, seed)) for name in names}
        paths += [folder / f"timeseries_{case.name}.png", folder / f"spectra_{case.name}.png"]
        title = f"{case.name}, seed {seed}"
        plot_runs(runs, paths[-2], title)
        plot_spectra(
            runs, paths[-1], title, skip, platform_pitch_period=_platform_pitch_period(case.platform)
        )
    return paths


def _platform_pitch_period(platform):
    """Natural period (s) in platform pitch that a platform's file states, or None."""
    description = platform if isinstance(platform, Platform) else read_platform(platform)
    return description.published.get("natural_periods", {}).get("pitch")
