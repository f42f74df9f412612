"""Score of stops at constant feathering rates in the task shutdown.

`python docs/tools/shutdown_baseline.py` prints the table of docs/results/rewards.md.
"""

import numpy as np

from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.envs import FowtEnv
from fowt_env.files.markdown import markdown_table

RATES = (8.0, 4.0, 2.0, 0.9, 0.45)  # deg/s
EPISODES = 10
STANDING = 0.1  # of rated rotor speed


def stop(env, rate, seed):
    """{figure: value} of an episode feathered at a rate (deg/s); the torque falls with the rotor speed."""
    env.reset(seed=seed)
    rated, begun = env.scene.turbine.rated_rotor_speed, env.measurement()
    pitch, total, terminated, truncated = begun.blade_pitch, 0.0, False, False
    figures = {"rotor": 0.0, "pitch": 0.0, "top": 0.0, "standing": 0.0}
    while not (terminated or truncated):
        now = env.measurement()
        pitch = min(pitch + rate * DEGREE * env.control_dt, env.scene.turbine.pitch_drive.maximum)
        share = max(0.0, (now.rotor_speed - 0.3 * rated) / (begun.rotor_speed - 0.3 * rated))
        _, reward, terminated, truncated, _ = env.step_physical(begun.generator_torque * share, pitch)
        total += reward
        now = env.measurement()
        figures["rotor"] = max(figures["rotor"], now.rotor_speed / RPM)
        figures["pitch"] = max(figures["pitch"], abs(now.platform_pitch) / DEGREE)
        figures["top"] = max(figures["top"], abs(now.nacelle_acceleration))
        if abs(now.rotor_speed) > STANDING * rated:
            figures["standing"] = now.time - begun.time
    return {"reward": total} | figures


def table(rates=RATES, episodes=EPISODES):
    """Markdown table of means over episodes, by rate."""
    env, rows = FowtEnv("shutdown"), []
    for rate in rates:
        runs = [stop(env, rate, seed) for seed in range(episodes)]
        means = [np.mean([run[key] for run in runs]) for key in runs[0]]
        texts = [f"{mean:.{digits}f}" for mean, digits in zip(means, (0, 2, 2, 2, 0), strict=True)]
        rows.append((f"{rate:g}", *texts))
    headings = ("feathering (deg/s)", "reward", "largest rotor speed (rpm)", "largest platform pitch (deg)",
                "largest tower-top acceleration (m/s2)", "time to standstill (s)")  # fmt: skip
    return markdown_table(headings, rows, aligned=True)


if __name__ == "__main__":
    print(table())
