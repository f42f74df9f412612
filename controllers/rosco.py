"""Runs ROSCO, the reference open-source controller, through its library, with the published OC3 gains.

Abbas et al., Wind Energ. Sci. 7, 2022. libdiscon of the PyPI wheel `rosco` (its toolbox is not used) is
called through the Bladed interface, as in OpenFAST. If the turbine file names a DISCON.IN, this file is used
unchanged with its rotor table, or with a computed table if it names none. Otherwise DISCON.IN is written from
the turbine's description and the Cp, Ct, Cq table from the blade elements; gains and schedule are those
published for OC3-Hywind (or of controllers/gains.py), because the automatic tuning gives a positive
proportional gain above 16 deg. Individual pitch control uses the integral gain of `ipc` at zero pitch.

A loaded library is a single controller that can start once: every reset() loads a private copy of the file.
"""

import ctypes
import importlib.util
import os
import re
import shutil
import sys
import tempfile
import weakref
from _ctypes import dlclose
from dataclasses import dataclass
from importlib.metadata import version
from math import pi
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import brentq

from fowt_env.caches import Cache
from fowt_env.control import call_law, check_control_dt, values_of_blades
from fowt_env.controllers.bladed.controller import SYMBOL, call_error
from fowt_env.controllers.bladed.law import N_MEMORY, Memory, Parameter, library_law
from fowt_env.controllers.bladed.library import MEMORY_SIZE, Library
from fowt_env.controllers.bladed.records import START
from fowt_env.controllers.bladed.swap import Swap
from fowt_env.controllers.gains import published_set, with_gains
from fowt_env.controllers.ipc.design import BANDWIDTH, lead_time, root_slope
from fowt_env.controllers.settings import POSITIVE, Settings
from fowt_env.controllers.tuned import tuned_for
from fowt_env.descriptions.checks import check_one_of
from fowt_env.descriptions.files import read_text
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError, unknown, warn_once
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.coefficient_table import performance
from fowt_env.plant.state import N_COMMANDS, N_INDIVIDUAL_COMMANDS

INSTALL = "pip install --no-deps rosco"
PRELOADED = ("libquadmath", "libgfortran", "libmvec")  # bundled with libdiscon; not found from a copy
RATIOS = np.linspace(2.0, 20.0, 37)  # tip-speed ratios of the table
PITCHES = DEGREE * np.concatenate([np.arange(-5.0, 30.0, 1.0), np.linspace(30.0, 90.0, 13)])
SCHEDULE = 0.5 * pi * np.linspace(0.0, 1.0, 40) ** 2  # blade pitch of the gain table, rad
POLE_SPEEDS = 45  # winds of the estimator's table of poles
MINIMUM_SPEED = 1.1  # times cut-in speed: if region 2 starts below, cut-in is the minimum speed
INDIVIDUAL = "IPC_ControlMode"  # needs blade root loads, provided with individual=True
# Modes of a DISCON.IN that need inputs not provided here: yaw, flaps, files, sockets
OFF = (
    "Y_ControlMode", "Flp_Mode", "OL_Mode", "AWC_Mode", "Ext_Mode", "ZMQ_Mode", "CC_Mode",
    "StC_Mode",
)  # fmt: skip
IPC_AMPLITUDE = 0.2618  # rad, largest cyclic pitch: IPC_IntSat of ROSCO's toolbox
IPC_RAMP = (0.8, 1.0)  # of rated wind, range over which IPC fades in: IPC_Vramp of ROSCO's toolbox
# start-up (SU_Mode) of a written DISCON.IN: the defaults of ROSCO's toolbox, in load stages of the torque;
# its rotor speed at which the load begins is that of the torque law. A DISCON.IN of a turbine has its own
STARTS = {
    "SU_FW_MinDuration": 200.0,
    "SU_RotorSpeedCornerFreq": 0.41888,
    "SU_LoadStages_N": 2,
    "SU_LoadStages": (0.2, 1.0),
    "SU_LoadRampDuration": (100.0, 100.0),
    "SU_LoadHoldDuration": (200.0, 100.0),
}
# entries that ROSCO 2.10 requires and files of 2.9 lack, with the default of its toolbox
ADDED = {"F_VSRefSpdCornerFreq": 0.20944}  # rad/s, low pass of the reference speed of the torque loop
SILENT = {"LoggingLevel": 0, "Echo": 0, "Ext_Interface": 0}  # no log files, standard interface
ENTRY = re.compile(r"^(?P<value>[^!]*?)(?P<gap>\s*!\s*)(?P<name>\w+)\b")
BLADES_READ = (
    "azimuth", "blade_pitch_1", "blade_pitch_2", "blade_pitch_3", "root_out_of_plane_1",
    "root_out_of_plane_2", "root_out_of_plane_3",
)  # fmt: skip
MUTEX_SIZE = 64  # bytes, more than sizeof(pthread_mutex_t); PTHREAD_MUTEX_INITIALIZER is zero
INPUT_FILE, ROTOR_FILE = "DISCON.IN", "rotor.txt"
OUT_NAME = "rosco.out"  # log files are rosco.RO.dbg ...: ROSCO replaces the extension, and needs one
TORQUE_FREQUENCY, TORQUE_DAMPING = 0.15, 0.7  # rad/s, of the torque loop in ROSCO's NREL 5 MW deck


