"""Loads of blades that bend in a sheared wind, LANES stations at a time, against those station by station.

The plant as plain Python, with a table of drawn numbers: that of a rotor takes minutes to build without the
compiler, and this one tells a wrong cell from the right one.
"""

import json
from pathlib import Path

import numpy as np
from elastic_cases import BLADES, Case
from fresh_python import fresh_python

from fowt_env.plant.aero.bent_blade import LANES, N_STATION_LOAD, loaded_at
from fowt_env.plant.aero.bent_sweep import bent_forces
from fowt_env.plant.aero.blade_shape import turn_of
from fowt_env.plant.aero.blade_sweep import load_of_three, rotor_flow, rotor_reach, shape_of, sheared_forces
from fowt_env.plant.aero.section_table import SectionTable, station_arms, tabled_blade, turn_and_response
from fowt_env.plant.aero.station_response import AHEAD, BEHIND, COARSE_ROWS, DENSE_ROWS
from fowt_env.plant.aero.wind import WindNow
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.elastic.forces import fill_blade_forces
from fowt_env.plant.state import State, pose_of

NEAR = 1e-12
STATES = 20


def blades_of(x, t, case, table, arrays):
    """(three Blades, RotorFlow, reach) of a state; arrays: Data.blades."""
    model, elements = case.scene.model, table.elements
    now = WindNow(11.0, 0.5, 0.3, 1.0, -0.7)
    flow = rotor_flow(t, pose_of(x), now, model.aero.wind, None, elements)
    bent = shape_of(0, x, elements.shape, elements.modes, arrays)
    first = turn_and_response(turn_of(x[State.BLADE_PITCH]), bent, table)
    blades = [
        tabled_blade(number, first, x, flow, table, model.pitches if number else None, arrays)
        for number in range(BLADES)
    ]
    assert [blade.turn.pitch for blade in blades] == [pitch_of(k, x, model.pitches) for k in range(BLADES)]
    return blades, flow, rotor_reach(elements.tip_radius, elements.shape)


def station_loads(shape, count):
    """(count, 3) stored loads of the stations of a BentShape."""
    rows = [[loaded_at(j, LANES * k) for k in range(N_STATION_LOAD)] for j in range(count)]
    return shape.loads[np.array(rows, dtype=int)].copy()


def worst():
    """Largest errors over the largest value: of the sums, of what is stored of stations, of modal forces."""
    case, rng = Case("iea15_volturnus_s", "modes2", "rigid"), np.random.default_rng(5)
    elements = case.scene.model.aero.rotor.elements
    count, n = len(elements.radius), case.n
    drawn = rng.normal(size=(DENSE_ROWS + COARSE_ROWS + 1, count, AHEAD + BEHIND + 1, N_STATION_LOAD))
    table = SectionTable(drawn.astype(np.float32), station_arms(elements), elements)
    errors, inside, fast, plain = [], 0, case.scene.data(), case.scene.data()
    for _ in range(STATES):
        x = case.random(rng)
        x[:3] = 0.0
        found = []
        for forces, data in ((bent_forces, fast), (sheared_forces, plain)):
            blades, flow, reach = blades_of(x, 0.0, case, table, data.blades)
            near = (None,) if forces is bent_forces else ()
            three = forces(*blades, flow, reach, elements.radius, *near)
            if forces is sheared_forces:  # beside a tower that disturbs the wind
                assert bent_forces(*blades, flow, reach, elements.radius, flow) == three
            load_of_three(*blades, three, elements, case.scene.model.pitches, data.blades)
            aero = case.scene.model.aero._replace(rotor=table)
            fill_blade_forces(x, aero, case.scene.model.blades, data.blades, data.rotor)
            stored = [station_loads(blade.shape, count) for blade in blades]
            modal = plain_modal(x, case, blades, stored, n)
            found.append((
                np.array([force.load for force in three]), np.array(stored),
                [force.outside == 0 for force in three], data.rotor.force.copy(), modal,
            ))  # fmt: skip
        one, other = found
        inside += np.sum(other[2])
        assert one[2] == other[2]
        pairs = [(one[0], other[0]), (one[1], other[1]), (one[3], one[4]), (other[3], other[4])]
        errors.append([np.abs(np.subtract(*pair)).max() / np.abs(pair[1]).max() for pair in pairs])
    return np.max(errors, axis=0).tolist(), int(inside)


def plain_modal(x, case, blades, stored, n):
    """(BLADES, n) forces on the modes: of structure, then of the loads station by station."""
    model = case.scene.model
    q, v = (x[at:][: BLADES * n].reshape(BLADES, n) for at in case.states_of("blade"))
    force = -(q @ model.blades.beam.stiffness.T + v @ model.blades.beam.damping.T)
    for b, blade in enumerate(blades):
        for i in range(n):
            modal = blade.shape.modal[i * blade.shape.modes.size :]
            for j, load in enumerate(stored[b]):
                force[b, i] += sum(modal[loaded_at(j, LANES * k)] * load[k] for k in range(N_STATION_LOAD))
    return force


def test_stations_in_lanes_have_the_loads_of_stations_one_by_one():
    code = "import json, test_bent_sweep; print(json.dumps(test_bent_sweep.worst()))"
    here = Path(__file__).parent
    errors, inside = json.loads(fresh_python(code, paths=(here, here.parents[1]), NUMBA_DISABLE_JIT="1"))
    assert max(errors) < NEAR
    assert STATES < inside < BLADES * STATES  # so that some stations lie outside the table
