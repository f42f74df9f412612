"""A short-horizon actor-critic (SHAC) learns a controller by gradients through the plant's Jacobians.

Adjoints carry the derivative of the cost of a short window backwards through its control periods; a critic is
the cost expected after its end. The idea is that of Xu et al., Accelerated policy learning with parallel
differentiable simulation, ICLR 2022. Needs pip install "fowt-env[train]".
"""

import numpy as np
import torch
from torch import nn

from fowt_env.controllers import make
from fowt_env.envs import FowtEnv, PeriodJacobians

WIND, SEA = {"kind": "ntm", "speed": 18.0, "class": "B"}, {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}
SECONDS, PERIOD = 300.0, 0.1  # of an episode, of a step
TRAINING, HELD_OUT = range(100, 108), range(4)  # seeds of episodes
WINDOW, UPDATES, FITS = 32, 30, 16  # control periods, windows per episode, steps of the critic per window
DISCOUNT, TRACE = 0.997, 0.95  # per period: a memory of half a minute; lambda of the critic's targets
# what the controller reads: state, value at the operating point, deviation that counts as 1; SI, radians
READ = {
    "rotor_speed": ("rotor_speed", 1.2671, 0.063), "platform_pitch": ("platform_pitch", 0.0497, 0.0105),
    "platform_pitch_rate": ("wy", 0.0, 0.0026), "blade_pitch": ("blade_pitch", 0.258, 0.052),
}  # fmt: skip
STATES, REST, SIZES = map(list, zip(*READ.values(), strict=True))
RATED = 43093.55  # N m, generator torque
MOVES = torch.tensor([3000.0, 0.01])  # N m, rad: largest actions
TORQUE, RATE = 2155.0, 0.0035  # N m, rad/s: deviation and pitch rate that cost as much as the SIZES above


def network(outputs):
    """Return a network of the scaled readings, smooth since its derivatives are used."""
    hidden = nn.Linear(len(READ), 32), nn.SiLU(), nn.Linear(32, 32), nn.SiLU()
    return nn.Sequential(*hidden, nn.Linear(32, outputs)).double()


class Actor:
    """Changes the torque from rated and the blade pitch from its present value, which makes an integral."""

    def __init__(self):
        # linear: networks erred more in states far from those of their training
        self.network = nn.Linear(len(READ), 2).double()
        for values in self.network.parameters():  # at first torque and blades are held
            nn.init.zeros_(values)

    def __call__(self, states):
        pitch = REST[-1] + SIZES[-1] * states[..., -1]
        held = torch.stack([torch.full_like(pitch, RATED), pitch], -1)
        return held + MOVES * torch.tanh(self.network(states))

    def reset(self, measurement):
        pass

    def act(self, measurement):
        with torch.no_grad():
            return self(torch.from_numpy(scaled(measurement))).numpy()


def scaled(measurement):
    """Return the readings (4,) as deviations from the operating point over their sizes."""
    return (np.array([getattr(measurement, name) for name in READ]) - REST) / SIZES


def drive(env, controller, periods):
    """Return states (n + 1, 4), commands (n, 2), Jacobians and whether the episode ended, of n periods."""
    plant, commands, jacobians, ended = env.unwrapped, [], [], False
    states = [scaled(plant.measurement())]
    while len(commands) < periods and not ended:
        commands.append(controller.act(plant.measurement()))
        *_, terminated, truncated, info = env.step_physical(*commands[-1])
        states.append(scaled(plant.measurement()))
        jacobians.append(info.get("jacobian"))
        ended = terminated or truncated
    return torch.tensor(np.array(states)), torch.tensor(np.array(commands)), jacobians, ended


def terms(states, commands):
    """Return the terms (n, 4) of the cost of each period: rotor speed, platform pitch, pitch rate, torque."""
    rate = states.diff(dim=0)[:, -1] * SIZES[-1] / PERIOD
    return torch.stack([*states[1:, :2].T, rate / RATE, (commands[:, 0] - RATED) / TORQUE], -1) ** 2


