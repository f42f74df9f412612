"""Figures of series that are compared, worked out apart from the code of the validation, and its judge."""

import re

import numpy as np
import pytest

TIME = "Time_[s]"


def deviation(mine, wanted):
    """Error (%) of a standard deviation."""
    return 100.0 * (mine.std() / wanted.std() - 1.0)


def rms_error(mine, wanted):
    """Rms error (%) over the standard deviation of what is wanted."""
    return 100.0 * float(np.sqrt(((mine - wanted) ** 2).sum() / ((wanted - wanted.mean()) ** 2).sum()))


def of_decay(quantity, time, value):
    """Period (s) of the first cycles of a decay about 0, or its logarithmic decrement, first or third."""
    after = np.flatnonzero(np.diff(np.sign(value)))  # last sample before each zero crossing
    if quantity.startswith("period"):
        cycles = 1 if quantity.endswith("first cycle") else 4
        share = value[after] / (value[after] - value[after + 1])
        at = time[after] + share * (time[1] - time[0])
        return (at[2 * cycles] - at[0]) / cycles
    first = 0 if "first" in quantity else 4  # of the half cycles; the first one has begun before t = 0
    parts = np.split(value, after + 1)
    peaks = [part[np.abs(part).argmax()] for part in parts[first : first + 4]]
    return np.log(abs(peaks[1] - peaks[0]) / abs(peaks[3] - peaks[2]))


def harmonic(time, value, omega):
    """Amplitude at omega (rad/s), by least squares beside a drift and the second harmonic."""
    columns = [np.ones_like(time), time, time**2]
    columns += [f(k * omega * time) for k in (1, 2) for f in (np.cos, np.sin)]
    _, _, _, a, b, _, _ = np.linalg.lstsq(np.column_stack(columns), value, rcond=None)[0]
    return np.hypot(a, b)


def in_band(time, value, low, high):
    """Deviation between two frequencies (Hz), up to a factor."""
    transform = np.fft.rfft((value - value.mean()) * np.hanning(len(time)))
    frequency = np.fft.rfftfreq(len(time), time[1] - time[0])
    return np.sqrt((np.abs(transform[(frequency >= low) & (frequency < high)]) ** 2).sum())


def of_figures(row, rows):
    """Error (%) of a row from the figures of its case."""
    there = {other.quantity.split(",")[0]: other.openfast for other in rows if other.case == row.case}
    scale = row.openfast
    if row.quantity.endswith("of both moments"):
        scale = np.hypot(there["tilting moment at the hub"], there["yawing moment at the hub"])
    elif row.quantity.endswith("of the thrust"):
        scale = there["aerodynamic thrust"]
    elif row.quantity.endswith("over the azimuth, of the mean"):
        root = "RootMyc1, mean over a revolution"
        (scale,) = [other.openfast for other in rows if (other.case, other.quantity) == (row.case, root)]
    return 0.0 if row.here == row.openfast == 0.0 else 100.0 * (row.here - row.openfast) / scale


def anew(row, study, runs):
    """(error, %, how near the study's must be): of series where there are any, else of the two figures."""
    case, quantity = row.case, row.quantity
    name, rms = re.split("[, ]", quantity)[0], "rms error" in quantity
    if "as a vector" in quantity or "second over first" in quantity:  # reported only
        return row.error, 0.0
    if case.startswith("radiation memory"):
        run = quantity.rsplit(", ", 1)[1]
        ours, theirs = runs[run, "state_space"], runs[run, "convolution"]
    elif case not in study.runs or "published" in quantity or name == "tower" or "wake" in case and not rms:
        return of_figures(row, study.rows), 1e-9
    else:
        ours, theirs = study.runs[case]
    time = theirs[TIME].to_numpy()
    if name in ("period", "logarithmic"):
        (channel,) = study.cases[case].initial
        centre = theirs[channel][time > 0.5 * time[-1]].mean()
        series = (frame[channel].to_numpy() - centre for frame in (ours, theirs))
        here, there = (of_decay(quantity, time, value) for value in series)
        return 100.0 * (here / there - 1.0), 0.7  # samples in place of the parabolas through peaks
    begin, end = (
        0.0 if case.startswith(("decay", "radiation")) or "whole record" in quantity else 100.0,
        np.inf,
    )
    if case == "static":
        begin = time[-1] - float(quantity.split("last ")[1].removesuffix(" s"))
    elif case.startswith("float_windsteps"):
        begin = 100.0 * (int(quantity.split(" at ")[1].split(" ")[0]) - 12)
        end = begin + 99.95
    elif case.startswith(("regwave", "wake")):
        begin = 20.0 if "wake" in case else 302.0 if "H4T9" in case else 400.0
    chosen = (time > begin - 1e-6) & (time < end)
    (channel,) = [column for column in theirs if column.startswith(name + "_[")]
    time, mine, wanted = time[chosen], ours[channel].to_numpy()[chosen], theirs[channel].to_numpy()[chosen]
    if "without mean" in quantity:
        mine, wanted = mine - mine.mean(), wanted - wanted.mean()
    if "first harmonic" in quantity:
        omega = 2.0 * np.pi / (9.0 if "H4T9" in case else 5.0)
        here, there = (harmonic(time, value, omega) for value in (mine, wanted))
        return 100.0 * (here / there - 1.0), 0.1  # a slow transient, under another window
    if band := re.search(r"([\d.]+) to ([\d.]+) Hz", quantity):
        here, there = (in_band(time, value, *map(float, band.groups())) for value in (mine, wanted))
        return 100.0 * ((here / there) ** (2 if "energy" in quantity else 1) - 1.0), 1e-6
    if rms:
        return rms_error(mine, wanted), 1e-6
    if "standard deviation" in quantity:
        return deviation(mine, wanted), 1e-6
    return 100.0 * (mine.mean() / wanted.mean() - 1.0), 1e-6


def judged(study, allowed, *exceptions, runs=None):
    """Rows of a study; those that miss what is allowed must be among the exceptions.

    allowed(row): %, None: it is reported. Errors are worked out anew, and the study's own error, allowance
    and verdict must be those. runs: {(case, radiation): frame}, for what compares two runs of this plant.
    """
    for row in study.rows:
        wanted, (error, within) = allowed(row), anew(row, study, runs)
        text = f"{row.case}: {row.quantity}: {row.error:.4g} % against {wanted} %"
        assert row.error == pytest.approx(error, rel=1e-6, abs=within, nan_ok=True), text
        assert row.allowed == pytest.approx(np.nan if wanted is None else wanted, nan_ok=True), text
        verdict = "reported" if wanted is None else "met" if abs(row.error) <= wanted else "MISSED"
        assert row.verdict == verdict, text
        assert verdict != "MISSED" or any(known in text for known in exceptions), text
    return study.rows