@dataclass(frozen=True)
class RoscoSettings(Settings):
    """Holds the floating feedback of ROSCO (Fl_Mode) and factors on its pitch gains.

    Raises: InputError naming the key, value and allowed range.
    """

    RANGES = dict.fromkeys(("low_pass", "high_pass", "kp", "ki"), POSITIVE) | {
        "gain": {"high": 0.0, "allowed": "finite and <= 0 (a positive gain excites the platform)"}
    }

    mode: int = 0  # Fl_Mode: 0 none, 1 of the tower-top acceleration, 2 of the nacelle's pitch acceleration
    gain: float = 0.0  # Fl_Kp, rad per m/s (mode 1) or s (mode 2); negative values damp the platform
    low_pass: float = 0.21  # rad/s, second-order low pass with damping ratio 1
    high_pass: float = 0.01  # rad/s, first-order high pass
    kp: float = 1.0  # factor on the published proportional gain
    ki: float = 1.0  # factor on the published integral gain

    def __post_init__(self):
        check_one_of("mode", self.mode, (0, 1, 2))
        super().__post_init__()


class Discon:
    """Reads and modifies the DISCON.IN of a turbine for ROSCO.

    A file of ROSCO 2.9 gets the entries of ADDED, with a warning.
    individual: whether to control the pitch of each blade; switched on if disabled in the file.
    Raises: InputError for other files, and for modes that need inputs not provided to the library.
    """

    def __init__(self, path, individual=False):
        self.path = Path(path)
        self.text = read_text(self.path, "DISCON.IN")
        entries = [match for line in self.text.splitlines() if (match := ENTRY.match(line))]
        # the first entry of a name is used
        self.values = {match["name"]: match["value"].strip() for match in reversed(entries)}
        where = f"DISCON.IN {str(path)!r}"
        for key in ("PerfFileName", "PerfTableSize", "Fl_Mode", "LoggingLevel", INDIVIDUAL, *OFF):
            if key not in self.values:
                raise InputError(f"{where}: {key} is missing: must be a file of ROSCO 2.9 or later")
        self.switched = {INDIVIDUAL: 1} if individual and self.values[INDIVIDUAL] == "0" else {}
        for key in OFF if individual else (INDIVIDUAL, *OFF):
            if self.values[key] != "0":
                raise InputError(f"{where}: {key} = {self.values[key]}: must be 0 here")
        if self.values["Fl_Mode"] not in ("0", "1", "2"):
            raise InputError(f"{where}: Fl_Mode = {self.values['Fl_Mode']}: must be 0, 1 or 2")
        self.mode = int(self.values["Fl_Mode"])  # determines which acceleration the library receives
        self.added = {key: value for key, value in ADDED.items() if key not in self.values}
        if self.added:
            named = ", ".join(f"{key} = {value:g}" for key, value in self.added.items())
            warn_once(
                ("DISCON.IN", self.path),
                f"{where}: of ROSCO 2.9, without an entry that 2.10 needs: {named} is used, its default",
            )

    def texts(self, changes, table):
        """Return the texts of DISCON.IN with changes and rotor table; table(): Table if there is no file."""
        _check_entries(changes, self.values | self.added)
        changes = SILENT | {"PerfFileName": f'"{ROTOR_FILE}"'} | self.switched | changes
        named = self.path.parent / self.values["PerfFileName"].strip("\"'")
        if named.is_file():
            rows = read_text(named, "rotor performance")
        else:
            computed = table()
            changes["PerfTableSize"] = (len(computed.blade_pitch), len(computed.ratio))
            rows = table_text(computed)
        lines = []
        for line in self.text.splitlines():
            match = ENTRY.match(line)
            if match and match["name"] in changes:
                line = f"{_words(changes[match['name']])}{line[match.end('value') :]}"
            lines.append(line)
        lines += [f"{_words(changes.get(key, value))} ! {key}" for key, value in self.added.items()]
        return "\n".join([*lines, ""]), rows


