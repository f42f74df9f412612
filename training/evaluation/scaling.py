"""Scales a suite to another platform: winds, limits and initial conditions for its turbine.

Only suites that name a turbine are scaled; suites of a site, paper or sea state keep their winds. With the
same turbine the winds are unchanged, and only settings of the platform change.

winds above rated   shifted by the difference of the rated winds in whole m/s, up to cut-out
rated and cut-out   values of the turbine; other fractional winds are shifted by the exact difference
winds below rated   the same fraction between cut-in and rated, rounded to m/s
winds above cut-out unchanged (parked turbines)
limits              powers scale with rated power, torques with rated torque, rotor speeds with rated speed
initial conditions  `displaced` from the platform's trim, instead of `initial`
"""

import re
from dataclasses import dataclass
from math import ceil

from fowt_env.descriptions.checks import is_number
from fowt_env.descriptions.platform import turbine_of
from fowt_env.descriptions.sea_state import joint_tables
from fowt_env.descriptions.turbine import Turbine, read_turbine
from fowt_env.errors import InputError

FIGURES = {  # prefixes of metrics, and the turbine parameter by which they are scaled
    ("GenPwr", "energy"): lambda t: t.torque_law.rated_power * t.drivetrain.generator_efficiency,
    ("GenTq", "torque_travel", "RotTorq"): lambda t: t.torque_law.rated_torque,
    ("RotSpeed",): lambda t: t.rated_rotor_speed,
}


@dataclass(frozen=True)
class Scaling:
    """Scales winds and limits from the turbine of a suite to another turbine."""

    old: Turbine
    new: Turbine

    @property
    def shift(self):
        """Return the shift of winds above rated, in whole m/s."""
        old, new = self.old.rated_wind_speed, self.new.rated_wind_speed
        moved = round(new - old)
        return moved + 1 if ceil(old) + moved <= new else moved

    def wind(self, speed):
        """Return the scaled mean wind speed, m/s."""
        old, new = self.old, self.new
        winds = [(t.cut_in_wind_speed, t.rated_wind_speed, t.cut_out_wind_speed) for t in (old, new)]
        if winds[0] == winds[1] or speed > old.cut_out_wind_speed:
            return speed
        for old_wind, new_wind in zip(*winds, strict=True):
            if speed == old_wind:
                return new_wind
        difference = new.rated_wind_speed - old.rated_wind_speed
        if not float(speed).is_integer():
            moved = round(speed + difference, 2)
        elif speed > old.rated_wind_speed:
            moved = float(speed + self.shift)
        else:
            fraction = (speed - old.cut_in_wind_speed) / (old.rated_wind_speed - old.cut_in_wind_speed)
            below = new.rated_wind_speed - new.cut_in_wind_speed
            moved = float(round(new.cut_in_wind_speed + fraction * below))
        return min(max(moved, new.cut_in_wind_speed), new.cut_out_wind_speed)

    def limit(self, metric, value):
        """Return the scaled limit of a metric."""
        for names, figure in FIGURES.items():
            if metric.startswith(names) and "[%]" not in metric:
                return value * (figure(self.new) / figure(self.old))
        return value

    def entry(self, entry):
        """Return the scaled CaseEntry of a case."""
        changes = {}
        if isinstance(entry.sea, dict) and {"table", "speed"} <= set(entry.sea):
            speed = within_table(entry.sea["table"], self.wind(entry.sea["speed"]))
            changes["sea"] = entry.sea | {"speed": speed}
        if entry.speed is not None:
            changes["speed"] = tuple(dict.fromkeys(map(self.wind, entry.speed)))
        if is_number(entry.wind):
            changes["wind"] = self.wind(entry.wind)
        elif isinstance(entry.wind, dict) and is_number(before := entry.wind.get("speed")):
            after = self.wind(before)
            changes["wind"] = entry.wind | {"speed": after}
            # a name that ends with the wind speed
            changes["name"] = re.sub(rf"_{before:g}$", f"_{after:g}".replace(".", "_"), entry.name)
        if entry.initial is not None:
            if entry.displaced is None:
                raise InputError(f"case {entry.name!r}: initial: applies to another platform; use displaced")
            changes["initial"] = None
        return entry.model_copy(update=changes)


def within_table(table, speed):
    """Return the wind speed (m/s), limited to the range of a table of joint sea states."""
    winds = joint_tables()[table].wind if table in joint_tables() else (speed,)
    return float(min(max(speed, winds[0]), winds[-1]))


def scaled_file(file, platform):
    """Return a SuiteFile scaled to a platform; unchanged for the platform of the file."""
    if platform is None or platform == file.platform:
        return file
    changes = {"platform": platform}
    if file.turbine is not None:
        scaling = Scaling(read_turbine(file.turbine), turbine_of(platform))
        changes["case"] = tuple(scaling.entry(entry) for entry in file.case)
        limits = {
            kind: {name: scaling.limit(name, value) for name, value in getattr(file.limits, kind).items()}
            for kind in ("run", "lifetime", "case")
        }
        limits["set_point"] = {
            name: point.model_copy(update={"rated": scaling.limit(name, point.rated)})
            for name, point in file.limits.set_point.items()
        }
        changes["limits"] = file.limits.model_copy(update=limits)
    return file.model_copy(update=changes)
