"""A comparison of this plant with a reference: its rows, their verdicts, and the rows that cases share."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from fowt_env.errors import InputError
from fowt_env.training.validation.openfast_cases import RUNS
from fowt_env.training.validation.signal_errors import decay_decrement, decay_period, normalised_rms

TIME = "Time_[s]"


class Channel:
    """Columns of the compared series, as simulate names them."""

    SURGE, HEAVE, PITCH = "PtfmSurge_[m]", "PtfmHeave_[m]", "PtfmPitch_[deg]"
    SPEED, BLADE = "RotSpeed_[rpm]", "BldPitch1_[deg]"
    THRUST, TORQUE, POWER = "RtFldFxh_[N]", "RtFldMxh_[N-m]", "GenPwr_[kW]"
    PLANE = (SURGE, HEAVE, PITCH)
    MOTIONS = (SURGE, "PtfmSway_[m]", HEAVE, "PtfmRoll_[deg]", PITCH, "PtfmYaw_[deg]")
    TENSIONS = ("FAIRTEN1_[kN]", "FAIRTEN2_[kN]", "FAIRTEN3_[kN]")


COMBINATIONS = (  # position, surface and stretching of wave kinematics; theory.md, section 8
    ("fixed", "swl", "none"),
    ("instantaneous", "swl", "none"),
    ("fixed", "instantaneous", "wheeler"),
    ("instantaneous", "instantaneous", "wheeler"),
)
SETTLED = 100.0  # s left out of statistics
STATISTICS = {"std": "standard deviation", "mean": "mean", "rms": "normalised rms error"}


@dataclass(frozen=True)
class Row:
    """One compared quantity: both values, the error, and the allowed error."""

    case: str
    quantity: str
    unit: str
    openfast: float  # or the reference that the case names; nan if there is none
    here: float
    error: float  # %, relative or normalised as the quantity says; nan if only reported
    allowed: float = float("nan")  # %
    note: str = ""

    @property
    def verdict(self):
        """ "met", "MISSED" or "reported"."""
        if not np.isfinite(self.allowed):
            return "reported"
        return "met" if abs(self.error) <= self.allowed else "MISSED"


@dataclass
class Study:
    """Inputs of a validation and the rows that it has found so far."""

    folder: object = None  # of the reference series
    bts: object = None  # path of the full TurbSim box
    report: object = None  # called with the name of the present run, the runs done and their number
    total: int = 0  # runs
    done: int = 0
    platform: str = "oc3_hywind"  # a name of validate.PLATFORMS
    cases: dict = field(default_factory=lambda: RUNS)  # case -> ReferenceRun
    rows: list = field(default_factory=list)
    runs: dict = field(default_factory=dict)  # case -> (this project's frame, OpenFAST's frame)

    def say(self, text):
        """Report the name of the run that begins."""
        if self.report is not None:
            self.report(text, self.done, self.total)
        self.done += 1

    def add(self, case, quantity, unit, openfast, here, error=None, allowed=float("nan"), note=""):
        """Add a row; without an error its error is the relative one in percent."""
        if error is None:
            error = relative(here, openfast)
        row = Row(case, quantity, unit, float(openfast), float(here), float(error), allowed, note)
        self.rows.append(row)

    def pair(self, case, start=None, end=np.inf):
        """Return (this project's frame, OpenFAST's frame) of a case, from start to end (s) where given.

        Raises: InputError where the reference has other times than the run.
        """
        if case not in self.runs:
            self.say(case)
            run = self.cases[case]
            theirs = run.theirs(self.folder)
            ours = run.frame(self.folder, self.bts)
            if len(ours) != len(theirs) or not np.allclose(ours[TIME], theirs[TIME], atol=1e-6):
                raise InputError(
                    f"reference run {case!r}: its times are not those of the run, every {run.output_dt:g} s"
                )
            self.runs[case] = (ours, theirs)
        pair = self.runs[case]
        return pair if start is None else since(pair, start, end)

    def add_statistics(
        self, case, channels, kinds=tuple(STATISTICS), start=SETTLED, *, pair=None, words="", note="",
        std=float("nan"), rms=float("nan"),
    ):  # fmt: skip
        """Add a row for each channel and kind of STATISTICS of a case from start (s) on.

        pair: the frames to compare, in place of the case's; words: end of each quantity's name; std, rms:
        allowed errors of these kinds, % (nan: reported). An rms error is shown beside both deviations.
        """
        ours, theirs = self.pair(case, start) if pair is None else pair
        allowed = {"std": std, "rms": rms}
        for channel in channels:
            name, unit = name_and_unit(channel)
            for kind in kinds:
                both = [f[channel].mean() if kind == "mean" else f[channel].std() for f in (theirs, ours)]
                error = 100.0 * normalised_rms(ours[channel], theirs[channel]) if kind == "rms" else None
                quantity = f"{name}, {STATISTICS[kind]}{words}"
                self.add(case, quantity, unit, *both, error, allowed.get(kind, float("nan")), note)

    def add_decay(self, case, channel, duration, period, decrement, rms, cycles=4, counted=(1, 3)):
        """Add the rows of a free decay: period of its first cycles, decrements of some, and the rms error.

        period, decrement, rms: allowed errors, %.
        """
        ours, theirs = self.pair(case)
        time = theirs[TIME].to_numpy()
        centre = theirs[channel][time > 0.5 * duration].mean()
        both = [frame[channel].to_numpy() for frame in (theirs, ours)]
        counts = "cycle" if cycles == 1 else f"{cycles} cycles"
        periods = [decay_period(time, value, centre, cycles) for value in both]
        self.add(case, f"period, first {counts}", "s", *periods, allowed=period)
        for cycle in counted:
            decrements = [decay_decrement(time, value, centre, cycle) for value in both]
            words = {1: "first", 2: "second", 3: "third"}[cycle]
            self.add(case, f"logarithmic decrement, {words} cycle", "-", *decrements, allowed=decrement)
        name, unit = name_and_unit(channel)
        error = 100.0 * normalised_rms(both[1], both[0])
        self.add(case, f"{name}, {STATISTICS['rms']}", unit, both[0].std(), both[1].std(), error, rms)

    def table(self):
        """Return a DataFrame of all rows with their verdicts."""
        return pd.DataFrame([{**vars(row), "verdict": row.verdict} for row in self.rows])


def relative(value, reference_value):
    """Return the error in percent of the reference; 0 where both are zero."""
    if reference_value == 0.0:
        return 0.0 if value == 0.0 else float("inf")
    return 100.0 * (value / reference_value - 1.0)


def name_and_unit(channel):
    """Return (name, unit) of a column such as "PtfmSurge_[m]"."""
    name, unit = channel.split("_[")
    return name, unit[:-1]


def since(frames, start, end=np.inf):
    """Return the frames cut to the times from start to end (s)."""
    return [frame[(frame[TIME] >= start - 1e-6) & (frame[TIME] <= end + 1e-6)] for frame in frames]


def phase(here, there, digits=2):
    """Return a note on the phase (deg) between two complex amplitudes."""
    return f"phase {np.degrees(np.angle(here / there)):+.{digits}f} deg"