def _check_entries(changes, known):
    for key in changes:
        if key not in known:
            raise unknown("entry of DISCON.IN", key, known)


def find_library():
    """Return (path of libdiscon, [paths of required libraries]) of the installed wheel.

    Raises: InputError with the install command.
    """
    if sys.platform != "linux":
        raise InputError(f"controller 'rosco': its library is loaded on Linux alone: this is {sys.platform}")
    spec = importlib.util.find_spec("rosco")  # without importing the toolbox, which needs more packages
    if spec is None or not spec.submodule_search_locations:
        raise InputError(f"controller 'rosco': the ROSCO library is not installed; {INSTALL}")
    package = Path(next(iter(spec.submodule_search_locations)))
    library = package / "lib" / "libdiscon.so"
    if not library.is_file():
        raise InputError(f"controller 'rosco': {library} is missing; {INSTALL} --force-reinstall")
    bundled = sorted((package.parent / "rosco.libs").glob("lib*.so*"))
    return library, [path for name in PRELOADED for path in bundled if path.name.startswith(name)]


_needed = []  # libraries of the wheel, loaded once per process


def _preload(paths):
    """Load the libraries required by private copies of libdiscon. Raises: InputError if loading fails."""
    if not _needed:
        try:
            _needed.extend(ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL) for path in paths)
        except OSError as error:
            raise InputError(f"controller 'rosco': cannot load libraries ({error}); {INSTALL}") from error


# pthread mutex, unlocked: overlapping redirections could leave standard output redirected
_redirecting = ctypes.create_string_buffer(MUTEX_SIZE)


