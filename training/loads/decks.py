"""Writes what is needed to verify the runs that drive a load table in OpenFAST: series, wind, sea, decks.

    driving/<number>_<name>_seed<n>_<controller>/
        run.outb       the series here, as an output of OpenFAST
        wind.bts       the box of wind of this run, or wind.wnd
        waves.Elev     elevation of the sea at the origin (WaveMod 5)
        model.fst      with --deck: the user's deck with this wind, sea, current, length, initial state and
                       place of the accelerometer, parked or with ROSCO as in the run; its other files are
                       those of the deck, by relative paths
        DISCON.IN, rotor.txt   of ROSCO, which ServoDyn then loads from the installed wheel
        README.md      case, factor, what the deck lacks of the case (events, controller, sensors)

Only files of the deck that change are copied: .fst, ElastoDyn, InflowWind, SeaState (before OpenFAST 4:
HydroDyn), ServoDyn.
"""

import os
import re
from dataclasses import replace
from math import ceil
from pathlib import Path

import numpy as np

import fowt_env
from fowt_env.controllers import make
from fowt_env.controllers.bladed.controller import SYMBOL
from fowt_env.controllers.rosco import INPUT_FILE, Rosco, find_library
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.files.openfast_deck.deck import PARTS
from fowt_env.files.openfast_deck.parser import PartFile, locate, same_key
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.metrics import TIME
from fowt_env.training.evaluation.run_case import CONTROL_DT, Run, scored
from fowt_env.training.evaluation.wind_boxes import new_box
from fowt_env.training.loads.tables import DRIVING, driving_runs
from fowt_env.weather.turbsim import write_bts
from fowt_env.weather.wind_field import MARGIN, WindBox, is_field

BOX, UNIFORM, WAVES = "wind.bts", "wind.wnd", "waves"
WAVE_STEP = 0.2  # s, of the elevation
SPARE = 60.0  # s of waves beyond the run
SPARE_REACH = 10.0  # m of wind beyond the blades: motions in OpenFAST differ, and blades bend
TRIED = 12  # numbers of columns of which the best is added to a box of wind
INITIAL = (  # keys of ElastoDyn and channels of the first row
    *((name, f"{name}_[m]") for name in ("PtfmSurge", "PtfmSway", "PtfmHeave")),
    *((name, f"{name}_[deg]") for name in ("PtfmRoll", "PtfmPitch", "PtfmYaw")),
    ("RotSpeed", "RotSpeed_[rpm]"), ("Azimuth", "Azimuth_[deg]"),
    *((f"BlPitch({i})", "BldPitch1_[deg]") for i in (1, 2, 3)),
)  # fmt: skip
SEVENTH = 1.0 / 7.0  # exponent of the sub-surface current of SeaState
NEVER = 9999.9  # s
FILES = re.compile(r"(?i).*(File|FileName|RootName|Root)\w*(\(\d\))?$")  # keys whose value names a file


class EditedPart:
    """Edits an input file of OpenFAST by keys, and keeps comments and order."""

    def __init__(self, path, kind):
        """Read a file. Raises: InputError if it cannot be read."""
        self.file = PartFile(path, kind)
        self.lines = Path(path).read_text(encoding="latin-1").splitlines()

    def has(self, key):
        """Return whether the file has a key."""
        return same_key(key) in self.file.entries

    def put(self, value, *keys):
        """Set the value of the first of the keys that the file has. Raises: InputError if it has none."""
        key = next((key for key in keys if self.has(key)), None)
        if key is None:
            raise self.file.refusal(f"{keys[0]} is missing: there must be a line 'value  {keys[0]}'")
        name, line, words = self.file.entries[same_key(key)]
        text = self.lines[line]
        # the value is what stands before the key; several words are one value, as a list of numbers
        at = re.search(rf"(?<![\w]){re.escape(name)}(?!\w)", text[len(words[0]) :]).start() + len(words[0])
        self.lines[line] = f"{value}    {text[at:]}"

    def rebase(self, folder):
        """Point relative names of existing files from another folder to the same files."""
        for key, (name, _, words) in list(self.file.entries.items()):
            word = words[0].lstrip("@").strip("\"'")
            if not FILES.match(name) or not word or word.lower() in ("none", "unused", "default"):
                continue
            found = locate(word, (self.file.path.parent,))
            root = self.file.path.parent / word.replace("\\", "/")  # of several files, as of WAMIT
            if found is None and not list(root.parent.glob(f"{root.name}.*")):
                continue
            target = root if found is None else found
            self.put(f'"{Path(os.path.relpath(target, folder)).as_posix()}"', key)

    def write(self, path):
        """Write the file atomically."""
        with replacing(path) as temporary:
            temporary.write_text("\n".join(self.lines) + "\n", encoding="latin-1")


