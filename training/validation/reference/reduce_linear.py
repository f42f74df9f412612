"""Writes poles and responses of OpenFAST's linear models of VolturnUS-S with the tower fixed (`responses`).

Each linearisation file has 106 states: surge, heave, platform pitch, the first fore-aft tower mode, the
generator's azimuth, their rates, and HydroDyn's. The files of the twelve azimuths of an operating point are
averaged. The tower is then fixed by the constraint force lambda e_t that makes its acceleration zero: with
q'' = a the accelerations of the free model and m = M^-1 e_t, a - m a_t / m_t, q_t = q_t' = 0. The stiffness
of the tower mode is a generalised force along e_t alone, so that the column of A for q_t is m up to gravity
and aerodynamics (about 1 % of the column of pitch). `direction_from_masses` computes m from the masses
of the deck instead; the resulting poles are stored in further columns.
"""

from itertools import takewhile
from pathlib import Path

import numpy as np
from make import six_digits, sources, write

from fowt_env.training.validation.linear_cases import named_poles

RAD_PER_S = np.array([0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8])  # of the responses
PLATFORM = ("surge", "heave", "pitch")
TOWER = 3  # index of the tower mode
HELD = (*"surge heave platform_pitch vx vz wy rotor_speed".split(),)  # first states with the tower fixed


def read(path):
    """Return (A, B, (states, inputs) operating points) of a linearisation file."""
    lines, parts = Path(path).read_text().split("\n"), {}
    for number, line in enumerate(lines):
        name = line.split()[-1].rstrip(":") if line.startswith("Order of ") else ""
        if line.startswith(("A:", "B:")):
            rows = int(line[2:].split("x")[0])
            parts[line[0]] = np.loadtxt(lines[number + 1 : number + 1 + rows], ndmin=2)
        elif name in ("states", "inputs"):
            rows = takewhile(str.strip, lines[number + 3 :])
            parts[name] = np.array([float(row.split()[1].rstrip(",")) for row in rows])
    return parts["A"], parts["B"], parts["states"], parts["inputs"]


def hold_tower(A, B, direction=None):
    """Return (A, B) with the tower fixed; states: surge, heave, pitch, their rates, rotor speed, HydroDyn.

    direction (5,): M^-1 e_t up to a factor; None: the column of the tower's deflection.
    """
    m = A[5:10, TOWER] if direction is None else direction
    ratio = m / m[TOWER]
    A, B = A.copy(), B.copy()
    for matrix in (A, B):
        matrix[5:10] -= np.outer(ratio, matrix[5 + TOWER])
    kept = [0, 1, 2, 5, 6, 7, 9, *range(10, len(A))]  # models are averaged over the azimuth: drop it
    return A[np.ix_(kept, kept)], B[kept]


# values of that deck (ROSCO's test cases, aa8a5f62), kg and m: (mass, x, z) of bodies at the tower top
TOWER_BASE, TOWER_TOP, TOWER_FACTOR = 15.0, 144.495, 1.012
TOWER_DENSITY = (  # fraction of the height, kg/m
    (0.0, 20299.2), (0.1003226, 20225.5), (0.2006451, 20231.6), (0.3009678, 20149.7), (0.3009754, 7322.2),
    (0.4012903, 7027.0), (0.401298, 6560.0), (0.5016128, 6298.3), (0.5016206, 5849.7), (0.6019355, 5718.9),
    (0.6019432, 5060.7), (0.7022581, 4941.6), (0.7022658, 4298.5), (0.8025806, 4135.7), (0.8025884, 3723.0),
    (0.9029032, 3241.9), (0.9029109, 3780.6), (1.0, 3355.4),
)  # fmt: skip
MODE_SHAPE = (0.8652, -2.2378, 6.7891, -6.5162, 2.0998)  # of x^2 to x^6
TOP_BODIES = (
    (100000.0, 0.0, TOWER_TOP),  # yaw bearing
    (507275.0, -4.985, TOWER_TOP + 4.358),  # nacelle
    (190000.0 + 3.0 * 65250.0, -11.3, 150.0),  # hub and blades
)
ROTOR_INERTIA = 1.55e8  # about a diameter of the rotor, kg m2
PLATFORM_MASS, PLATFORM_DEPTH, PLATFORM_INERTIA = 17.838e6, 14.94, 1.2507e10
ADDED_MASS = ((0, 0, 9.64e6), (1, 1, 2.48e7), (2, 2, 1.164e10), (0, 2, -1.01e8), (2, 0, -1.01e8))


