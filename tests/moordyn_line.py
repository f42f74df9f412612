"""Makes tests/reference/moordyn_line.csv anew: python tests/moordyn_line.py, with moordyn 2.7.2 from PyPI."""

import tempfile
from pathlib import Path

import numpy as np

PATH = Path(__file__).parent / "reference" / "moordyn_line.csv"
FAIRLEAD = np.array([-58.0, 0.0, -14.0])
STEP, END = 0.002, 100.0  # s
KEPT = np.arange(40.0, END + 0.01, 0.1)  # s
HEAD = """\
# MoorDyn 2.7.2 (Python package moordyn), one line of VolturnUS-S with 20 segments, dtM 0.001 s,
# driven by the fairlead motion of tests/plant/test_line_dynamics.py in steps of 0.002 s
time_s,force_x_kN,force_z_kN
"""
DECK = """\
--------------------- MoorDyn Input File ------------------------------------
one line
----------------------- LINE TYPES ------------------------------------------
Name  Diam  MassDen  EA       BA/-zeta  EI    Cd    Ca    CdAx   CaAx
(-)   (m)   (kg/m)   (N)      (N-s/-)   (-)   (-)   (-)   (-)    (-)
main  0.333  685.00  3.27E+09  -1.0      0    2.0   0.82  0.4    0.27
---------------------- POINTS --------------------------------
ID   Type      X         Y       Z       M    V    CdA   CA
(-)  (-)      (m)       (m)     (m)    (kg) (m^3) (m^2) (-)
1   Coupled  -58.000    0.000 -14.000     0    0    0    0
2   Fixed  -837.600    0.000 -200.000    0    0    0    0
---------------------- LINES --------------------------------------
ID  LineType  AttachA   AttachB  UnstrLen  NumSegs  Outputs
(-)   (-)       (-)       (-)      (m)       (-)      (-)
1     main       2         1     850.00      20        -
---------------------- SOLVER OPTIONS ---------------------------------------
0.001    dtM
3.0e6    kbot
3.0e5    cbot
200.0 WtrDpth
1025.0 rhoW
9.81 gravity
1.0      dtIC
120.0     TmaxIC
4.0      CdScaleIC
0.0001     threshIC
------------------------- need this line --------------------------------------
"""


def motion(t, rise=20.0):
    """Position and velocity of the fairlead at t (s): surge and heave, rising from rest."""
    w, fade = 2.0 * np.pi / 10.0, np.exp(-((t / rise) ** 2))
    ramp, rate = 1.0 - fade, 2.0 * t / rise**2 * fade
    shape = np.array([5.0 * np.sin(w * t), 0.0, 1.5 * np.sin(1.3 * w * t + 0.4)])
    slope = np.array([5.0 * w * np.cos(w * t), 0.0, 1.5 * 1.3 * w * np.cos(1.3 * w * t + 0.4)])
    return FAIRLEAD + ramp * shape, rate * shape + ramp * slope


def main():
    import moordyn

    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "line.dat"
        deck.write_text(DECK)
        system = moordyn.Create(str(deck))
        moordyn.Init(system, list(FAIRLEAD), [0.0, 0.0, 0.0])
        forces = []
        for k in range(round(END / STEP)):
            position, velocity = motion(k * STEP)
            forces.append(moordyn.Step(system, list(position), list(velocity), k * STEP, STEP))
        moordyn.Close(system)
    rows = [(t, forces[round(t / STEP) - 1]) for t in KEPT]
    lines = [f"{t:.1f},{force[0] / 1e3:.2f},{force[2] / 1e3:.2f}\n" for t, force in rows]
    PATH.write_text(HEAD + "".join(lines))


if __name__ == "__main__":
    main()
