"""Scaling of a suite to another platform: winds, limits and starts for its turbine.

Only suites that name a turbine are scaled; those of a site, a paper or a sea state keep their winds. With the
same turbine the winds stay, and only settings of the platform change.

winds above rated   shifted by the difference of the rated winds in whole m/s, up to cut-out
rated and cut-out   those of the turbine; other fractional winds are shifted by the exact difference
winds below rated   the same fraction between cut-in and rated, rounded to m/s
winds above cut-out unchanged (parked turbines)
limits              powers by the rated power, torques by the rated torque, rotor speeds by the rated one
starts              `displaced` from the platform's trim, in place of `initial`
"""

import re
from dataclasses import dataclass
from math import ceil

from fowt_env.descriptions.checks import is_number
from fowt_env.descriptions.platform import Platform, read_platform
from fowt_env.descriptions.sea_state import joint_tables
from fowt_env.descriptions.turbine import Turbine, read_turbine
from fowt_env.errors import InputError

BY_POWER = ("GenPwr", "energy")  # prefixes of metrics that scale with the quantity
BY_TORQUE = ("GenTq", "torque_travel", "RotTorq")
BY_SPEED = ("RotSpeed",)


def turbine_of(platform):
    """Return the turbine of a platform: a name, a path or a descriptions.platform.Platform."""
    found = platform if isinstance(platform, Platform) else read_platform(platform)
    return read_turbine(found.turbine)


@dataclass(frozen=True)
class Scaling:
    """Scaling from the turbine of a suite to another."""

    old: Turbine
    new: Turbine

    @property
    def shift(self):
        """Shift of winds above rated, in whole m/s."""
        old, new = self.old.rated_wind_speed, self.new.rated_wind_speed
        moved = round(new - old)
        return moved + 1 if ceil(old) + moved <= new else moved

    def wind(self, speed):
        """Return the scaled mean wind speed, m/s."""
        old, new = self.old, self.new
        winds = [(t.cut_in_wind_speed, t.rated_wind_speed, t.cut_out_wind_speed) for t in (old, new)]
        if winds[0] == winds[1] or speed > old.cut_out_wind_speed:
            return speed
        for was, now in zip(*winds, strict=True):
            if speed == was:
                return now
        difference = new.rated_wind_speed - old.rated_wind_speed
        if not float(speed).is_integer():
            moved = round(speed + difference, 2)
        elif speed > old.rated_wind_speed:
            moved = float(speed + self.shift)
        else:
            share = (speed - old.cut_in_wind_speed) / (old.rated_wind_speed - old.cut_in_wind_speed)
            below = new.rated_wind_speed - new.cut_in_wind_speed
            moved = float(round(new.cut_in_wind_speed + share * below))
        return min(max(moved, new.cut_in_wind_speed), new.cut_out_wind_speed)

    def limit(self, metric, value):
        """Return the scaled limit of a metric."""
        if "[%]" in metric:
            return value
        for names, figure in ((BY_POWER, _power), (BY_TORQUE, _torque), (BY_SPEED, _speed)):
            if metric.startswith(names):
                return value * (figure(self.new) / figure(self.old))
        return value

    def sea(self, spec):
        """Return the sea of a case; the row of a table is that of the scaled wind, within the table."""
        if not isinstance(spec, dict) or "table" not in spec or "speed" not in spec:
            return spec
        return spec | {"speed": within_table(spec["table"], self.wind(spec["speed"]))}

    def entry(self, entry):
        """Return the scaled CaseEntry of a case."""
        changes = {"sea": self.sea(entry.sea)}
        if entry.speed is not None:
            changes["speed"] = tuple(dict.fromkeys(map(self.wind, entry.speed)))
        if is_number(entry.wind):
            changes["wind"] = self.wind(entry.wind)
        elif isinstance(entry.wind, dict) and is_number(entry.wind.get("speed")):
            changes["wind"] = entry.wind | {"speed": self.wind(entry.wind["speed"])}
            before, after = entry.wind["speed"], changes["wind"]["speed"]
            # a name that ends with its wind speed
            changes["name"] = re.sub(rf"_{before:g}$", f"_{after:g}".replace(".", "_"), entry.name)
        if entry.initial is not None:
            if entry.displaced is None:
                raise InputError(f"case {entry.name!r}: initial: is that of another platform; use displaced")
            changes["initial"] = None
        return entry.model_copy(update=changes)


def within_table(table, speed):
    """Return the wind speed (m/s), limited to a table of joint sea states."""
    winds = joint_tables()[table].wind if table in joint_tables() else (speed,)
    return float(min(max(speed, winds[0]), winds[-1]))


def _power(turbine):
    return turbine.torque_law.rated_power * turbine.drivetrain.generator_efficiency


def _torque(turbine):
    return turbine.torque_law.rated_torque


def _speed(turbine):
    return turbine.rated_rotor_speed


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
            for kind in ("run", "lifetime")
        }
        changes["limits"] = file.limits.model_copy(update=limits)
    return file.model_copy(update=changes)
