"""Turbines with elastic parts, their twins of particles, and what both say of random states in wild motion.

For plain Python, in a process with NUMBA_DISABLE_JIT=1: a compiled kind of scene takes minutes, and there are
dozens. The air's load of every station is drawn, and put in place of that of a rotor model.
"""

from functools import cache
from types import SimpleNamespace

import numpy as np
from naive import flexible_turbine
from naive.bent_stations import air_of, air_of_row
from plant_helpers import leaning, random_state

from fowt_env import Load, build_scene, load_kernel
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.advance import forget, output
from fowt_env.plant.aero import bem_rotor, blade_sweep
from fowt_env.plant.aero.bent_blade import CHANGE, LANES, N_STATION_LOAD, BentShape, placed
from fowt_env.plant.aero.blade_shape import StationLoad, effective_pitch
from fowt_env.plant.state import BLADES, N_BLADE_LOAD, State
from fowt_env.plant.user_loads import Force, Motion
from fowt_env.scene.beam import outer_part, shape_values
from fowt_env.scene.blade_beam import MODES, SECTIONS, blade_beam, blade_nodes
from fowt_env.scene.tower import mode_shapes

BENDING = TOWERS = ("rigid", "modes", "modes2")  # options
TORQUE = 3e4  # N m, of the generator
WIND, SHEAR, DENSITY = 11.0, 0.14, 1.2  # m/s, -, kg/m3
ALOFT, BELOW = np.array([3.0, -2.0, 91.0]), np.array([4.0, 3.0, -30.0])  # m, points of two loads
FORCES = np.array([[3e5, -2e5, 1e5, 2e6, -1e6, 3e6], [-5e5, 4e5, 8e4, 1e7, 2e7, -3e6]])  # N and N m there

PINS = np.array([[0.0, 0.0, -30.0], [4.0, 9.0, 2.0]])  # m, points that springs hold
SPRING = 4e6  # N/m


@load_kernel
def constant_load(parameters, motion, force):
    for i in range(6):
        force[i] = parameters[i]


CONSTANT = [
    Load(name, constant_load, point=point, parameters=force, axes="body")
    for name, point, force in zip(("aloft", "below"), (ALOFT, BELOW), FORCES, strict=True)
]


@load_kernel
def spring(parameters, motion, force):
    """A spring to an inertial point, the same in every direction."""
    for i in range(3):
        force[Force.FX + i] = parameters[0] * (parameters[1 + i] - motion[Motion.X + i])


SPRINGS = [
    Load(name, spring, point=pin, parameters=(SPRING, *pin))
    for name, pin in zip(("one", "other"), PINS, strict=True)
]


@cache
def descriptions(name):
    """(platform, turbine) with tilt, cone, prebend and sweep, and centres of mass beside the plane."""
    platform = read_platform(name)
    turbine = read_turbine(platform.turbine)
    if turbine.rotor.cone == 0.0:
        platform, turbine = leaning(platform, turbine)
        turbine = turbine.model_copy(update={"rotor": turbine.rotor.model_copy(update={"cone": 0.05})})
    outside = np.asarray(turbine.blade.radius) - turbine.rotor.hub_radius
    prebend = -3e-4 * outside**2 if turbine.blade.prebend is None else turbine.blade.prebend
    blade = turbine.blade.model_copy(update={"sweep": 1e-4 * outside**2, "prebend": prebend})
    nacelle = turbine.nacelle.model_copy(update={"cm_left": 0.7})
    return platform, turbine.model_copy(update={"blade": blade, "nacelle": nacelle})


def tower_particles(platform, option, modes):
    """flexible_turbine.Beam of a tower: ElastoDyn's elements and the mass at its top; None: rigid.

    modes: the plant's TowerModes, for stiffness and damping.
    """
    count = TOWERS.index(option)
    if count == 0:
        return None
    tower = platform.tower
    bending, height = tower.modes, tower.top_height - tower.base_height
    shapes, fore_aft = mode_shapes(bending, count)
    at, n = np.append(bending.middles(), 1.0), 2 * count
    values, slopes = (shape_values(shapes, at, k).T / height**k for k in range(2))
    U, slope = np.zeros((n, 2, len(at))), np.zeros((n, 2, len(at)))
    for i in range(n):
        axis = 0 if fore_aft[i] else 1
        U[i, axis], slope[i, axis] = values[i], slopes[i]
    cell, S, sunk = height / bending.elements, np.zeros((n, n, len(at))), np.zeros((n, n))
    for k in range(len(at)):
        half = 0.5 * cell * slope[:, :, k] @ slope[:, :, k].T if k < len(at) - 1 else 0.0
        S[:, :, k] = sunk + half
        sunk = sunk + 2.0 * half
    mass = np.append(cell * np.interp(bending.middles(), bending.height_fraction, bending.mass_density), 0.0)
    mass[-1] = bending.top_mass
    return flexible_turbine.Beam(
        tower.base_height + height * at, mass, U, slope, S, modes.beam.stiffness, modes.beam.damping
    )


