"""A video of an episode, by Gymnasium's own RecordVideo wrapper.

render_mode="rgb_array" makes pictures without a window, so this works on a machine without a display;
render_mode="human" shows the same picture in a window as the episode runs. The wrapper calls render() after
each step and writes an MP4 when the episode ends. A picture is one control period of 0.1 s and 30 of them
are shown a second, so the video is three times as fast as life; `fowt dev animate` draws the same with titles
and several controllers side by side.
Needs pip install "fowt-env[video]"; with the extra `render` alone the pictures are counted, not written.
"""

from importlib.util import find_spec
from pathlib import Path

import gymnasium
import numpy as np

FOLDER = Path("results/examples/video")

env = gymnasium.make(
    "fowt_env:fowt_env/OC3Hywind-v2",
    task="above_rated",
    action_mode="residual",  # the PI steers, the action adds to it: zero is the PI alone
    wind={"kind": "eog", "speed": 18.0, "start": 5.0},  # extreme operating gust
    sea={"kind": "jonswap", "Hs": 6.0, "Tp": 10.0},
    duration=20.0,
    render_mode="rgb_array",
)
if find_spec("moviepy") is not None:
    env = gymnasium.wrappers.RecordVideo(
        env, str(FOLDER), episode_trigger=lambda episode: True, name_prefix="gust", disable_logger=True
    )

env.reset(seed=0)
done, pictures = False, 0
while not done:
    _, _, terminated, truncated, _ = env.step(np.zeros(2, dtype=np.float32))
    picture = env.render() if find_spec("moviepy") is None else env.unwrapped.render()
    done, pictures = terminated or truncated, pictures + 1
env.close()

print(f"{pictures} pictures of {picture.shape[1]} x {picture.shape[0]}")
if find_spec("moviepy") is None:
    print('no video: pip install "fowt-env[video]"')
else:
    path = FOLDER / "gust-episode-0.mp4"
    print(f"wrote {path} ({path.stat().st_size / 1e3:.0f} kB)")
