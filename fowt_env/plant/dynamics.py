"""Evaluates the equation of motion: accelerations from the sum of loads, theory.md Eq. (9).

    (M + A) a = aero + gravity + buoyancy + strips + mooring + damping + user - momentum rate

Each *_load(t, pose, x, part, data) is in the file of its part and returns body components about the body
origin, zero for a part that is None. Numba omits the code after `if part is None: return` only where the part
is an argument of the same function, never for a field (`model.part is None`): so each test comes first in the
function that takes the part. compile/variants.py is for parts of several classes.
"""

from typing import NamedTuple

from fowt_env.plant.aero.blade_sweep import RotorLoad
from fowt_env.plant.aero.load import aero_load
from fowt_env.plant.blade_pitches import fill_pitch_rates
from fowt_env.plant.compile.decorators import inlined_kernel, kernel, separate_kernel
from fowt_env.plant.drivetrain import fill_torque_rate, shaft_torque, torque_in_force
from fowt_env.plant.elastic.blades import fill_deflection_rates
from fowt_env.plant.elastic.chain import accelerate_all, condense_elastic, weighed_body
from fowt_env.plant.elastic.forces import fill_blade_forces
from fowt_env.plant.elastic.shaft import fill_twist_rate, generator_speed
from fowt_env.plant.elastic.tower import (
    add_modal,
    bend_of,
    carried,
    elastic_force,
    fill_tower_rates,
    keep_bend,
    reduce_tower,
    turned_pose,
)
from fowt_env.plant.hydro.load import hydro_rates
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rigid_body import attitude_rate_at, gravity_load
from fowt_env.plant.slow_loads import slow_loads
from fowt_env.plant.state import State, Wrench, add, fill_sines, pose_by_sines
from fowt_env.plant.user_loads import add_modal_user_loads, add_user_loads, evaluate_user_loads


class Loads(NamedTuple):
    """Holds the loads of one evaluation, for outputs (body components about the body origin)."""

    rotor: RotorLoad  # with a flexible tower in nacelle axes, about the nacelle frame's origin
    tower: Wrench  # drag, and user loads above the tower base
    hydro: Wrench  # buoyancy, strip loads with added mass times acceleration, additional linear terms
    mooring: Wrench


@separate_kernel
def evaluate_loads(t, x, model, data, dx):
    """Evaluate all loads at a state into data; of dx only the rates of internal states are written."""
    cache, plane = data.cache, model.rigid_body.plane
    fill_sines(x, plane, cache[LoadCache.SINES :])
    pose, modal = pose_by_sines(x, cache[LoadCache.SINES :], plane), cache[LoadCache.MODAL :]
    bend = bend_of(x, model.tower)
    keep_bend(bend, data.rotor)
    nacelle = turned_pose(pose, bend)
    elastic_force(x, model.tower, modal)
    reduce_tower(x, pose, model.tower, data.rotor)
    aero = aero_load(t, pose, nacelle, x, model.aero, model.pitches, model.tower, data, dx)
    hydro, mooring = slow_loads(t, pose, x, model, model.blades, data)
    hydro_rates(x, model.hydro, dx)
    evaluate_user_loads(t, pose, nacelle, bend, x, model.aero, model.hydro, model.user, data, dx)

    tower = add_user_loads(aero.tower, True, bend, model.user, data)
    load = add(carried(aero.rotor.wrench, bend), tower)
    load = add(load, gravity_load(pose, weighed_body(model.rigid_body, model.structure)))
    load = add(load, hydro.buoyancy)
    load = add(load, hydro.strips)
    load = add(load, mooring)
    load = add(load, hydro.damping)
    load = add_user_loads(load, False, bend, model.user, data)
    add_modal(aero.rotor.wrench, bend, model.tower, data.rotor, modal)
    add_modal_user_loads(bend, model.tower, model.user, data, modal)

    fill_blade_forces(x, model.aero, model.blades, data.blades, data.rotor)
    condense_elastic(
        pose, x, bend, model.rigid_body, model.pitches, model.structure, model.tower, model.blades, data.rotor
    )

    cache[LoadCache.FACTORED] = cache[LoadCache.ANSWERED] = 0.0
    store(cache, LoadCache.TOTAL, load)
    store(cache, LoadCache.ROTOR, aero.rotor.wrench)
    store(cache, LoadCache.TOWER, tower)
    store(cache, LoadCache.HYDRO, add(add(hydro.buoyancy, hydro.strips), hydro.damping))
    store(cache, LoadCache.MOORING, mooring)
    cache[LoadCache.TORQUE] = aero.rotor.torque
    cache[LoadCache.THRUST] = aero.rotor.thrust


