"""PPO in one file, with the structure and default settings of CleanRL's script for continuous actions.

    python examples/18_cleanrl_ppo.py                        # 100,000 decisions on the easiest task
    python examples/18_cleanrl_ppo.py --total-timesteps 4096 --env-id fowt_env/OC3HywindLidar-v0

Needs pip install "fowt-env[train]"; nothing of stable-baselines3 is used. The environment is the native
vector environment of Gymnasium's make_vec with Gymnasium's own vector wrappers around it.
"""

import argparse
import time
from collections import deque

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers.vector import (
    ClipAction,
    NormalizeObservation,
    NormalizeReward,
    RecordEpisodeStatistics,
    TransformObservation,
    TransformReward,
)
from torch import nn
from torch.distributions import Normal

import fowt_env  # noqa: F401 # registers the environments

CLIP = 10.0  # of normalised observations and rewards


def arguments(given=None):
    """Return the settings of the command line; defaults are those of CleanRL's ppo_continuous_action."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--env-id", default="fowt_env/OC3HywindEasy-v0")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--total-timesteps", type=int, default=100_000)  # there 1,000,000
    parser.add_argument("--learning-rate", type=float, default=3e-4)
    parser.add_argument("--num-envs", type=int, default=1)
    parser.add_argument("--num-steps", type=int, default=2048, help="decisions of a rollout, per environment")
    parser.add_argument("--gamma", type=float, default=0.99)
    parser.add_argument("--gae-lambda", type=float, default=0.95)
    parser.add_argument("--num-minibatches", type=int, default=32)
    parser.add_argument("--update-epochs", type=int, default=10)
    parser.add_argument("--clip-coef", type=float, default=0.2)
    parser.add_argument("--vf-coef", type=float, default=0.5)
    parser.add_argument("--max-grad-norm", type=float, default=0.5)
    return parser.parse_args(given)


def wrapped(env_id, num_envs, gamma):
    """Return (normalisation of the observations, vector environment with the usual wrappers)."""
    envs = RecordEpisodeStatistics(gymnasium.make_vec(env_id, num_envs=num_envs))
    scaled = NormalizeObservation(ClipAction(envs))
    envs = TransformObservation(scaled, lambda seen: np.clip(seen, -CLIP, CLIP))
    return scaled, TransformReward(NormalizeReward(envs, gamma=gamma), lambda r: np.clip(r, -CLIP, CLIP))


def layer(inputs, outputs, gain):
    """Return a linear layer with orthogonal weights and no bias at the start."""
    linear = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(linear.weight, gain)
    nn.init.zeros_(linear.bias)
    return linear


class Agent(nn.Module):
    """Holds two networks: the value of an observation, and the mean of a normal distribution of actions."""

    def __init__(self, n_observed, n_actions):
        super().__init__()

        def network(outputs, gain):
            hidden = [layer(n_observed, 64, 2**0.5), nn.Tanh(), layer(64, 64, 2**0.5), nn.Tanh()]
            return nn.Sequential(*hidden, layer(64, outputs, gain))

        self.critic, self.actor = network(1, 1.0), network(n_actions, 0.01)
        self.log_std = nn.Parameter(torch.zeros(1, n_actions))

    def value(self, seen):
        """Return the values (n,) of observations."""
        return self.critic(seen)[:, 0]

    def distribution(self, seen):
        """Return the distribution of actions."""
        mean = self.actor(seen)
        return Normal(mean, self.log_std.exp().expand_as(mean))


def advantages(rewards, values, dones, last_value, last_done, gamma, gae_lambda):
    """Return generalised advantage estimates (steps, envs); dones: whether a step began a new episode."""
    found, running = torch.zeros_like(rewards), torch.zeros(rewards.shape[1])
    for t in reversed(range(len(rewards))):
        at_end = t == len(rewards) - 1
        following, done = (last_value, last_done) if at_end else (values[t + 1], dones[t + 1])
        error = rewards[t] + gamma * following * (1.0 - done) - values[t]
        running = error + gamma * gae_lambda * (1.0 - done) * running
        found[t] = running
    return found


def train(args, watch=None):
    """Train and return (policy: observations to actions, returns of the finished episodes).

    watch: called with the decisions so far and the policy, before the first rollout and after each update.
    """
    np.random.seed(args.seed)
    torch.manual_seed(args.seed)
    scaled, envs = wrapped(args.env_id, args.num_envs, args.gamma)
    agent = Agent(envs.single_observation_space.shape[0], envs.single_action_space.shape[0])
    optimiser = torch.optim.Adam(agent.parameters(), lr=args.learning_rate, eps=1e-5)
    statistics = scaled.obs_rms

    def policy(observations):
        seen = (observations - statistics.mean) / np.sqrt(statistics.var + scaled.epsilon)
        with torch.no_grad():
            actions = agent.actor(torch.as_tensor(np.clip(seen, -CLIP, CLIP), dtype=torch.float32))
        return np.clip(actions.numpy(), -1.0, 1.0)

    shape, batch = (args.num_steps, args.num_envs), args.num_steps * args.num_envs
    observed = torch.zeros(*shape, *envs.single_observation_space.shape)
    acted = torch.zeros(*shape, *envs.single_action_space.shape)
    log_probs, rewards, dones, values = (torch.zeros(shape) for _ in range(4))
    seen, done = torch.as_tensor(envs.reset(seed=args.seed)[0]), torch.zeros(args.num_envs)
    returns, begun, updates = [], time.perf_counter(), -(-args.total_timesteps // batch)
    recent = deque(maxlen=20)
    if watch is not None:
        watch(0, policy)
    for update in range(updates):
        optimiser.param_groups[0]["lr"] = args.learning_rate * (1.0 - update / updates)
        for t in range(args.num_steps):
            observed[t], dones[t] = seen, done
            with torch.no_grad():
                actions = agent.distribution(seen)
                acted[t] = actions.sample()
                log_probs[t], values[t] = actions.log_prob(acted[t]).sum(1), agent.value(seen)
            after, reward, terminated, truncated, infos = envs.step(acted[t].numpy())
            rewards[t] = torch.as_tensor(reward)
            seen, done = torch.as_tensor(after), torch.as_tensor(terminated | truncated, dtype=torch.float32)
            if "episode" in infos:
                ended = infos["episode"]["r"][infos["_episode"]]
                returns += ended.tolist()
                recent.extend(ended)
        with torch.no_grad():
            gains = advantages(rewards, values, dones, agent.value(seen), done, args.gamma, args.gae_lambda)
        batches = map(flat, (observed, acted, log_probs, gains, gains + values, values))
        improve(args, agent, optimiser, *batches)
        steps = (update + 1) * batch
        rate = steps / (time.perf_counter() - begun)
        mean = np.mean(recent or [np.nan])
        print(f"{steps} decisions, return {mean:.1f}, {rate:.0f} decisions/s", flush=True)
        if watch is not None:
            watch(steps, policy)
    envs.close()
    return policy, returns


def flat(array):
    """Return an array of all decisions of a rollout."""
    return array.reshape(-1, *array.shape[2:])


def improve(args, agent, optimiser, observed, acted, log_probs, gains, targets, values):
    """Improve the agent on the decisions of a rollout, by clipped losses of policy and value."""
    size = len(observed) // args.num_minibatches
    for _ in range(args.update_epochs):
        order = torch.randperm(len(observed))
        for part in order.split(size):
            actions, value = agent.distribution(observed[part]), agent.value(observed[part])
            ratio = (actions.log_prob(acted[part]).sum(1) - log_probs[part]).exp()
            gain = gains[part]
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            clipped = ratio.clamp(1.0 - args.clip_coef, 1.0 + args.clip_coef)
            of_policy = torch.max(-gain * ratio, -gain * clipped).mean()
            near = values[part] + (value - values[part]).clamp(-args.clip_coef, args.clip_coef)
            of_value = torch.max((value - targets[part]) ** 2, (near - targets[part]) ** 2).mean()
            optimiser.zero_grad()
            (of_policy + args.vf_coef * 0.5 * of_value).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), args.max_grad_norm)
            optimiser.step()


if __name__ == "__main__":
    policy, returns = train(arguments())
    few = max(1, len(returns) // 5)
    first, last = np.mean(returns[:few]), np.mean(returns[-few:])
    print(f"return of the first {few} episodes {first:.1f}, of the last {few} {last:.1f}")