class Rosco:
    """Runs one ROSCO controller, see the module docstring; call prepare(scene) before reset.

    settings: RoscoSettings, from which DISCON.IN is written for a scene, or a Discon, used unchanged.
    changes: {name in DISCON.IN: value} that replace values of DISCON.IN.
    individual: whether the controller receives blade root loads and commands the pitch of each blade; a
    Discon must be created with the same value.
    nodding: whether Fl_Mode 2 of a Discon receives the acceleration of the nacelle, as from OpenFAST, which
    contains the bending of the tower; else the difference of the measured platform pitch rate.
    """

    def __init__(self, settings, control_dt, name="rosco", changes=None, individual=False, nodding=False):
        self.settings = settings
        self.changes = dict(changes or {})
        self.control_dt = check_control_dt(control_dt)
        self.name = str(name)
        self.individual = bool(individual)
        self._files = self._remove = None
        self._start_up = {}  # entries of DISCON.IN of an ordered start-up
        self.nodding = bool(nodding)
        # sensors measure the rate of the platform's pitch, not the acceleration of the nacelle's
        differenced = isinstance(settings, Discon) and not self.nodding
        rotation = "platform_pitch_rate" if differenced else "nacelle_pitch_acceleration"
        motion = {0: (), 1: ("nacelle_acceleration",), 2: (rotation,)}[settings.mode]
        used = ("time", "rotor_speed", "generator_speed", "generator_torque", "blade_pitch", "wind_speed")
        blades = BLADES_READ if self.individual else ()
        self.information = (*used, *motion, *blades, "plant_model")
        self._library = self._swap = None
        self._parameters, self._memory = np.zeros(len(Parameter)), np.zeros(N_MEMORY)
        self._parameters[Parameter.CONTROL_DT] = self.control_dt
        self._parameters[Parameter.INDIVIDUAL] = self.individual
        self._parameters[Parameter.DIFFERENCED] = "platform_pitch_rate" in motion
        self._command = np.zeros(N_INDIVIDUAL_COMMANDS if self.individual else N_COMMANDS)

    def __getstate__(self):
        """Return the settings without the running library; call prepare() and reset() on a copy."""
        kept = ("settings", "control_dt", "name", "changes", "individual", "nodding")
        return {key: getattr(self, key) for key in kept}

    def __setstate__(self, state):
        self.__init__(**state)

    def order_start_up(self, time):
        """Order the start-up of ROSCO (SU_Mode) at a time, s, before prepare(); None: none.

        Raises: InputError for a DISCON.IN without it.
        """
        self._start_up = {} if time is None else {"SU_Mode": 1, "SU_StartTime": float(time)}
        if self._start_up and isinstance(self.settings, Discon):
            for key in ("SU_Mode", "SU_StartTime", "SU_RotorSpeedThresh", *STARTS):
                if key not in self.settings.values:
                    raise InputError(
                        f"faults: start_up: DISCON.IN {str(self.settings.path)!r} has no {key}: must be a"
                        " file of ROSCO 2.10 or later, or by = 'supervisor'"
                    )

    def inputs(self, scene):
        """Return {name of the file: text} of DISCON.IN and its rotor table for a scene.

        Raises: InputError without wind, and for changes of names not in DISCON.IN.
        """
        if scene.model.aero is None:
            raise InputError(f"controller {self.name!r}: needs a scene with wind for the rotor table")
        turbine, density = scene.turbine, scene.platform.environment.air_density
        if isinstance(self.settings, Discon):
            changes = self.changes | self._start_up
            text, table = self.settings.texts(changes, lambda: rotor_table(turbine, density))
        else:
            computed = rotor_table(turbine, density)
            values = deck(with_gains(scene), density, computed, self.settings)
            if self.individual:
                values |= individual_entries(turbine, self.control_dt)
            if self._start_up:
                values |= STARTS | {"SU_RotorSpeedThresh": turbine_connects(turbine)}
            _check_entries(self.changes, values)
            values |= self._start_up
            text, table = deck_text(values | self.changes), table_text(computed)
        return {ROTOR_FILE: table, INPUT_FILE: text}

    def prepare(self, scene):
        """Write DISCON.IN and the rotor table for a scene, or those of the Discon.

        Raises: InputError without wind or library, and for changes of names not in DISCON.IN.
        """
        files = self.inputs(scene)
        self._source, needed = find_library()
        _preload(needed)
        self._turbine = scene.turbine
        if self._remove is not None:
            self._remove()
        self._files = tempfile.mkdtemp(prefix="fowt_rosco_")
        self._remove = weakref.finalize(self, shutil.rmtree, self._files, ignore_errors=True)
        for name, content in files.items():
            Path(self._files, name).write_text(content, encoding="utf-8")

    def reset(self, measurement):
        """Load a new copy of the library and start the controller at a Measurement.

        Raises: InputError if prepare() was not called or the library does not load; ControllerError with
        ROSCO's message if the controller does not start.
        """
        if self._files is None:
            raise InputError(f"controller {self.name!r}: call prepare(scene) before reset(measurement)")
        memory = bytearray(MEMORY_SIZE)
        self._library = _Copy(self._source, self._files, memory)
        deck = str(Path(self._files, INPUT_FILE))
        self._swap = Swap(memory, self._turbine, self.control_dt, deck, OUT_NAME, self.individual)
        self._parameters[Parameter.EFFICIENCY] = self._turbine.drivetrain.generator_efficiency
        self._memory[:] = 0.0
        self._library.put_addresses(self._memory)
        self._memory[Memory.STATUS] = START
        self.act(measurement)
        self._memory[Memory.FIRST] = measurement.time

    def act(self, measurement):
        """Return (generator torque, blade pitch) or, with individual pitch, (torque, pitch of each blade).

        At the time of reset() this is the command of the first call. Raises: ControllerError with ROSCO's
        message if the call fails.
        """
        values = np.array([*measurement, *values_of_blades(measurement)], dtype=np.float64)
        call_law(library_law, self._parameters, self._memory, values, self._command)
        if error := self.failure(measurement.time):
            raise error
        return tuple(self._command.tolist())

    @property
    def in_loop(self):
        """Return (law, parameters, memory) of the calls of act() for the compiled loop."""
        return library_law, self._parameters, self._memory

    def failure(self, time):
        """Return the ControllerError of a last call, at a time in s, that failed; None if it did not."""
        if self._swap.failure >= 0:
            return None
        what = f"ROSCO reports {self._swap.message!r}"
        if isinstance(self.settings, Discon) and "SetParameters" in what:  # while it reads its file
            what += f" for {str(self.settings.path)!r}; installed is ROSCO {version('rosco')}"
        return call_error(self.name, what, float(time))


