"""Rotor loads, with dynamic inflow or without: straight blades station by station (theory.md, 5.1)."""

import numpy as np
from naive.rotor import coefficients, solve, span_integrals


def rates(steady, state, a, wind_speed, span, tip_radius):
    """(2,) rates of the first stage and the velocity of Oeye's filter in one direction."""
    first, velocity = state
    tau_1 = 1.1 / (1 - 1.3 * min(max(a, 0.0), 0.5)) * tip_radius / max(wind_speed, 1.0)
    tau_2 = (0.39 - 0.26 * span**2) * tau_1
    return (0.4 * steady - first) / tau_1, (first + 0.6 * steady - velocity) / tau_2


def loads(turbine, rotor, R, origin, velocity, rate, azimuth, speed, pitches, wake, wind):
    """(force, moment about the body origin, torque, rates (blades, n, 4)).

    pitches: of each blade, rad. wake: (blades, n, 4), first stage and velocity, normal then tangential; None:
    induction without lag, and no rates.
    wind(point) -> (3,), inertial.
    """
    blade = turbine.blade
    hub = np.array([-rotor.overhang, 0.0, rotor.hub_height])
    ex = np.array([1.0, 0.0, 0.0])
    speed_at_hub = np.linalg.norm(R.T @ wind(origin + R @ hub) - velocity - np.cross(rate, hub))
    force, moment, torque = np.zeros(3), np.zeros(3), 0.0
    found = None if wake is None else np.zeros_like(wake)
    for i in range(rotor.blades):
        psi = azimuth + 2 * np.pi * i / rotor.blades
        er = np.array([0.0, -np.sin(psi), np.cos(psi)])
        et = np.cross(ex, er)
        fn, ft = [], []
        for j, radius in enumerate(blade.radius):
            theta, polar = blade.twist[j] + pitches[i], blade.polars[blade.airfoil[j]]
            rho = hub + radius * er
            W = R.T @ wind(origin + R @ rho) - velocity - np.cross(rate, rho) - speed * radius * et
            normal, tangential = W @ ex, -W @ et
            _, a, ap, *line = solve(normal, tangential, theta, radius, blade.chord[j], polar, rotor)
            if wake is None:
                fn.append(line[0])
                ft.append(line[1])
                continue
            span = radius / rotor.tip_radius
            for k, steady in ((0, -a * normal), (2, ap * tangential)):
                found[i, j, k : k + 2] = rates(
                    steady, wake[i, j, k : k + 2], a, speed_at_hub, span, rotor.tip_radius
                )
            normal, tangential = normal + wake[i, j, 1], tangential + wake[i, j, 3]
            flow = np.arctan2(normal, tangential)
            cl, cd = coefficients(flow - theta, polar)
            pressure = 0.5 * rotor.air_density * blade.chord[j] * (normal**2 + tangential**2)
            fn.append(pressure * (cl * np.cos(flow) + cd * np.sin(flow)))
            ft.append(pressure * (cl * np.sin(flow) - cd * np.cos(flow)))
        normal, normal_moment = span_integrals(blade.radius, np.array(fn), rotor)
        tangential, tangential_moment = span_integrals(blade.radius, np.array(ft), rotor)
        blade_force = normal * ex + tangential * et
        force += blade_force
        moment += np.cross(hub, blade_force) + np.cross(er, normal_moment * ex + tangential_moment * et)
        torque += tangential_moment
    return force, moment, torque, found