def blade_particles(nodes, beam):
    """flexible_turbine.Beam of BeamNodes, with the structure of a plant's Beam."""
    U, slope, S = nodes.shapes
    return flexible_turbine.Beam(nodes.z, nodes.mass, U, slope, S, beam.stiffness, beam.damping)


def acting(twin):
    """CONSTANT, as forces on a twin: the one aloft, the one below."""
    places = zip((twin.on_nacelle, twin.on_platform), (ALOFT, BELOW), FORCES, strict=True)
    return [(carry, point, force[:3], force[3:]) for carry, point, force in places]


class Case:
    """A kind of scene and its twin; fixed: "platform" or "rotor"."""

    def __init__(self, name, blades, tower, shaft="rigid", fixed=(), wind=True, loads=CONSTANT, **options):
        self.platform, self.turbine = descriptions(name)
        if wind:
            wind = {"kind": "steady", "speed": WIND, "shear_exponent": SHEAR}
            options |= {"wind": wind, "rotor": "bem", "blade_stations": None, "tower_drag": False}
        self.scene = build_scene(
            self.platform, turbine=self.turbine, blades=blades, tower=tower, shaft=shaft, hydrodynamics=False,
            mooring=False, pitch="individual", loads=loads, **{"fidelity": "reference"} | options,
        )  # fmt: skip
        for part in fixed:
            self.scene = self.scene.with_model({f"rigid_body.{part}_fixed": True})
        self.fixed, self.n = fixed, len(MODES[blades])
        self.blocks = {block.name: block.offset for block in self.scene.blocks}
        self.beam, torsion = None, self.turbine.shaft_torsion
        if self.n:
            nodes, rotor = blade_nodes(self.turbine, MODES[blades]), self.turbine.rotor
            self.beam = blade_particles(nodes, blade_beam(self.turbine, blades))
            span = rotor.tip_radius - rotor.hub_radius
            self.stations = [rotor.hub_radius + part * span for part in SECTIONS]
            self.outer = [blade_particles(outer_part(nodes, z), self.beam) for z in self.stations]
        self.shaft = None if shaft == "rigid" else (torsion.stiffness, torsion.damping)
        self.tower = tower_particles(self.platform, tower, self.scene.model.tower)
        self.channels = {channel.name: i for i, channel in enumerate(self.scene.channels)}

    def random(self, rng):
        """A state in wild motion: blades bend by some 5 % of their length, the tower by 1 %."""
        x = random_state(rng, self.scene.n_state, tilt=0.12, speed=3.0, turning=0.3)
        blade = {0: [], 2: [4.0, 2.0], 3: [4.0, 1.0, 2.0]}[self.n]
        for (q, v), sizes in (
            (self.states_of("tower"), [1.0, 1.0, 0.01, 0.01]),
            (self.states_of("blade"), blade * BLADES),
            (self.states_of("shaft"), [0.01]),
        ):
            for i, size in enumerate(sizes[: v - q]):
                x[q + i], x[v + i] = size * rng.normal(), 2.0 * size * rng.normal()
        pitches = self.blocks["other_blade_pitches"]
        x[pitches : pitches + 2] = rng.uniform(0.0, 0.4, 2)
        return x

    def states_of(self, part):
        """(index of the first deflection, of the first rate) of "tower", "blade" or "shaft"; 0, 0: rigid."""
        names = ("shaft_twist", "shaft_twist_rate") if part == "shaft" else ("deflection", "velocity")
        return tuple(self.blocks.get(name if part == "shaft" else f"{part}_{name}", 0) for name in names)

    def at(self, x):
        """What the twin says of a state without its loads."""
        pitches = np.r_[x[State.BLADE_PITCH], x[self.blocks["other_blade_pitches"] :][:2]]
        twin = flexible_turbine.Turbine(
            self.platform, self.turbine, self.tower, self.beam, self.shaft, pitches
        )
        q, v = (x[at:][: BLADES * self.n].reshape(BLADES, self.n) for at in self.states_of("blade"))
        return SimpleNamespace(twin=twin, path=twin.path(x, self.blocks), pitches=pitches, q=q, v=v)

    def air(self, now, found, outer=None):
        """Air of each blade: of the drawn loads of its stations, of a rigid one as the plant adds them."""
        e, rotor = self.scene.model.aero.rotor.elements, self.turbine.rotor
        if self.n == 0:
            return [air_of_row(*pair, rotor.cone) for pair in zip(found.blades, now.pitches, strict=True)]
        return [
            air_of(found.drawn[b], now.q[b], now.pitches[b], e.shape, e.modes, outer) for b in range(BLADES)
        ]

    def evaluate(self, x, rng):
        """What the plant says of a state under drawn loads of the stations, with a drawn added mass."""
        scene, data, count = self.scene, self.scene.data(), len(self.scene.model.aero.rotor.elements.radius)
        drawn, winds = rng.normal(size=(BLADES, count, 3)) * [3e4, 5e3, 2e4], np.zeros((BLADES, count, 4))
        put_loads(drawn, winds)
        half = rng.normal(size=(6, 6)) * np.sqrt([8e6, 8e6, 9e6, 6e10, 6e10, 9e9])
        data.added_mass[:] = half.T @ half / 6.0
        handle, dx, row = scene.handle(data), np.zeros_like(x), np.zeros(len(scene.channels))
        u = np.array([TORQUE, *np.zeros(scene.n_commands - 1)])
        forget(handle)
        output(handle, x, u, 0.0, dx, row)
        if self.n:
            groups = -(-count // LANES)
            stored = data.blades[:, N_BLADE_LOAD:][:, : N_STATION_LOAD * LANES * groups]
            stored = stored.reshape(BLADES, groups, N_STATION_LOAD, LANES).swapaxes(2, 3)
            assert np.allclose(stored.reshape(BLADES, -1, N_STATION_LOAD)[:, :count], drawn, rtol=1e-14)
        rates = {
            "platform": dx[State.VX : State.WX],
            "turning": dx[State.WX : State.ROTOR_SPEED],
            "rotor": dx[[State.ROTOR_SPEED]],
        }
        for name, part, count in (
            ("tower", "tower", 0 if self.tower is None else len(self.tower.U)),
            ("blades", "blade", BLADES * self.n),
            ("twist", "shaft", self.shaft is not None),
        ):
            rates[name] = dx[self.states_of(part)[1] :][:count]
        return SimpleNamespace(
            rates=rates, drawn=drawn, winds=winds, added=data.added_mass, blades=data.blades,
            channels=lambda names: row[[self.channels[name] for name in names.split()]],
        )  # fmt: skip


def swinging(case):
    """A smooth state in lively motion: the first modes alone are bent."""
    x = np.zeros(case.scene.n_state)
    x[: State.VX] = [0.4, -0.2, 0.0, 0.03, 0.05, 0.02, 0.7]
    x[State.VX : State.BLADE_PITCH] = [0.5, -0.2, 0.1, 0.01, 0.02, -0.01, 0.8]
    x[State.BLADE_PITCH] = 0.1
    x[case.blocks["other_blade_pitches"] :][:2] = 0.2, 0.05
    for b in range(BLADES):
        q = case.states_of("blade")[0] + case.n * b
        x[q], x[q + case.n - 1] = 2.0 + 0.4 * b, 0.3 - 0.2 * b
    if case.tower is not None:
        x[case.states_of("tower")[0] :][:2] = 0.3, -0.2
    if case.shaft is not None:
        x[case.states_of("shaft")[0]] = 0.004
    return x


def put_loads(drawn, winds):
    """Let the air load stations by drawn (blades, k, 3); put winds and pitches there into winds (.., 4)."""

    def station_load(response, v_normal, v_tangential, j):
        turned = effective_pitch(j, response.turn.pitch, response.shape)
        change = placed(j, CHANGE, response.shape) if type(response.shape) is BentShape else 0.0
        winds[response.number, j] = v_normal, v_tangential, turned, change
        return StationLoad(*(drawn[response.number, j] / (2.0 * DENSITY)), 2.0, 0.0, 0, None)

    blade_sweep.station_load = station_load

    # loads over the air density, which the look-up of a rotor multiplies by it
    def add_blade(total, blade, load, factor, pitches, blades):
        return blade_sweep.add_blade(total, blade, load, DENSITY, pitches, blades)

    bem_rotor.add_blade = add_blade
    bem_rotor.rotor_axes_load = lambda load, factor, rotor: blade_sweep.rotor_axes_load(load, DENSITY, rotor)
