"""Runs random scenes and initial states over the valid range and checks that the state stays bounded.

A case is a dict with everything needed to repeat it (`fowt dev benchmark stability --replay FILE`).
"""

import json
from dataclasses import dataclass, field, replace
from math import cos, hypot, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np

from fowt_env.controllers import make
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.plant.advance import NON_FINITE, RUNNING, STOP_REASONS, observe, status_of
from fowt_env.plant.channels import measure
from fowt_env.plant.compile.decorators import entry, kernel
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.events import Counter
from fowt_env.plant.hydro.hydrostatics import submerged
from fowt_env.plant.integrators import build_integrator, rates, take_step
from fowt_env.plant.measurement import N_MEASUREMENTS, Measurement
from fowt_env.plant.mooring import mooring_load
from fowt_env.plant.state import N_RIGID, Command, State, pose_of
from fowt_env.run.simulation import hold
from fowt_env.scene.build import build_scene
from fowt_env.training.benchmarks.speed import silent
from fowt_env.training.evaluation.run_case import CONTROL_DT

DURATION = 30.0  # s of each case: three wave periods, one of platform pitch
WEATHER = 60.0  # s of random wind and sea
SEGMENT = 1.0  # s between changes of an open-loop command
PER_WEATHER = 50  # initial states in each weather
BENDS = " with a bending tower"  # suffix of a plant with flexible tower
PLANTS = ("standard",) * 44 + ("reference",) + ("fast",) * 5  # fidelity of each weather, in turn
KEYS = ("fidelity", "integrator", "dt", "duration", "wind", "sea", "seed", "state", "commands")

STEEPEST = 0.142  # height over length of a regular wave in deep water before it breaks (Michell)
FASTEST_TIP = 16.0  # tip-speed ratio above that of any free-spinning rotor
WIND_LOAD = 1.3  # upper bound of the thrust coefficient, for the work of the wind
HUB_TRAVEL = 180.0  # m, largest travel of the hub, over which the wind does work
FACTOR = 2.0  # safety factor of the energy bound: waves, wind and initial motion may combine
FINER = 4  # step reduction of the run that checks stops and largest peaks
QUADRATURE = np.polynomial.legendre.leggauss(40)  # of the energy of a line
AGREE = 0.1  # allowed relative difference of peak energies with a finer step


@kernel
def platform_energy(x, mass_matrix):
    """Return the kinetic energy (J) of the six platform motions, without the spin of the rotor."""
    total = 0.0
    for i in range(6):
        for j in range(6):
            total += 0.5 * x[State.VX + i] * mass_matrix[i, j] * x[State.VX + j]
    return total


@entry
def run_random_case(
    handle, x, u, act, parameters, memory, measurement, dx, commands, per_control, per_segment, last, dt, peak
):
    """Advance x by `last` steps of dt; return (status, steps done).

    Open loop if commands (k, 2) has rows, each applied for per_segment steps; else the control law act is
    called every per_control steps. peak (4,) gets the largest platform kinetic energy (J), roll or pitch
    (rad), distance from the origin (m) and rotor speed (rad/s).
    """
    model, data = model_of(handle), data_of(handle)
    for step in range(last):
        if commands.shape[0] > 0:
            if step % per_segment == 0:
                row = min(step // per_segment, commands.shape[0] - 1)
                u[Command.GENERATOR_TORQUE], u[Command.BLADE_PITCH] = commands[row, 0], commands[row, 1]
        elif step % per_control == 0:
            rates(step * dt, x, u, model, data, dx)
            measure(model, data, x, dx, u, step * dt, measurement)
            act(parameters, memory, measurement, u)
        take_step(step * dt, x, u, dt, model, model.integrator, data)
        status = status_of(x)
        if status != RUNNING:
            return status, step + 1
        peak[0] = max(peak[0], platform_energy(x, model.rigid_body.mass_matrix))
        peak[1] = max(peak[1], max(abs(x[State.ROLL]), abs(x[State.PLATFORM_PITCH])))
        peak[2] = max(peak[2], sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]))
        peak[3] = max(peak[3], abs(x[State.ROTOR_SPEED]))
    return RUNNING, last