def covering(box, duration):
    """Return the velocities of a WindBox for a run of a duration, s, in a file that is not periodic.

    InflowWind starts such a file half its width upstream, as boxes here, but a periodic one at the hub.
    """
    count = len(box.velocity)
    if box.periodic:
        count = max(count, ceil((duration + box.shift + MARGIN / box.speed) / box.dt) + 2)
    return box.velocity[np.arange(count) % len(box.velocity)]


def reach_of(frame, scene):
    """Return how far, m, blades come to the sides of the tower's foot and above the still water in a run."""
    radius, hub = scene.turbine.rotor.tip_radius, scene.turbine.rotor.hub_height
    roll = np.sin(np.radians(frame["PtfmRoll_[deg]"]))
    side = np.abs(frame["PtfmSway_[m]"] - hub * roll).max() + radius
    return side + SPARE_REACH, hub + radius + max(frame["PtfmHeave_[m]"].max(), 0.0) + SPARE_REACH


def widened(box, velocity, side, top):
    """Return (velocity, y, z) of a WindBox out to `side` and up to `top`, m, by copies of its edges.

    This package continues a box by its edge, InflowWind stops there. InflowWind starts a file half its width
    upstream: columns are added in a number that makes the wind earlier by whole slices, to a fraction of one,
    and as many slices are put in front.
    """
    step, rise = box.y[1] - box.y[0], box.z[1] - box.z[0]
    least = max(ceil((side - box.y[-1]) / step), 0)
    slices = step * np.arange(least, least + TRIED) / (box.speed * box.dt)
    added = least + int(np.argmin(np.abs(slices - np.rint(slices)))) if least else 0
    early = round(step * added / (box.speed * box.dt))
    above = max(ceil((top - box.z[-1]) / rise), 0)
    before = velocity[np.arange(-early, 0) % len(box.velocity) if box.periodic else np.zeros(early, int)]
    velocity = np.pad(
        np.concatenate([before, velocity]), ((0, 0), (0, above), (added, added), (0, 0)), mode="edge"
    )
    more = step * np.arange(1, added + 1)
    y = np.concatenate([box.y[0] - more[::-1], box.y, box.y[-1] + more])
    return velocity, y, np.concatenate([box.z, box.z[-1] + rise * np.arange(1, above + 1)])


def write_wind(folder, scene, frame):
    """Write the wind of a Scene for InflowWind; return (WindType, name of the file), (None, None) without.

    frame: the run, whose motion a box of wind is to cover.
    Linear shears act on the component along x here, and along the wind in InflowWind: the same but for the
    square of the direction.
    """
    hub, wind = scene.turbine.rotor.hub_height, scene.wind
    if isinstance(wind, WindBox):
        velocity = covering(wind, scene.options["duration"])
        velocity, y, z = widened(wind, velocity, *reach_of(frame, scene))
        with replacing(folder / BOX) as temporary:
            write_bts(temporary, velocity, y, z, wind.dt, wind.speed, hub, periodic=False)
        return 3, BOX
    if scene.model.aero is None:
        return None, None
    series = scene.model.aero.wind
    u, v, w, vertical, horizontal = series.value.T
    speed = np.hypot(u, v)
    scale = 1.0 / np.where(speed > 0.0, speed, 1.0)
    # of InflowWind: direction clockwise seen from above, shears in winds per reference length
    columns = (
        series.time, speed, -np.degrees(np.arctan2(v, u)), w, horizontal * scale,
        np.full_like(speed, series.shear_exponent), vertical * scale, np.zeros_like(speed),
    )  # fmt: skip
    rows = np.stack(columns, axis=1)
    head = "! time (s), speed (m/s), direction (deg), vertical (m/s), horizontal shear, exponent, shear, gust"
    with replacing(folder / UNIFORM) as temporary:
        np.savetxt(temporary, rows, fmt="%.8g", header=head, comments="")
    return 2, UNIFORM