def direction_from_masses():
    """Return M^-1 e_t (5,) of the planar model from the values above; the rotor is not coupled."""
    mass = np.zeros((4, 4))  # surge, heave, pitch, tower

    def add(m, x, z, bend, slope):
        for motion in ((1.0, 0.0, z, bend), (0.0, 1.0, -x, -slope * x)):
            mass[:] += m * np.outer(motion, motion)

    height = TOWER_TOP - TOWER_BASE
    fraction = (np.arange(400) + 0.5) / 400.0
    density = np.interp(fraction, *np.transpose(TOWER_DENSITY))
    for f, rho in zip(fraction, density, strict=True):
        bend = sum(c * f**k for k, c in enumerate(MODE_SHAPE, 2))
        add(TOWER_FACTOR * rho * height / 400.0, 0.0, TOWER_BASE + f * height, bend, 0.0)
    slope = sum(k * c for k, c in enumerate(MODE_SHAPE, 2)) / height
    for m, x, z in TOP_BODIES:
        add(m, x, z, 1.0 + slope * (z - TOWER_TOP), slope)
    turning = np.array([0.0, 0.0, 1.0, slope])
    mass += ROTOR_INERTIA * np.outer(turning, turning)
    add(PLATFORM_MASS, 0.0, -PLATFORM_DEPTH, 0.0, 0.0)
    mass[2, 2] += PLATFORM_INERTIA
    for i, j, value in ADDED_MASS:
        mass[i, j] += value
    return np.append(np.linalg.inv(mass)[:, TOWER], 0.0)


WIND, COLLECTIVE = 0, 8  # columns of B


def responses(source, folder):
    """Write linear_poles.csv.gz and linear_responses.csv.gz of the operating points from 5 to 24 m/s."""
    poles, gains = [], []
    for point in range(20):
        models = [read(path) for path in sorted(Path(source).glob(f"lin_{point:02d}.*.lin"))]
        A, B, states, inputs = (np.mean(part, axis=0) for part in zip(*models, strict=True))
        fixed, by = hold_tower(A, B)
        other, by_other = hold_tower(A, B, direction_from_masses())
        row = {
            "wind_mps": inputs[0], "azimuths": len(models), "rotor_speed_rad_s": states[9],
            "blade_pitch_rad": inputs[COLLECTIVE], "gen_torque_Nm": inputs[7],
            "surge_m": states[0], "heave_m": states[1], "pitch_rad": states[2],
        }  # fmt: skip
        flexible = np.delete(np.delete(A, 4, axis=0), 4, axis=1)
        for name, value in named_poles(fixed, HELD).items():
            row |= {f"{name}_real": value.real, f"{name}_imag": value.imag}
        for name, value in named_poles(other, HELD).items():
            row |= {f"{name}_real_other": value.real, f"{name}_imag_other": value.imag}
        near = np.linalg.eigvals(flexible)
        for name in PLATFORM:
            pole = complex(row[f"{name}_real"], row[f"{name}_imag"])
            free = near[np.argmin(np.abs(near - pole))]
            row |= {f"{name}_real_flexible": free.real, f"{name}_imag_flexible": free.imag}
        poles.append(row)
        for source_name, column in (("wind", WIND), ("blade_pitch", COLLECTIVE)):
            for target, state in (("rotor_speed", 6), ("pitch", 2)):
                for w in RAD_PER_S:
                    value = np.linalg.solve(1j * w * np.eye(len(fixed)) - fixed, by[:, column])[state]
                    gains.append({
                        "wind_mps": inputs[0], "input": source_name, "output": target, "omega_rad_s": w,
                        "real": value.real, "imag": value.imag,
                    })  # fmt: skip
    model = (
        "OpenFAST (2021-02), IEA 15 MW on VolturnUS-S of NREL/ROSCO fc11f43 (Examples/Test_Cases, 240"
        " linearisation files): surge, heave, platform pitch,"
        " generator, first fore-aft tower mode; mean of the azimuths, tower held afterwards"
        " (reduce_linear.py)"
    )
    settings = (
        "operating points, and poles (1/s, rad/s); _other: direction of the constraint from the deck's masses"
        " instead of the tower's stiffness;"
        " _flexible: tower free"
    )

    write(folder / "linear_poles.csv.gz", (model, settings, *sources(source)), six_digits(poles))
    settings = (
        "responses of rotor speed (rad/s) and platform pitch (rad) to hub wind (m/s) and blade pitch (rad)"
    )
    write(folder / "linear_responses.csv.gz", (model, settings, *sources(source)), six_digits(gains))