@dataclass
class Outcome:
    """Holds the result of a case."""

    status: int
    time: float  # s reached
    peak: np.ndarray  # (4,) of run_random_case
    energy_bound: float  # J, of the platform's kinetic energy
    speed_bound: float  # rad/s, of the rotor
    unconverged: int  # mooring lines that missed their tolerance

    @property
    def failure(self):
        """Return the reason of a failure, or an empty text; a capsize is checked by a finer run."""
        if self.status == NON_FINITE:
            return STOP_REASONS[NON_FINITE]
        energy, speed = self.peak[0], self.peak[3]
        if not energy <= self.energy_bound:
            return f"kinetic energy {energy:.3g} J above the bound {self.energy_bound:.3g} J"
        if not speed <= self.speed_bound:
            return f"rotor speed {speed:.3g} rad/s above the bound {self.speed_bound:.3g} rad/s"
        return ""

    @property
    def text(self):
        """Return a text that describes the outcome."""
        ended = STOP_REASONS[self.status] if self.status != RUNNING else "ran to its end"
        energy, tilt, speed = self.peak[0], np.degrees(self.peak[1]), self.peak[3]
        peaks = f"kinetic energy {energy:.3g} J, tilt {tilt:.1f} deg, rotor {speed:.3g} rad/s at most"
        return self.failure or f"{ended}; {peaks}"


@kernel
def line_energy(H, V, length, weight, EA, node, quadrature):
    """Return elastic and gravity energy (J) of a frictionless line under fairlead tensions H and V."""
    lying = max(0.0, length - V / weight)
    start = V - weight * (length - lying)
    total = lying * H * H / (2.0 * EA)
    for i in range(node.shape[0]):
        hanging = (length - lying) * (node[i] + 1.0) / 2.0
        vertical = start + weight * hanging
        tension = hypot(H, vertical)
        height = (tension - hypot(H, start)) / weight
        height += (vertical * vertical - start * start) / (2.0 * EA * weight)
        total += quadrature[i] * (length - lying) / 2.0 * (tension * tension / (2.0 * EA) + weight * height)
    return total


@entry
def _potential_energy(handle, x, node, quadrature):
    model, data, pose = model_of(handle), data_of(handle), pose_of(x)
    body = model.rigid_body
    total = body.gravity * (body.mass * pose.z + body.s_x * pose.r31 + body.s_z * pose.r33)
    total -= buoyant_energy(pose, model.hydro, data)
    if model.mooring is not None:
        lines = model.mooring
        mooring_load(pose, lines, data.lines, data.counters)
        for i in range(lines.length.shape[0]):
            H, V = data.lines[i, 0], data.lines[i, 1]
            total += line_energy(H, V, lines.length[i], lines.weight[i], lines.EA[i], node, quadrature)
    return total


@kernel
def buoyant_energy(pose, hydro, data):
    """Return the work (J) of the still water on the hull, up to a constant."""
    if hydro is None:
        return 0.0
    volume, qx, qy, qz = submerged(pose, hydro.hull, data.counters)
    depth = volume * pose.z + qx * pose.r31 + qy * pose.r32 + qz * pose.r33
    return hydro.hull.specific_weight * depth


def potential_energy(handle, x):
    """Return the energy (J) of gravity, still-water buoyancy and moorings of a state, up to a constant."""
    return _potential_energy(handle, x, *QUADRATURE)


def weather_speeds(scene):
    """Return (fastest wind at the rotor, fastest water at the surface) of a scene, m/s (upper bounds)."""
    wind = water = 0.0
    aero, hydro = scene.model.aero, scene.model.hydro
    if aero is not None:
        value = np.abs(aero.wind.value)
        level = np.sqrt((value[:, :3] ** 2).sum(axis=1)) + 0.5 * value[:, 3:].sum(axis=1)
        wind = 1.1 * float(level.max()) + 10.0  # margins for shear over the rotor and motion of the hub
    waves = None if hydro is None else hydro.waves
    if waves is not None:
        rms = sqrt(0.5 * float(np.sum((waves.amplitude * waves.omega) ** 2)))
        largest = float(np.sum(waves.amplitude * waves.omega))
        water = min(largest, 4.5 * rms)  # 4.5 standard deviations of a Gaussian sea
    return wind, water