def write_waves(folder, scene, frame):
    """Write the elevation of a run for WaveMod 5; return the analysis time (s) that OpenFAST needs.

    Beyond the run the sea goes on and then fades: at depth SeaState's waves at an instant depend on the
    elevation of the seconds before and after. The record has no mean, which SeaState would take away.
    """
    time, elevation = frame[TIME].to_numpy(), frame["Wave1Elev_[m]"].to_numpy()
    end = WAVE_STEP * np.ceil((time[-1] + SPARE) / WAVE_STEP)
    grid = WAVE_STEP * np.arange(round(end / WAVE_STEP) + 1)
    values = np.interp(grid, time, elevation)
    late, hydro = grid > time[-1], scene.model.hydro
    waves = None if hydro is None else hydro.waves
    values[late] = 0.0
    if waves is not None:
        values[late] = np.cos(waves.phase - np.outer(grid[late], waves.omega)) @ waves.amplitude
    fading = np.clip(2.0 * (grid - end) / SPARE + 1.0, 0.0, 1.0)  # in the second half of the spare time
    values *= 1.0 - fading
    smooth = np.sin(np.pi * fading) ** 2
    values -= smooth * values[:-1].sum() / smooth.sum()
    with replacing(folder / f"{WAVES}.Elev") as temporary:
        np.savetxt(
            temporary, np.stack([grid, values], axis=1), fmt="%.4f %.8g",
            header="Time (s)  elevation at the origin (m)", comments="",
        )  # fmt: skip
    return float(end)


def put_current(sea, current):
    """Set the current of a run, an option of build_scene or None, in an EditedPart of SeaState."""
    spec = {} if current is None else current
    speed, heading = (float(spec.get(key, 0.0)) for key in ("speed", "heading"))
    uniform = float(spec.get("exponent", 0.0)) == 0.0
    sea.put(1 if speed else 0, "CurrMod")
    if speed:
        for keys, value in ((("CurrDIV", "CurrDIDir"), speed * uniform),
                            (("CurrSSV0", "CurrSSDir"), speed * (not uniform))):  # fmt: skip
            sea.put(f"{value:.8g}", keys[0])
            sea.put(f"{heading:.8g}", keys[1])
        sea.put(0, "CurrNSV0")


def put_control(servo, folder, case, first, rosco, scene):
    """Set a parked turbine, or ROSCO, in an EditedPart of ServoDyn; the rest is the deck's.

    first: first row of the run; rosco: the Rosco of the run or None.
    """
    if case.case.parked:  # as without grid: no torque, blades that stay, a rotor free to turn
        for key, value in (("PCMode", 0), ("VSContrl", 0), ("GenTiStr", True), ("TimGenOn", NEVER)):
            servo.put(value, key)
        for i in (1, 2, 3):
            if servo.has(f"PitNeut({i})"):
                servo.put(f"{first['BldPitch1_[deg]']:.8g}", f"PitNeut({i})")
    elif rosco is not None:
        for name, text in rosco.inputs(scene).items():
            with replacing(folder / name) as temporary:
                temporary.write_text(text, encoding="utf-8")
        # DLL_DT: at every step. OpenFAST extrapolates what a library reads; at longer intervals accelerations
        # are biased, and floating feedback with them.
        for key, value in (("PCMode", 5), ("VSContrl", 5), ("DLL_FileName", f'"{find_library()[0]}"'),
                           ("DLL_InFile", f'"{INPUT_FILE}"'), ("DLL_ProcName", f'"{SYMBOL}"'),
                           ("DLL_DT", '"default"')):  # fmt: skip
            servo.put(value, key)