@separate_kernel
def respond(x, u, model, data, dx):
    """Fill dx with the rates of the state under the command u, from the loads of the last evaluation."""
    cache, body = data.cache, model.rigid_body
    cache[LoadCache.ANSWERED] = 0.0
    pose = pose_by_sines(x, cache[LoadCache.SINES :], body.plane)
    torque = shaft_torque(
        cache[LoadCache.TORQUE],
        torque_in_force(x, u, model.converter),
        generator_speed(x, model.shaft),
        model.drivetrain,
    )
    attitude_rate_at(pose, cache[LoadCache.SINES :], dx, body.plane)
    dx[State.AZIMUTH] = x[State.ROTOR_SPEED]
    fill_pitch_rates(x, u, model.actuator, model.pitches, dx)
    fill_torque_rate(x, u, model.converter, dx)
    fill_tower_rates(x, cache[LoadCache.MODAL :], model.tower, dx)
    fill_deflection_rates(x, model.blades, dx)
    fill_twist_rate(x, model.shaft, dx)
    load = stored(cache, LoadCache.TOTAL)
    accelerate_all(
        pose, x, load, torque, data.added_mass, body, model.structure, model.tower, model.blades, model.shaft,
        data.matrix, data.rotor, cache, dx,
    )  # fmt: skip


@inlined_kernel
def derivative(t, x, u, model, data, dx):
    """Fill dx with the derivative f(t, x, u) of the state; u is a Command."""
    data.cache[LoadCache.VALID] = 0.0
    evaluate_loads(t, x, model, data, dx)
    respond(x, u, model, data, dx)


@kernel
def store(cache, start, wrench):
    """Store a wrench in six entries of the cache."""
    cache[start] = wrench.fx
    cache[start + 1] = wrench.fy
    cache[start + 2] = wrench.fz
    cache[start + 3] = wrench.mx
    cache[start + 4] = wrench.my
    cache[start + 5] = wrench.mz


@kernel
def stored(cache, start):
    """Return the wrench stored in the cache from `start` on."""
    return Wrench(
        cache[start], cache[start + 1], cache[start + 2], cache[start + 3], cache[start + 4], cache[start + 5]
    )


@kernel
def loads_of(data, dx):
    """Return the loads of the last evaluation, with the added-mass load of its accelerations dx."""
    cache = data.cache
    hydro = add(stored(cache, LoadCache.HYDRO), added_mass_load(data.added_mass, dx))
    rotor = RotorLoad(stored(cache, LoadCache.ROTOR), cache[LoadCache.THRUST], cache[LoadCache.TORQUE])
    return Loads(rotor, stored(cache, LoadCache.TOWER), hydro, stored(cache, LoadCache.MOORING))


@kernel
def added_mass_load(added, dx):
    """Return -A nu', the part of the hydrodynamic load on the left-hand side."""
    return Wrench(
        -_row(added, 0, dx), -_row(added, 1, dx), -_row(added, 2, dx),
        -_row(added, 3, dx), -_row(added, 4, dx), -_row(added, 5, dx),
    )  # fmt: skip


@kernel
def _row(added, i, dx):
    """Return row i of the added mass times the acceleration."""
    total = added[i, 0] * dx[State.VX]
    for j in range(1, 6):
        total += added[i, j] * dx[State.VX + j]
    return total