class _Copy(Library):
    """Loads a private copy of libdiscon, which is unloaded with this object."""

    def __init__(self, source, folder, memory):
        handle, path = tempfile.mkstemp(suffix=".so", dir=folder)
        os.close(handle)
        shutil.copyfile(source, path)
        try:
            super().__init__(path, SYMBOL, memory)
        except (OSError, AttributeError) as error:
            raise InputError(f"controller 'rosco': {path} cannot be used ({error}); {INSTALL}") from error
        finally:
            os.unlink(path)  # the file is not needed after loading
        self._null = os.open(os.devnull, os.O_WRONLY)
        self._end = weakref.finalize(self, _unload, self.handle, self._null)

    def put_addresses(self, memory):
        """Write what library_law calls into its memory (N_MEMORY,).

        The law suppresses standard output during a call, because at every logging level the library prints
        six lines at each start and a message when its wind estimator leaves its bounds; the buffer of the
        Fortran library is flushed for this.
        """
        memory[Memory.FUNCTION] = address_of(self._function)
        memory[Memory.ARGUMENTS : Memory.FLUSH] = self._arguments
        flushing = (library for library in _needed if hasattr(library, "_gfortran_flush_i4"))
        flush = getattr(next(flushing, None), "_gfortran_flush_i4", None)
        memory[Memory.FLUSH] = 0 if flush is None else address_of(flush)
        memory[Memory.NULL_DEVICE] = self._null
        memory[Memory.LOCK] = ctypes.addressof(_redirecting)


def address_of(function):
    """Return the address of a function of ctypes."""
    return ctypes.cast(function, ctypes.c_void_p).value


def _unload(library, null):
    """Unload a library by its handle and close the null device."""
    dlclose(library)
    os.close(null)


class Table(NamedTuple):
    """Holds rotor performance over tip-speed ratio (n,) and blade pitch (m,) rad; coefficients (n, m)."""

    ratio: np.ndarray
    blade_pitch: np.ndarray
    cp: np.ndarray
    ct: np.ndarray
    cq: np.ndarray


_tables = Cache(16)  # (id of the turbine, density) -> (turbine, Table)


def rotor_table(turbine, density):
    """Return the Table of a turbine's blade elements."""
    key = (id(turbine), density)

    def make():
        cp, ct, cq = performance(build_blade_elements(turbine, density), RATIOS, PITCHES)
        return turbine, Table(RATIOS, PITCHES, cp, ct, cq)  # keeps the turbine, so that its id stays valid

    return _tables.get(key, make)[1]


def poles(turbine, density, table):
    """Return (wind m/s, pole 1/s) of the isolated rotor speed at steady states, from cut-in to cut-out."""
    radius = turbine.rotor.tip_radius
    scale = 0.5 * density * pi * radius**3
    inertia = _inertia(turbine)
    cq = RectBivariateSpline(table.ratio, table.blade_pitch, table.cq)
    winds = np.linspace(turbine.cut_in_wind_speed, turbine.cut_out_wind_speed, POLE_SPEEDS)
    ratios, pitches = steady_states(turbine, density, table, winds)
    # torque = scale V^2 Cq(omega R/V, pitch)
    slopes = [cq(*state, dx=1)[0, 0] for state in zip(ratios, pitches, strict=True)]
    return winds, scale * winds * radius * np.array(slopes) / inertia


def steady_states(turbine, density, table, winds):
    """Return (tip-speed ratio, blade pitch rad), each (n,), of steady operation at winds (n,), m/s."""
    radius = turbine.rotor.tip_radius
    scale = 0.5 * density * pi * radius**3
    rated, finest = turbine.rated_rotor_speed, turbine.pitch_drive.minimum
    torque = turbine.torque_law.rated_torque * turbine.drivetrain.gear_ratio
    cq = RectBivariateSpline(table.ratio, table.blade_pitch, table.cq)
    best = best_ratio(turbine, table)
    ratios, pitches = np.minimum(best, rated * radius / winds), np.full(len(winds), finest)
    for i, (wind, ratio) in enumerate(zip(winds, ratios, strict=True)):
        surplus = lambda b, w=wind, r=ratio: scale * w * w * cq(r, b)[0, 0] - torque  # noqa: E731
        if ratio < best and surplus(finest) > 0.0:
            pitches[i] = brentq(surplus, finest, table.blade_pitch[-1])
    return ratios, pitches