def write_deck(folder, deck, case, scene, frame, wind, wave_time, rosco=None):
    """Write the user's deck for a run into a folder; return the path of model.fst.

    deck: path of the .fst; case: LoadCase; frame: its run; wind: of write_wind; wave_time: of write_waves;
    rosco: the Rosco of the run; None: the deck's controller stays.
    Raises: InputError naming file and key if the deck lacks a key that must change.
    """
    folder, deck = Path(folder).resolve(), Path(deck)
    main = EditedPart(deck, "OpenFAST")
    parts = {}
    kinds = (("elastodyn", "ElastoDyn"), ("inflow", "InflowWind"), ("seastate", "SeaState"))
    if case.case.parked or rosco is not None:
        kinds += (("servodyn", "ServoDyn"),)
    for name, kind in kinds:
        key = next((key for key in (PARTS[name][0], f"{PARTS[name][0]}(1)") if main.has(key)), None)
        path = None if key is None else main.file.other(key, folders=())
        if path is None and name == "seastate":  # before OpenFAST 4 the sea is HydroDyn's
            name, kind, key = "hydrodyn", "HydroDyn", PARTS["hydrodyn"][0]
            path = main.file.other(key)
        if path is None:
            raise main.file.refusal(f"names no file of {kind}, which must change with the case")
        parts[name] = (key, EditedPart(path, kind))
    main.rebase(folder)
    for key, part in parts.values():
        part.rebase(folder)
        main.put(f'"{part.file.path.name}"', key)
    main.put(f"{case.duration:.10g}", "TMax")
    kind, wind_file = wind
    main.put(0 if kind is None else 1, "CompInflow")
    elastodyn, inflow = parts["elastodyn"][1], parts["inflow"][1]
    sea = parts.get("seastate", parts.get("hydrodyn"))[1]
    first = frame.iloc[0]
    for key, channel in INITIAL:
        own = channel if not key.startswith("BlPitch") else f"BldPitch{key[-2]}_[deg]"
        elastodyn.put(f"{first[own if own in frame else channel]:.8g}", key)
    for key in ("NcIMUxn", "NcIMUyn", "NcIMUzn"):  # accelerometer of the run: at the yaw bearing
        if elastodyn.has(key):
            elastodyn.put(0.0, key)
    if case.case.parked:
        elastodyn.put(True, "GenDOF")
    if "servodyn" in parts:
        put_control(parts["servodyn"][1], folder, case, first, rosco, scene)
    if kind is not None:
        inflow.put(kind, "WindType")
        inflow.put(0, "PropagationDir")
    if kind == 3:
        inflow.put(f'"{wind_file}"', "FileName_BTS", "FileName", "Filename")
    if kind == 2:
        rotor = scene.turbine.rotor
        inflow.put(f'"{wind_file}"', "Filename_Uni", "FileName_Uni", "Filename")
        inflow.put(f"{scene.model.aero.wind.reference_height:.8g}", "RefHt_Uni", "RefHt")
        inflow.put(f"{2.0 * rotor.tip_radius:.8g}", "RefLength")
    sea.put(5, "WaveMod")
    sea.put(f"{wave_time:.10g}", "WaveTMax")
    sea.put(WAVE_STEP, "WaveDT")
    sea.put(f"{case.wave_direction:.8g}", "WaveDir")
    sea.put(f'"{WAVES}"', "WvKinFile")
    put_current(sea, case.case.options.get("current"))
    for key, value in (("WvLowCOff", 0.0), ("WvHiCOff", np.pi / WAVE_STEP)):  # the record has its own
        if sea.has(key):
            sea.put(f"{value:.8g}", key)
    for _, part in parts.values():
        part.write(folder / part.file.path.name)
    main.write(folder / "model.fst")
    return folder / "model.fst"


def write_driving(folder, results, controllers, deck=None, count=DRIVING, progress=None):
    """Run the driving cases of LoadTables again and write them below folder/driving; return their folders.

    controllers  {label: name or object}
    deck         path of an .fst of this platform, None: no decks
    progress     called as progress(done, total, text)
    Raises: InputError for a run whose extremes differ from those of the table, i.e. of another version.
    """
    say = progress or (lambda done, total, text: None)
    statistics = {case.key: each for case, each in results.runs}
    chosen, folders = driving_runs(results, count), []
    for number, case in enumerate(chosen, 1):
        say(number - 1, len(chosen), f"{case.name}, seed {case.seed}, {case.controller}")
        place = Path(folder) / "driving" / f"{number:02d}_{case.name}_seed{case.seed}_{case.controller}"
        place.mkdir(parents=True, exist_ok=True)
        scene, frame = rerun(case, controllers.get(case.controller))
        _check_same(case, frame, statistics[case.key])
        write_table(frame, place / "run.outb")
        wind = write_wind(place, scene, frame)
        wave_time = write_waves(place, scene, frame)
        rosco = None if deck is None else rosco_of(controllers.get(case.controller), scene)
        if deck is not None:
            write_deck(place, deck, case, scene, frame, wind, wave_time, rosco)
        _write_readme(place, case, deck, rosco is not None)
        folders.append(place)
    return folders


