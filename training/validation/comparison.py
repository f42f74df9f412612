"""Compares simulations with reference runs: rows, verdicts, and the statistics common to all cases."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from fowt_env.errors import InputError
from fowt_env.training.validation.openfast_cases import RUNS
from fowt_env.training.validation.signal_errors import (
    decay_decrement,
    decay_period,
    harmonics,
    normalised_rms,
)

TIME = "Time_[s]"


class Channel:
    """Names the compared channels as in the tables of simulate."""

    SURGE, HEAVE, PITCH = "PtfmSurge_[m]", "PtfmHeave_[m]", "PtfmPitch_[deg]"
    SPEED, BLADE = "RotSpeed_[rpm]", "BldPitch1_[deg]"
    THRUST, TORQUE, POWER = "RtFldFxh_[N]", "RtFldMxh_[N-m]", "GenPwr_[kW]"
    SWAY, ROLL, YAW = "PtfmSway_[m]", "PtfmRoll_[deg]", "PtfmYaw_[deg]"
    PLANE = (SURGE, HEAVE, PITCH)
    LATERAL = (SWAY, ROLL, YAW)
    MOTIONS = (SURGE, SWAY, HEAVE, ROLL, PITCH, YAW)
    TENSIONS = ("FAIRTEN1_[kN]", "FAIRTEN2_[kN]", "FAIRTEN3_[kN]")


COMBINATIONS = (  # position, surface and stretching of wave kinematics; theory.md, section 8
    ("fixed", "swl", "none"),
    ("instantaneous", "swl", "none"),
    ("fixed", "instantaneous", "wheeler"),
    ("instantaneous", "instantaneous", "wheeler"),
)
SETTLED = 100.0  # s, start-up omitted from statistics
STATISTICS = {"std": "standard deviation", "mean": "mean", "rms": "normalised rms error"}


@dataclass(frozen=True)
class Row:
    """Holds one compared quantity: both values, the error and the allowed error."""

    case: str
    quantity: str
    unit: str
    openfast: float  # or the reference named by the case; nan without one
    here: float
    error: float  # %, relative, or normalised as stated in quantity; nan if not defined
    allowed: float = float("nan")  # %
    note: str = ""

    @property
    def verdict(self):
        """Return "met", "MISSED" or, without an allowed error, "reported"."""
        if not np.isfinite(self.allowed):
            return "reported"
        return "met" if abs(self.error) <= self.allowed else "MISSED"


@dataclass
class Study:
    """Holds the inputs of a validation and the rows computed so far."""

    folder: object = None  # of the reference series
    bts: object = None  # path of the full TurbSim box
    report: object = None  # called with (name of the current run, runs done, total runs)
    total: int = 0  # runs
    done: int = 0
    platform: str = "oc3_hywind"  # a name of validate.PLATFORMS
    groups: tuple = ()  # of comparisons, named in the report
    cases: dict = field(default_factory=lambda: RUNS)  # case -> ReferenceRun
    rows: list = field(default_factory=list)
    runs: dict = field(default_factory=dict)  # case -> (this project's frame, OpenFAST's frame)

    def say(self, text):
        """Report the name of the run that starts."""
        if self.report is not None:
            self.report(text, self.done, self.total)
        self.done += 1

    def add(self, case, quantity, unit, openfast, here, error=None, allowed=float("nan"), note=""):
        """Add a row; error None: the relative error in percent, 0 if both values are zero."""
        if error is None and openfast == 0.0:
            error = 0.0 if here == 0.0 else float("inf")
        elif error is None:
            error = 100.0 * (here / openfast - 1.0)
        row = Row(case, quantity, unit, float(openfast), float(here), float(error), allowed, note)
        self.rows.append(row)

    def pair(self, case, start=None, end=np.inf):
        """Return (this project's frame, OpenFAST's frame) of a case, from start (None: all) to end, s.

        Raises: InputError if the times of the reference differ from those of the run.
        """
        if case not in self.runs:
            self.say(case)
            run = self.cases[case]
            theirs, ours = run.theirs(self.folder), run.frame(self.folder, self.bts)
            if len(ours) != len(theirs) or not np.allclose(ours[TIME], theirs[TIME], atol=1e-6):
                raise InputError(
                    f"reference run {case!r}: times differ from those of the run, every {run.output_dt:g} s"
                )
            self.runs[case] = (ours, theirs)
        pair = self.runs[case]
        return pair if start is None else since(pair, start, end)

    def series(self, case, channel, start=None, end=np.inf):
        """Return (name, unit, times, OpenFAST's series, this project's) of a channel of a case, as pair."""
        ours, theirs = self.pair(case, start, end)
        arrays = (x.to_numpy() for x in (theirs[TIME], theirs[channel], ours[channel]))
        return *name_and_unit(channel), *arrays

    def add_statistics(
        self, case, channels, kinds=tuple(STATISTICS), start=SETTLED, *, pair=None, words="", note="",
        std=float("nan"), rms=float("nan"),
    ):  # fmt: skip
        """Add a row per channel and kind of STATISTICS of a case, computed after start (s).

        pair: frames to compare instead of those of the case; words: suffix of the names of quantities;
        std, rms: allowed errors, %. Rows of rms errors have both standard deviations as values.
        """
        ours, theirs = pair or self.pair(case, start)
        allowed = {"std": std, "rms": rms, "mean": float("nan")}
        for channel in channels:
            name, unit = name_and_unit(channel)
            for kind in kinds:
                both = [f[channel].mean() if kind == "mean" else f[channel].std() for f in (theirs, ours)]
                error = 100.0 * normalised_rms(ours[channel], theirs[channel]) if kind == "rms" else None
                self.add(case, f"{name}, {STATISTICS[kind]}{words}", unit, *both, error, allowed[kind], note)

    def add_decay(self, case, channel, duration, period, decrement, rms, cycles=4, counted=(1, 3)):
        """Add period, decrements of the counted cycles and rms error of a free decay; allowed errors in %."""
        name, unit, time, *both = self.series(case, channel)
        centre = both[0][time > 0.5 * duration].mean()
        periods = [decay_period(time, value, centre, cycles) for value in both]
        counts = "cycle" if cycles == 1 else f"{cycles} cycles"
        self.add(case, f"period, first {counts}", "s", *periods, allowed=period)
        for cycle in counted:
            decrements = [decay_decrement(time, value, centre, cycle) for value in both]
            words = f"logarithmic decrement, {'first' if cycle == 1 else 'third'} cycle"
            self.add(case, words, "-", *decrements, allowed=decrement)
        error = 100.0 * normalised_rms(both[1], both[0])
        self.add(case, f"{name}, {STATISTICS['rms']}", unit, both[0].std(), both[1].std(), error, rms)

    def add_harmonics(self, case, channels, period, window, vector=False):
        """Add first harmonics at a wave period (s), 1 %; vector: also report complex errors."""
        for channel in channels:
            name, unit, time, *both = self.series(case, channel, *window)
            there, here = (harmonics(time, value, 2.0 * np.pi / period)[0] for value in both)
            sizes, note = (abs(there), abs(here)), phase(here, there)
            self.add(case, f"{name}, first harmonic", unit, *sizes, allowed=1.0, note=note)
            if vector:
                error = 100.0 * abs(here - there) / abs(there)
                self.add(case, f"{name}, first harmonic as a vector", unit, *sizes, error)

    def table(self):
        """Return a DataFrame of all rows with their verdicts."""
        return pd.DataFrame([{**vars(row), "verdict": row.verdict} for row in self.rows])


def name_and_unit(channel):
    """Return (name, unit) of a column such as "PtfmSurge_[m]"."""
    name, unit = channel.split("_[")
    return name, unit[:-1]


def since(frames, start, end=np.inf):
    """Return the frames cut to the times start..end (s)."""
    return [frame[(frame[TIME] >= start - 1e-6) & (frame[TIME] <= end + 1e-6)] for frame in frames]


def phase(here, there, digits=2):
    """Return a note with the phase (deg) between two complex amplitudes."""
    return f"phase {np.degrees(np.angle(here / there)):+.{digits}f} deg"