def outcome(critic, states, commands):
    """Return the discounted cost of a window and of what follows, its costs (n,) and values (n + 1,)."""
    costs, values = (1.0 - DISCOUNT) * terms(states, commands).sum(-1), critic(states)[:, 0]
    weights = DISCOUNT ** torch.arange(len(values), dtype=torch.float64)
    return weights @ torch.cat([costs, values[-1:]]), costs, values


def backward(actor, critic, states, commands, jacobians):
    """Return the derivative (n, 2) of the outcome by each command, and targets (n,) of the critic."""
    states, commands = (given.clone().requires_grad_() for given in (states, commands))
    total, costs, values = outcome(critic, states, commands)
    by_state, by_command = (part.numpy() for part in torch.autograd.grad(total, (states, commands)))
    slopes = torch.func.vmap(torch.func.jacrev(actor))(states[:-1]).detach().numpy()
    names, targets = jacobians[0].states, costs.detach().clone()
    read = np.array([[name == state for state in STATES] for name in names]) / SIZES
    adjoint, target = read @ by_state[-1], values[-1].detach()
    for k in reversed(range(len(jacobians))):
        by_command[k] += jacobians[k].command.T @ adjoint
        adjoint = jacobians[k].state.T @ adjoint + read @ (by_state[k] + slopes[k].T @ by_command[k])
        target = costs[k] + DISCOUNT * ((1.0 - TRACE) * values[k + 1] + TRACE * target)
        targets[k] = target.detach()
    return torch.from_numpy(by_command), targets


def improve(optimiser, loss):
    """Make a step along the gradient of a loss, of limited length."""
    optimiser.zero_grad()
    loss.backward()
    nn.utils.clip_grad_norm_(optimiser.param_groups[0]["params"], 1.0)
    optimiser.step()


def train(actor, envs):
    """Train an actor on successive windows of environments; return the number of periods."""
    critic, periods = network(1), 0
    both = [torch.optim.Adam(each.parameters(), betas=(0.7, 0.95)) for each in (actor.network, critic)]
    for left in np.linspace(1.0, 0.1, UPDATES):
        for optimiser, rate in zip(both, (5e-2, 1e-2), strict=True):
            optimiser.param_groups[0]["lr"] = rate * left
        found = []
        for env in envs:
            states, commands, jacobians, ended = drive(env, actor, WINDOW)
            # the critic is also asked after a failure: a cost that ends there would reward overspeed
            found.append((states[:-1], *backward(actor, critic, states, commands, jacobians)))
            if ended:
                env.reset()
        states, gradients, targets = map(torch.cat, zip(*found, strict=True))
        periods += len(states)
        improve(both[0], (actor(states) * gradients).sum() / len(envs))  # has the gradient of the outcome
        for _ in range(FITS):
            improve(both[1], ((critic(states)[:, 0] - targets) ** 2).mean())
    return periods


def score(env, controller):
    """Return the mean terms (4,) of the cost of a period and the failures, of the episodes held out."""
    found, failed = [], 0
    for seed in HELD_OUT:
        env.reset(seed=seed)
        controller.reset(env.measurement())
        states, commands, *_ = drive(env, controller, np.inf)
        found.append(terms(states, commands).mean(0).numpy())
        failed += len(commands) < round(SECONDS / PERIOD)
    return np.mean(found, 0), failed


def main():
    torch.manual_seed(0)
    env = FowtEnv(wind=WIND, sea=SEA, duration=SECONDS, action_mode="direct", observation=("rotor_speed",))
    envs = [PeriodJacobians(env.twin()) for _ in TRAINING]
    for each, seed in zip(envs, TRAINING, strict=True):
        each.reset(seed=seed)
    actor, published = Actor(), make("gspi_oc3", env.scene.turbine, PERIOD)
    rows = {"untrained": score(env, actor), "gspi_oc3": score(env, published)}
    periods = train(actor, envs)
    rows[f"trained in {periods} periods"] = score(env, actor)
    for name, (parts, failed) in rows.items():
        shares = ", ".join(f"{part:.2f}" for part in parts)
        print(f"{name}: cost {parts.sum():.2f} = {shares}; failed {failed} of {len(HELD_OUT)}")


if __name__ == "__main__":
    main()