def rosco_of(controller, scene):
    """Return the Rosco of a name or object that is one, else None."""
    made = None if controller is None else make(controller, scene.turbine, CONTROL_DT)
    inner = getattr(made, "controller", None)
    return inner if isinstance(inner, Rosco) else None


def rerun(case, controller):
    """Return (Scene, DataFrame) of the run of a LoadCase. controller: name or object, None: parked."""
    boxed, options = case.case, {"duration": case.duration, **case.case.options}
    wind = boxed.wind
    if is_field(wind) and not isinstance(wind, WindBox):
        wind = new_box(wind, boxed.platform, case.seed, options)
    boxed = replace(boxed, wind=wind, options=options)
    weather = {"wind": wind, "sea": boxed.sea, "seed": case.seed, **options}
    scene = fowt_env.build_scene(boxed.platform, **weather)
    run = Run(case.controller, controller, boxed, case.seed, case.duration, case.skip, {}, None)
    row, frame = scored(run, lambda frame, case, nominal, skip: {})
    if frame is None:
        raise InputError(f"run {case.name}, seed {case.seed}: has no series: {row['reason']}")
    return scene, frame


def _check_same(case, frame, statistics):
    """Compare the extremes of a run with its statistics. Raises: InputError if they differ."""
    counted = frame[frame[TIME] >= statistics.start - 1e-9]
    for column in ("PtfmPitch_[deg]", "RotSpeed_[rpm]", "TwrBsMyt_[kN-m]"):
        for side in ("min", "max"):
            here, there = float(getattr(counted[column], side)()), statistics.value(column, side)
            if abs(here - there) > 1e-6 * max(abs(there), 1.0):
                raise InputError(
                    f"run {case.name}, seed {case.seed}: {side} of {column} is {here:g} and was {there:g} in"
                    " the table: it was made by other sources or on another machine; run the table again"
                )


def _write_readme(folder, case, deck, rosco):
    """Write README.md of a driving case; rosco: whether the deck has the ROSCO of the run."""
    events = []
    if case.case.fault is not None:
        keys = case.case.fault.model_dump(exclude_none=True, exclude_defaults=True)
        events.append("event: " + ", ".join(f"{key} {value}" for key, value in keys.items()))
    if not case.case.parked and case.case.sensors != "exact":
        events.append(f"sensors: {case.case.sensors}; `--sensors exact` has those of OpenFAST")
    current = case.case.options.get("current")
    if current and current.get("exponent", 0.0) not in (0.0, SEVENTH):
        events.append(f"exponent {current['exponent']:g} of the current: SeaState has 1/7")
    if not (case.case.parked or rosco):
        events.append(f"controller: the library of `fowt connect export {case.controller} --dll lib.so`")
    lines = [
        f"# DLC {case.dlc}: {case.description}",
        "",
        f"- condition {case.name}, seed {case.seed}, controller {case.controller}",
        f"- wind {case.wind_speed} m/s, Hs {case.Hs:g} m, Tp {case.Tp:g} s, waves towards"
        f" {case.wave_direction:g} deg, yaw error {case.yaw_error:g} deg",
        f"- {case.duration:g} s, statistics from {case.skip:g} s; partial factor {case.factor:g}",
        f"- not in the deck, to be set by hand: {'; '.join(events) or 'nothing'}",
    ]
    if deck is not None:
        control = ", parked turbine" if case.case.parked else ", ROSCO" if rosco else ""
        lines.append(
            f"- model.fst: wind, sea, current, length, initial state, place of the accelerometer{control} are"
            " those of the run, all else is the deck's"
        )
    with replacing(folder / "README.md") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