class Runner:
    """Runs cases in one scene, whose common parts are built once."""

    def __init__(self, scene, dt):
        self.scene, self.dt = scene, float(dt)
        self.data = scene.data()
        self.handle = scene.handle(self.data)
        self.rest = potential_energy(self.handle, np.zeros(scene.n_state))
        self.speeds = weather_speeds(scene)
        self.controller = make("pi", scene.turbine, CONTROL_DT) if scene.model.aero is not None else None
        self.dx, self.measurement = np.zeros(scene.n_state), np.zeros(N_MEASUREMENTS)

    def bounds(self, x):
        """Return bounds (J, rad/s) of platform kinetic energy and rotor speed for a run that starts at x.

        Energy: FACTOR times the sum of the kinetic energy at x, the potential energy above that of the
        upright platform, the kinetic energy of platform and added mass at the speed of the water, and the
        work of the thrust over HUB_TRAVEL. Rotor: its initial speed (plus 5 %) or FASTEST_TIP.
        """
        (wind, water), scene = self.speeds, self.scene
        body, radius = scene.model.rigid_body, scene.turbine.rotor.tip_radius
        thrust = WIND_LOAD * 0.5 * scene.platform.environment.air_density * pi * radius**2 * wind**2
        energy = platform_energy(x, body.mass_matrix)
        energy += max(0.0, potential_energy(self.handle, x) - self.rest)
        energy += body.mass * water**2 + thrust * HUB_TRAVEL
        return FACTOR * energy, max(1.05 * abs(x[State.ROTOR_SPEED]), FASTEST_TIP * wind / radius)

    def run(self, state, commands, duration):
        """Run a state (n,) under commands (k, 2), or under PI control if empty, and return the Outcome."""
        dt, handle, data = self.dt, self.handle, self.data
        x, commands = np.array(state, dtype=float), np.array(commands, dtype=float).reshape(-1, 2)
        u, peak, bounds = np.array([0.0, x[State.BLADE_PITCH]]), np.zeros(4), self.bounds(x)
        for carried in (data.lines, data.counters, data.cache, data.history, data.elastic):
            carried[:] = 0.0  # as in a new scene: results do not depend on earlier cases
        law = hold.compiled, np.zeros(1), np.zeros(1)
        if len(commands) == 0:
            observe(handle, x, u, 0.0, self.dx, self.measurement)
            self.controller.reset(Measurement(*self.measurement.tolist()))
            law = self.controller.law, self.controller.parameters, self.controller.memory
        status, steps = run_random_case(
            handle, x, u, *law, self.measurement, self.dx, commands, round(CONTROL_DT / dt),
            round(SEGMENT / dt), round(duration / dt), dt, peak,
        )  # fmt: skip
        unconverged = int(data.counters[Counter.MOORING_UNCONVERGED])
        return Outcome(int(status), steps * dt, peak, *bounds, unconverged)


def _uniform(low, high):
    return lambda rng: float(rng.uniform(low, high))


def _one_of(*options):
    return lambda rng: rng.choice(options).item()


GUST = {"speed": _uniform(1.0, 50.0), "start": _uniform(0.0, 15.0)}
SIGNED_GUST = GUST | {"sign": _one_of(1, -1)}
TURBULENCE_CLASS = _one_of("A", "B", "C")
WINDS = {  # kind: (probability, {key of its specification: draw}), in drawing order
    "steady": (0.3, {"speed": _uniform(0.0, 70.0), "vertical": _uniform(-5.0, 5.0)}),
    "ntm": (0.2, {"speed": _uniform(1.0, 60.0), "class": TURBULENCE_CLASS}),
    "etm": (0.15, {"speed": _uniform(1.0, 50.0), "class": TURBULENCE_CLASS}),
    "ewm": (0.1, {"turbine_class": _one_of("I", "II", "III"), "recurrence": _one_of(1, 50)}),
    "eog": (0.05, GUST),
    "ecd": (0.05, SIGNED_GUST),
    "edc": (0.05, SIGNED_GUST),
    "ews": (0.05, SIGNED_GUST | {"orientation": _one_of("vertical", "horizontal")}),
    "still": (0.05, {}),
}


def draw_wind(rng):
    """Draw a wind specification from still air to 70 m/s, from any direction."""
    kind = str(rng.choice(list(WINDS), p=[probability for probability, _ in WINDS.values()]))
    direction = float(rng.uniform(-180.0, 180.0))
    if kind == "still":
        return {"kind": "steady", "speed": 0.0}
    wind = {"kind": kind} | {key: draw(rng) for key, draw in WINDS[kind][1].items()}
    if "start" not in wind:  # gusts come from upwind
        wind["direction"] = direction
    return wind | {"turbulent": True} if kind == "ewm" else wind