def best_ratio(turbine, table):
    """Return the tip-speed ratio of maximum power at minimum blade pitch."""
    power = RectBivariateSpline(table.ratio, table.blade_pitch, table.cp)
    fine = np.linspace(table.ratio[0], table.ratio[-1], 2000)
    return float(fine[np.argmax(power(fine, turbine.pitch_drive.minimum)[:, 0])])


def _inertia(turbine):
    """Return the inertia of rotor and generator about the low-speed shaft, kg m2."""
    drive = turbine.drivetrain
    return turbine.rotor.inertia + drive.gear_ratio**2 * drive.generator_inertia


def pitch_gains(turbine):
    """Return (KP, KI), each (n,), over SCHEDULE with ROSCO's sign: pitch per (reference - measured speed)."""
    published = published_set(turbine, "oc3")
    schedule = 1.0 / (1.0 + SCHEDULE / published.gain_schedule_pitch)
    return -published.KP * schedule, -published.KI * schedule


def deck(turbine, density, table, settings):
    """Return {name: value} of DISCON.IN for a turbine; values are numbers, texts or sequences of numbers."""
    law, drive, ratio = turbine.torque_law, turbine.pitch_drive, turbine.drivetrain.gear_ratio
    inertia, radius = _inertia(turbine), turbine.rotor.tip_radius
    winds, pole = poles(turbine, density, table)
    near_rated = float(np.interp(turbine.rated_wind_speed - 0.5, winds, pole))
    slope = -(ratio**2) / inertia  # of generator acceleration over generator torque
    best = best_ratio(turbine, table)
    proportional, integral = pitch_gains(turbine)
    slowest = ratio * best * turbine.cut_in_wind_speed / radius
    if law.region2_start_speed < MINIMUM_SPEED * law.cut_in_speed:
        slowest = law.cut_in_speed
    flags = dict.fromkeys(
        (
            "LoggingLevel", "DT_Out", "Ext_Interface", "Echo",
            "IPC_ControlMode", "VS_FBP", "Y_ControlMode", "PRC_Mode", "PS_Mode", "SU_Mode", "SD_Mode",
            "TD_Mode", "TRA_Mode", "Flp_Mode", "OL_Mode", "PA_Mode", "PF_Mode", "AWC_Mode", "Ext_Mode",
            "ZMQ_Mode", "CC_Mode", "StC_Mode", "F_NumNotchFilts", "F_GenSpdNotch_N", "F_TwrTopNotch_N",
        ),
        0,
    )  # fmt: skip
    return flags | {
        "F_LPFType": 1,
        "VS_ControlMode": 2,
        "VS_ConstPower": 0,
        "PC_ControlMode": 1,
        "SS_Mode": 1,
        "WE_Mode": 2,
        "Fl_Mode": settings.mode,
        "F_LPFCornerFreq": law.speed_filter_corner,
        "F_LPFDamping": 0.0,
        "F_SSCornerFreq": 0.6283,
        "F_WECornerFreq": 0.20944,
        "F_YawErr": 0.17952,
        "F_FlCornerFreq": (settings.low_pass, 1.0),
        "F_FlHighPassFreq": settings.high_pass,
        "F_FlpCornerFreq": (1.0, 1.0),
        "F_VSRefSpdCornerFreq": 0.20944,
        "PC_GS_n": len(SCHEDULE),
        "PC_GS_angles": SCHEDULE,
        "PC_GS_KP": settings.kp * proportional,
        "PC_GS_KI": settings.ki * integral,
        "PC_GS_KD": np.zeros(len(SCHEDULE)),
        "PC_GS_TF": np.zeros(len(SCHEDULE)),
        "PC_MaxPit": drive.maximum,
        "PC_MinPit": drive.minimum,
        "PC_MaxRat": drive.rate_limit,
        "PC_MinRat": -drive.rate_limit,
        "PC_RefSpd": law.rated_speed,
        "PC_FinePit": drive.minimum,
        "PC_Switch": law.region3_min_pitch,
        "VS_GenEff": 100.0 * turbine.drivetrain.generator_efficiency,
        "VS_ArSatTq": law.rated_torque,
        "VS_MaxRat": law.max_torque_rate,
        "VS_MaxTq": law.max_torque,
        "VS_MinTq": 0.0,
        "VS_MinOMSpd": slowest,
        "VS_Rgn2K": law.region2_constant,
        "VS_RtPwr": turbine.drivetrain.generator_efficiency * law.rated_power,
        "VS_RtTq": law.rated_torque,
        "VS_RefSpd": law.rated_speed,
        "VS_n": 1,
        "VS_KP": (2.0 * TORQUE_DAMPING * TORQUE_FREQUENCY + near_rated) / slope,
        "VS_KI": TORQUE_FREQUENCY**2 / slope,
        "VS_TSRopt": best,
        "SS_VSGain": 1.0,
        "SS_PCGain": 0.05,
        "WE_BladeRadius": radius,
        "WE_Gamma": 0.0,
        "WE_GearboxRatio": ratio,
        "WE_Jtot": inertia,
        "WE_RhoAir": density,
        "PerfFileName": f'"{ROTOR_FILE}"',
        "PerfTableSize": (len(table.blade_pitch), len(table.ratio)),
        "WE_FOPoles_N": len(winds),
        "WE_FOPoles_v": winds,
        "WE_FOPoles": pole,
        "Fl_n": 1,
        "Fl_Kp": settings.gain,
        "Fl_U": 0.0,
    }


