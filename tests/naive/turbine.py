"""NREL 5 MW turbine record written out from its published figures, without the data files.

Jonkman et al. (2009), NREL/TP-500-38060; Jonkman (2010), NREL/TP-500-47535 for the OC3 gains. The
blade is a placeholder: nothing that uses this record looks at it.
"""

import numpy as np

from fowt_env.descriptions import turbine as description


def torque_law(**changes):
    """Published torque law, with changes."""
    figures = {
        "rated_torque": 43093.55,
        "rated_power": 5296610.0,
        "rated_speed": 122.9096,
        "cut_in_speed": 70.16224,
        "region2_start_speed": 91.21091,
        "region2_constant": 2.332287,
        "transition_speed": 121.6805,
        "slip_percent": 10.0,
        "region3_min_pitch": 0.01745329,
        "max_torque": 47402.91,
        "max_torque_rate": 15000.0,
        "speed_filter_corner": 1.570796,
    }
    return description.TorqueLaw(**(figures | changes))


def turbine(mesh_loss=0.0, bearing_loss=0.0):
    """Turbine record with the published drivetrain, actuator, torque law and gains."""
    return description.Turbine(
        name="published",
        rated_rotor_speed=122.9096 / 97.0,
        rated_wind_speed=11.4,
        cut_in_wind_speed=3.0,
        cut_out_wind_speed=25.0,
        overspeed=15.73 * np.pi / 30.0,
        rotor=description.Rotor(
            mass=110000.0,
            overhang=5.0191,
            hub_height=90.0,
            hub_radius=1.5,
            tip_radius=63.0,
            inertia=38832891.0,
            inertia_diameter=19358482.0,
        ),
        nacelle=description.Nacelle(
            mass=240000.0, cm_downwind=1.9, cm_height=89.35, inertia=(2607890.0, 2607890.0, 2607890.0)
        ),
        drivetrain=description.Drivetrain(
            gear_ratio=97.0,
            generator_inertia=534.116,
            mesh_loss=mesh_loss,
            bearing_loss=bearing_loss,
            generator_efficiency=0.944,
        ),
        pitch_drive=description.PitchDrive(
            time_constant=0.2, rate_limit=0.1396263, minimum=0.0, maximum=1.570796
        ),
        torque_law=torque_law(),
        gains={
            "oc3": description.PitchGains(KP=0.006275604, KI=0.0008965149, gain_schedule_pitch=0.1099965),
            "land": description.PitchGains(KP=0.01882681, KI=0.008068634, gain_schedule_pitch=0.1099965),
        },
        blade=description.Blade(
            radius=np.array([2.0, 60.0]),
            chord=np.array([3.0, 1.0]),
            twist=np.zeros(2),
            airfoil=("flat", "flat"),
            polars={"flat": np.array([[-np.pi, 0.0, 0.0, 0.0], [np.pi, 0.0, 0.0, 0.0]])},
        ),
    )
