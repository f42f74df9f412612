"""What if: save the state of an environment, try several futures from it, and go on from the best.

get_state() holds all that decides how a run goes on: plant, weather, controller, counters and random draws.
set_state() restores it, and the same actions then give the same bits. Here a planner of ten lines looks five
seconds ahead every two seconds: it tries a few constant corrections of the PI and takes the one that would
pay most. It knows the coming wind, as no controller of a real turbine does: it shows what there is to gain.
"""

import gymnasium
import numpy as np

SETTINGS = {"task": "above_rated", "action_mode": "residual", "duration": 60.0}
FUTURES = [np.array([0.0, pitch], dtype=np.float32) for pitch in (0.0, -0.4, -0.2, 0.2, 0.4)]
AHEAD, HELD = 50, 20  # control periods of 0.1 s


def run_on(env, action, steps):
    """(sum of the rewards, whether the episode ended) of some steps under one action."""
    total = 0.0
    for _ in range(steps):
        _, reward, terminated, truncated, _ = env.step(action)
        total += reward
        if terminated or truncated:
            return total, True
    return total, False


def episode(env, choose):
    """Sum of the rewards of an episode whose actions choose(env) gives, each held for HELD periods."""
    env.reset(seed=3)
    total, done = 0.0, False
    while not done:
        paid, done = run_on(env, choose(env), HELD)
        total += paid
    return total


def looked_ahead(env):
    """The action whose next AHEAD periods would pay most; the environment is left as it was."""
    plant = env.unwrapped
    saved = plant.get_state()
    paid = []
    for action in FUTURES:
        paid.append(run_on(plant, action, AHEAD)[0])
        plant.set_state(saved)
    return FUTURES[int(np.argmax(paid))]


if __name__ == "__main__":
    env = gymnasium.make("fowt_env:fowt_env/OC3Hywind-v2", reward=None, **SETTINGS)  # weighted terms
    env.reset(seed=3)
    saved = env.unwrapped.get_state()
    one = run_on(env.unwrapped, FUTURES[1], AHEAD)[0]
    env.unwrapped.set_state(saved)
    print(
        "the same future twice:",
        "same bits" if run_on(env.unwrapped, FUTURES[1], AHEAD)[0] == one else "other",
    )
    alone = episode(env, lambda env: FUTURES[0])
    planned = episode(env, looked_ahead)
    print(f"reward of an episode: PI alone {alone:.1f}, with a look ahead {planned:.1f}")