def draw_sea(rng):
    """Draw a sea specification: up to Hs 17 m or a regular wave below breaking steepness, any heading."""
    heading = float(rng.uniform(-180.0, 180.0))
    kind = str(rng.choice(["jonswap", "pierson_moskowitz", "regular"], p=[0.6, 0.15, 0.25]))
    if kind == "regular":
        height = float(rng.uniform(0.0, 30.0))
        shortest = max(3.0, sqrt(2.0 * pi * height / (STEEPEST * 9.80665)))
        return {"kind": kind, "H": height, "T": shortest + float(rng.uniform(0.0, 12.0)), "heading": heading}
    height = float(rng.uniform(0.0, 17.0))
    shortest = max(3.0, 3.6 * sqrt(height))  # steeper irregular seas break
    period = shortest + float(rng.uniform(0.0, 12.0))
    sea = {"kind": kind, "Hs": height, "Tp": period, "heading": heading}
    if kind == "jonswap":
        sea["gamma"] = float(rng.uniform(1.0, 5.0))
    return sea


def draw_state(rng, turbine, tower=None):
    """Draw a state in the valid range, with a rigid or a flexible tower (TowerModes)."""
    modes, drive = 0 if tower is None else len(tower.slope), turbine.pitch_drive
    x = np.zeros(N_RIGID + 2 * modes)
    offset, bearing = rng.uniform(0.0, 30.0), rng.uniform(0.0, 2.0 * pi)
    x[:3] = offset * cos(bearing), offset * sin(bearing), rng.uniform(-8.0, 8.0)
    tilt, towards = radians(rng.uniform(0.0, 30.0)), rng.uniform(0.0, 2.0 * pi)
    x[3:6] = tilt * cos(towards), tilt * sin(towards), radians(rng.uniform(-30.0, 30.0))
    x[State.AZIMUTH] = rng.uniform(0.0, 2.0 * pi)
    x[7:13] = rng.uniform(-1.0, 1.0, 6) * [3.0, 3.0, 2.0, 0.05, 0.05, 0.1]
    stopped = rng.random() < 0.1
    x[State.ROTOR_SPEED] = 0.0 if stopped else rng.uniform(0.0, 1.5) * turbine.rated_rotor_speed
    x[State.BLADE_PITCH] = rng.uniform(drive.minimum, drive.maximum)
    x[N_RIGID : N_RIGID + modes] = rng.uniform(-1.0, 1.0, modes)
    x[N_RIGID + modes :] = rng.uniform(-2.0, 2.0, modes)
    return x


def draw_commands(rng, turbine, duration):
    """Draw commands (k, 2): none (PI control), one constant, or a new one every SEGMENT."""
    drive = turbine.pitch_drive
    count = (0, 1, round(duration / SEGMENT))[rng.integers(3)]
    torque = rng.uniform(0.0, turbine.torque_law.max_torque, count)
    return np.column_stack([torque, rng.uniform(drive.minimum, drive.maximum, count)])


def _case(scene, wind, sea, seed, state, commands, duration):
    """Return the dict with which a case can be repeated."""
    return {key: scene.options[key] for key in ("fidelity", "tower", "integrator")} | {
        "dt": scene.dt, "duration": duration, "wind": wind, "sea": sea, "seed": seed,
        "state": np.asarray(state, dtype=float).tolist(), "commands": np.asarray(commands).tolist(),
    }  # fmt: skip


def replay(case):
    """Run a case dict or its JSON file and return the Outcome. Raises: InputError if keys are missing."""
    if not isinstance(case, dict):
        path = Path(case)
        if not path.is_file():
            raise InputError(f"replay = {str(path)!r}: not found")
        try:
            case = json.loads(path.read_text())
        except json.JSONDecodeError as error:
            raise InputError(f"replay = {str(path)!r}: is not JSON: {error}") from None
        if not isinstance(case, dict):
            raise InputError(f"replay = {str(path)!r}: must hold one case, an object with {', '.join(KEYS)}")
    if missing := [key for key in KEYS if key not in case]:
        raise InputError(f"case: {', '.join(missing)} missing; needs {', '.join(KEYS)}")
    scene = build_scene(
        **{key: case[key] for key in ("wind", "sea", "seed", "fidelity", "integrator")},
        tower=case.get("tower", "rigid"), duration=WEATHER,
    )  # fmt: skip
    return Runner(scene, case["dt"]).run(case["state"], case["commands"], case["duration"])


def with_integrator(scene, name, rotor_samples=1):
    """Return the scene with another integrator; rotor_samples: rotor loads per step of ab4."""
    changed = scene.with_model(integrator=build_integrator(name, rotor_samples))
    return replace(changed, options=scene.options | {"integrator": name})


