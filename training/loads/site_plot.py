"""Plots the joint climate of a site: wind, expected and severe seas, and peak periods."""

import numpy as np

from fowt_env.training.loads.site_fit import COLUMNS
from fowt_env.visual.style import COLOURS, SOFT, head, new_figure, style_axes

DRAWN = 4000  # sea states in a plot without a table
YEARS = (1, 50)


def plot_site(climate, table=None):
    """Return a Figure of a Climate in three panels: wind, Hs against wind, Tp against Hs.

    table: DataFrame of sea states (site_fit.read_scatter), with winds at the height of the site file; None:
    states drawn from the joint distribution.
    Raises: InputError without matplotlib.
    """
    if table is None:
        wind, Hs, Tp = climate.sample(DRAWN, np.random.default_rng(1))
        name = f"{DRAWN} states drawn from the distribution"
    else:
        wind, Hs, Tp = (table[column].to_numpy(dtype=np.float64) for column in COLUMNS)
        wind = wind * climate.ratio
        name = f"{len(table)} rows of the table"
    figure = new_figure(11.0, 3.8)
    panels = figure.subplots(1, 3)
    speeds = np.linspace(0.0, max(30.0, float(wind.max())), 241)
    style_axes(panels[0], "mean wind at hub (m/s)", "probability density (s/m)")
    edges = np.arange(0.0, speeds[-1] + 2.0, 2.0)
    panels[0].hist(wind, bins=edges, density=True, color=SOFT, alpha=0.35)
    panels[0].plot(speeds, np.gradient(climate.below(speeds), speeds), color=COLOURS[0])
    style_axes(panels[1], "mean wind at hub (m/s)", "Hs (m)")
    dots = panels[1].plot(wind, Hs, ".", color=SOFT, markersize=2, alpha=0.4)[0]
    moving = speeds[speeds >= 1.0]
    lines = [
        panels[1].plot(moving, [sea(speed)[0] for speed in moving], color=colour)[0]
        for sea, colour in ((climate.expected_sea, COLOURS[0]), (climate.severe_sea, COLOURS[1]))
    ]
    style_axes(panels[2], "Hs (m)", "Tp (s)")
    panels[2].plot(Hs, Tp, ".", color=SOFT, markersize=2, alpha=0.4)
    marks = []
    for years, marker in zip(YEARS, ("o", "s"), strict=True):
        _, height, period, _, _ = climate.extreme(years)
        marks += panels[2].plot(height, period, marker, color=COLOURS[1])
    names = (name, "Weibull, expected sea", "severe sea, 50 years", *(f"{years}-year sea" for years in YEARS))
    head(figure, f"{climate.site.name}, hub at {climate.hub_height:g} m", (dots, *lines, *marks), names)
    return figure