def turbine_connects(turbine):
    """Return the rotor speed (rad/s) at which the torque law of a turbine begins."""
    return turbine.torque_law.cut_in_speed / turbine.drivetrain.gear_ratio


def individual_entries(turbine, control_dt):
    """Return the {name: value} of DISCON.IN that enable individual pitch control at 1P."""
    gain = BANDWIDTH * turbine.rated_rotor_speed / -root_slope(turbine).at_zero
    return {
        INDIVIDUAL: 1,
        "IPC_Vramp": tuple(fraction * turbine.rated_wind_speed for fraction in IPC_RAMP),
        "IPC_SatMode": 2,
        "IPC_IntSat": IPC_AMPLITUDE,
        "IPC_KP": (0.0, 0.0),
        "IPC_KI": (gain, 0.0),
        "IPC_aziOffset": (turbine.rated_rotor_speed * lead_time(turbine, control_dt), 0.0),
        "IPC_CornerFreqAct": 0.0,
    }


def _words(value):
    """Return the text of a value of the deck."""
    if isinstance(value, str | int):
        return str(value)
    return " ".join(str(v) if isinstance(v, int) else f"{v:.8g}" for v in np.atleast_1d(value).tolist())


def deck_text(values, title="ROSCO deck, written for one run"):
    """Return the text of DISCON.IN with a value and its name on each line, below the title."""
    lines = [f"{_words(value)}   ! {name} -" for name, value in values.items()]
    return "\n".join([*(f"! {line}" for line in title.splitlines()), *lines, ""])


def table_text(table):
    """Return the text of a Table in ROSCO's format."""
    lines = ["# Rotor performance", "#", "#", "# Pitch angle vector (deg)"]
    lines += [_words(table.blade_pitch / DEGREE), "# TSR vector", _words(table.ratio)]
    lines += ["# Wind speed vector", "0", ""]
    for name in ("cp", "ct", "cq"):
        rows = (" ".join(f"{value:.6f}" for value in row) for row in getattr(table, name))
        lines += [f"# {name}", "", *rows, "", ""]
    return "\n".join(lines)


def _made(turbine, control_dt, name, individual=False, **settings):
    """Return a Rosco with the turbine's DISCON.IN if any, otherwise with RoscoSettings."""
    chosen = RoscoSettings(**settings) if turbine.discon is None else Discon(turbine.discon, individual)
    return Rosco(chosen, control_dt, name, individual=individual)


def rosco(turbine, control_dt):
    """Run the ROSCO library with the turbine's DISCON.IN, or OC3 gains without floating feedback."""
    return _made(turbine, control_dt, "rosco")


def rosco_float(turbine, control_dt):
    """Run the ROSCO library with OC3 gains and floating feedback tuned on training cases; or as rosco."""
    return _made(turbine, control_dt, "rosco_float", mode=1, **tuned_for("rosco_float", turbine))


def rosco_ipc(turbine, control_dt):
    """Run the ROSCO library as rosco, with its individual pitch control at 1P."""
    return _made(turbine, control_dt, "rosco_ipc", individual=True)