def finer(scene, case):
    """Run a case of a scene with Runge-Kutta 4 and its step divided by FINER; return the Outcome."""
    runner = Runner(with_integrator(scene, "rk4"), case["dt"] / FINER)
    return runner.run(case["state"], case["commands"], case["duration"])


@dataclass
class Tally:
    """Holds the results of a batch of random cases."""

    cases: int = 0
    weathers: int = 0
    failures: list = field(default_factory=list)  # (case dict, reason)
    capsizes: int = 0  # confirmed by a finer step
    unconverged: int = 0
    worst_ratio: float = 0.0  # largest peak of energy over its bound
    peak: np.ndarray = field(default_factory=lambda: np.zeros(4))
    checked: int = 0  # most energetic cases compared with a finer step
    difference: float = 0.0  # largest relative difference of their peak energies
    per_plant: dict = field(default_factory=dict)


def random_cases(count, seed=0, per_weather=PER_WEATHER, duration=DURATION, plants=PLANTS, progress=silent):
    """Run count random cases, per_weather states in each weather, reproducible by seed; return the Tally.

    Every capsize, and the most energetic case of every twentieth weather, is repeated with Runge-Kutta 4 at
    a quarter of the step. A capsize that the finer run does not have, or a peak energy that differs by
    more than AGREE, is a failure. progress: called with (text, done, total).
    """
    sequence, tally, bases = np.random.SeedSequence(seed), Tally(), {}
    while tally.cases < count:
        rng = np.random.default_rng(sequence.spawn(1)[0])
        number = min(per_weather, count - tally.cases)
        _one_weather(tally, bases, plants[tally.weathers % len(plants)], rng, number, duration)
        tally.weathers += 1
        progress(f"random cases, {len(tally.failures)} failures", tally.cases, count)
    return tally


def _one_weather(tally, bases, plant, rng, number, duration):
    """Run a number of cases in one weather drawn from rng and add them to the tally."""
    wind, sea, seed = draw_wind(rng), draw_sea(rng), int(rng.integers(2**31))
    tally.per_plant[plant] = tally.per_plant.get(plant, 0) + number
    tally.cases += number
    try:
        if plant not in bases:
            fidelity = plant.removesuffix(BENDS)
            options = {"fidelity": fidelity, "tower": "rigid" if fidelity == plant else "modes"}
            bases[plant] = build_scene(wind=wind, sea=sea, seed=seed, duration=WEATHER, **options)
        scene = bases[plant].with_weather(wind, sea, seed)
        runner = Runner(scene, scene.dt)
    except Exception as error:  # any exception is a failure of the case
        case = {"fidelity": plant, "wind": wind, "sea": sea, "seed": seed}
        tally.failures.append((case, f"exception: {error!r}"))
        return
    hardest = None
    for _ in range(number):
        state = draw_state(rng, scene.turbine, scene.model.tower)
        commands = draw_commands(rng, scene.turbine, duration)
        case = _case(scene, wind, sea, seed, state, commands, duration)
        try:
            outcome = runner.run(state, commands, duration)
        except Exception as error:
            tally.failures.append((case, f"exception: {error!r}"))
            continue
        tally.unconverged += outcome.unconverged
        if outcome.failure:
            tally.failures.append((case, outcome.failure))
        elif outcome.status == RUNNING:
            tally.worst_ratio = max(tally.worst_ratio, outcome.peak[0] / outcome.energy_bound)
            np.maximum(tally.peak, outcome.peak, out=tally.peak)
        elif finer(scene, case).status == outcome.status:
            tally.capsizes += 1
        else:
            tally.failures.append((case, f"{STOP_REASONS[outcome.status]}, but not at a finer step"))
        if outcome.status == RUNNING and (hardest is None or outcome.peak[0] > hardest[1].peak[0]):
            hardest = (case, outcome)
    if tally.weathers % 20 == 0 and hardest is not None:
        case, outcome = hardest
        fine = finer(scene, case).peak[0]
        change = abs(fine - outcome.peak[0]) / fine
        tally.checked += 1
        tally.difference = max(tally.difference, change)
        if not change <= AGREE:
            tally.failures.append((case, f"peak energy differs by {change:.1%} from a finer step's"))


def store_case(failures, folder):
    """Write each (case, reason) as a JSON file for replay; return the paths."""
    paths = [Path(folder) / f"case_{number:04d}.json" for number in range(len(failures))]
    for path, (case, reason) in zip(paths, failures, strict=True):
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(case | {"reason": reason}, indent=1) + "\n")
    return paths
