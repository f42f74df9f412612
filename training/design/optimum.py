"""Computes a clairvoyant optimum: torque and blade pitch of least score in a known wind and sea.

    fowt design optimum --cases ntm_12 --seeds 1001,1002 --out results/optimum

Near rated wind, with lulls in which torque and blade pitch are at their limits, no linear limit holds. Here
the commands of each control period of one run are chosen with full knowledge of the plant, of the wind and of
the waves, so that the score of this run (score_model.py) is least: an iterative linear-quadratic regulator
(Li and Todorov, ICINCO 2004) with control limits (Tassa, Mansard and Todorov, ICRA 2014), which linearises
the run by the plant's own kernels (envs/jacobians.py) and accepts a step only if the score decreases. The
first commands are those of a controller.

The result is a local optimum of one weather: a value that can be reached with perfect foresight, hence an
upper estimate of the limit, not a bound that nothing can pass. Ranges and rates of torque and blade pitch
hold at each period; the suite's limits are penalties.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from fowt_env.analysis.linear_plant import STATE_STEPS
from fowt_env.controllers import make
from fowt_env.descriptions.checks import check_whole_number
from fowt_env.descriptions.platform import turbine_of
from fowt_env.descriptions.units import DEGREE
from fowt_env.envs import FowtEnv, PeriodJacobians
from fowt_env.envs.episode import STEP
from fowt_env.envs.jacobians import SETTLING
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import read_table, write_table
from fowt_env.plant.advance import forget, output
from fowt_env.plant.state import STATE_INDEX, STATES
from fowt_env.training.design.score_model import RunScore
from fowt_env.training.evaluation.case_environment import environment_settings
from fowt_env.training.evaluation.cases import chosen_cases, read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.run_case import CONTROL_DT, OK, REFERENCE
from fowt_env.training.evaluation.seeds import VALIDATION

START, OPTIMUM = "mpc", "optimum"  # controller of the first commands; label of the result
LIMITS, ITERATIONS = "above_rated_elastic", 15  # suite whose limits are penalties, too
LEAD = 60.0  # s before the scored part, from which commands are chosen
N_STATES, N_COMMANDS = len(STATES), 2
PLACES = np.array(STATE_INDEX)  # of STATES in the state of the plant
BLADE = STATES.index("blade_pitch")
COMMAND_STEPS = np.array([1.0, 1e-5])  # N m, rad, of the differences of outputs
NEAR = {  # rad and of rated speed, distances from the last run that a step keeps small
    "rotor_speed": 0.05, "platform_pitch": 0.3 * DEGREE, "blade_pitch": 1.0 * DEGREE,
}  # fmt: skip
NEAR_TORQUE = 0.05  # of rated torque
DAMPING, MOST_DAMPING = 0.1, 1e4  # first and largest weight of the distance
EASED, RAISED = 0.3, 5.0  # factors of the damping after a decrease and without one
FRACTIONS = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step that are tried
SETTLED = 2e-4  # decrease of the total, in an iteration, at which the search ends


class Run(NamedTuple):
    """Holds a run from the first chosen period: states (n + 1, 14) of STATES, commands (n, 2), its total."""

    states: np.ndarray
    commands: np.ndarray
    time: np.ndarray  # (rows,) s, of the scored rows
    rows: np.ndarray  # (rows, c) of the score's columns
    total: float


class Replay:
    """Applies stored commands (periods, 2), N m and rad, as a controller that knows the time alone."""

    information = ("time",)

    def __init__(self, commands, control_dt, name=OPTIMUM):
        self.commands, self.control_dt, self.name = commands, control_dt, name

    def reset(self, measurement):
        """Do nothing: the commands are functions of the time."""

    def act(self, measurement):
        """Return (generator torque, blade pitch) of the present control period."""
        period = min(round(measurement.time / self.control_dt), len(self.commands) - 1)
        return tuple(float(value) for value in self.commands[period])


class Search:
    """Searches the commands of least score in one case and weather seed.

    case, seed   a Case of a suite and its weather
    score        called with the columns of a run; returns a RunScore
    duration, skip  s, of the run and of its unscored start
    given        commands (periods, 2) to start from; None: those of the controller `start`
    Raises: InputError for a plant with states besides those of a rigid turbine, and if the first run ends
    early.
    """

    def __init__(self, case, seed, score, duration, skip, given=None, start=START):
        self.env = FowtEnv(**environment_settings(case, duration))
        self.followed = PeriodJacobians(self.env)
        self.followed.reset(options={"weather_seed": int(seed)})
        scene = self.scene = self.env.scene
        extra = [block.name for block in scene.blocks if block.offset >= N_STATES + 1]
        if scene.n_commands != N_COMMANDS or extra:
            raise InputError(
                f"case {case.name!r}: the optimum is of a rigid turbine with collective pitch; this plant has"
                f" {', '.join(extra) or 'a pitch of each blade'}"
            )
        self.dt = self.env.control_dt
        self.periods = round(duration / self.dt)
        self.first = max(SETTLING, round((skip - LEAD) / self.dt))
        self.scored = round(skip / self.dt)
        names = [channel.column for channel in scene.channels]
        self.score = score(names)
        self.columns = [names.index(name) for name in self.score.columns]
        self.scale = np.array([scene.channels[i].scale for i in self.columns])
        drive, law = scene.turbine.pitch_drive, scene.turbine.torque_law
        self.low, self.high = np.array([[0.0, drive.minimum], [law.max_torque, drive.maximum]])
        self.rate = self.dt * np.array([law.max_torque_rate, drive.rate_limit])
        near = dict(zip(STATES, np.full(N_STATES, np.inf), strict=True)) | NEAR
        near["rotor_speed"] *= scene.turbine.rated_rotor_speed
        sizes = np.r_[list(near.values()), NEAR_TORQUE * law.rated_torque, NEAR["blade_pitch"]]
        self.distances = np.r_[sizes, sizes[-2:]] ** -2.0
        data = scene.data()
        self.handle, self.row = scene.handle(data), np.empty(len(scene.channels))
        self.damping = DAMPING
        self.before, self.best = self._begin(given, start)

    def _begin(self, given, start):
        """Return (commands before the first chosen period, first Run), and keep the state between them."""
        controller = None
        if given is None:
            controller = make(start, self.scene.turbine, self.dt)
            controller.prepare(self.env.design_scene)
            controller.reset(self.env.measurement())
        before = []
        early = self.first - SETTLING
        for period in range(self.periods):
            if period == early:
                self.early = self.env.get_state()
            if period == self.first:
                self.snapshot = self.env.get_state()
            command = given[period] if controller is None else controller.act(self.env.measurement())
            before.append(command)
            _, _, ended, *_ = self.env.step_physical(*command)
            if ended:
                raise InputError(f"the first run ends early: {self.env._end}")
        whole = np.clip(np.array(before), self.low, self.high)
        chosen = whole[self.first :]
        before = whole[: self.first]
        run = self._run(lambda period, state, last: chosen[period])
        return before, run

    @property
    def commands(self):
        """Return the commands (periods, 2) of the best run, N m and rad."""
        return np.vstack([self.before, self.best.commands])

    def _run(self, policy):
        """Return the Run under commands policy(period, states, last command); None if it ends early."""
        self.env.set_state(self.snapshot)
        n = self.periods - self.first
        states, commands = np.empty((n + 1, N_STATES)), np.empty((n, N_COMMANDS))
        x = self.env._episode.x
        last = self.env._episode.u.copy()
        for period in range(n):
            states[period] = x[PLACES]
            last = commands[period] = policy(period, states[period], last)
            _, _, ended, *_ = self.env.step_physical(*last)
            if ended:
                return None
        states[n] = x[PLACES]
        rows = self.env.rows[self.scored :, self.columns] * self.scale
        time = self.dt * np.arange(self.scored, self.periods + 1)
        return Run(states, commands, time, rows, self.score.total(time, rows))

    def figures(self):
        """Return {"total", "score", and the metrics of the score} of the best run."""
        run, score = self.best, self.score
        named = {name: score.metric(name, run.time, run.rows) for name in score.terms}
        return {"total": run.total, "score": score.score(run.time, run.rows)} | named

    def improve(self):
        """Reduce the total of the best run by one iteration; return whether a step was accepted."""
        steps = self._linearised()
        while self.damping <= MOST_DAMPING:
            offsets, gains = self._backward(*steps)
            for fraction in FRACTIONS:
                run = self._run(self._policy(fraction, offsets, gains))
                if run is not None and run.total < self.best.total:
                    self.best = run
                    self.damping *= EASED if fraction == 1.0 else 1.0
                    return True
            self.damping *= RAISED
        return False

    def _policy(self, fraction, offsets, gains):
        """Return the policy of a fraction of the step with feedback on the best run, within the limits."""
        best, held = self.best, np.vstack([self.before[-1:], self.best.commands])

        def policy(period, state, last):
            away = np.r_[state - best.states[period], last - held[period]]
            change = held[period + 1] - held[period] + fraction * offsets[period] + gains[period] @ away
            low, high = np.maximum(-self.rate, self.low - last), np.minimum(self.rate, self.high - last)
            return last + np.minimum(np.maximum(change, low), high)

        return policy

    def _linearised(self):
        """Return (F, Q, q) of each period at the best run: dynamics, curvature and slope of the total.

        F (n, 16, 18): changes of states and last command at the end by states, last command and change of
        the command. Q (n, 18, 18) and q (n, 18) of the same 18 variables.
        """
        best, n, m = self.best, self.periods - self.first, N_COMMANDS
        self.followed.env.set_state(self.early)
        for period in range(self.first - SETTLING, self.first):
            self.followed.step_physical(*self.before[period])
        f = np.zeros((n, N_STATES + m, N_STATES + 2 * m))
        f[:, N_STATES:, N_STATES:] = np.tile(np.eye(m), 2)
        c, d = np.zeros((n, len(self.columns), N_STATES)), np.zeros((n, len(self.columns), m))
        for period in range(n):
            if period >= self.scored - self.first:
                c[period], d[period] = self._output_slopes(best.commands[period])
            info = self.followed.step_physical(*best.commands[period])[-1]
            jacobian = info["jacobian"]
            places = [jacobian.states.index(name) for name in STATES]
            f[period, :N_STATES, :N_STATES] = jacobian.state[np.ix_(places, places)]
            by_command = jacobian.command[places]
            f[period, :N_STATES, N_STATES:] = np.tile(by_command, 2)
        return f, *self._costs(f, np.concatenate([c, d, d], axis=2))

    def _output_slopes(self, command):
        """Return (by states (c, 14), by commands (c, 2)) of the score's columns at the present instant."""
        run, row = self.env._episode, self.row
        time, dx = run.counts[STEP] * self.env.dt, np.zeros_like(run.x)

        def at(x, u):
            forget(self.handle)
            output(self.handle, x, u, time, dx, row)
            return row[self.columns] * self.scale

        x, u = run.x.copy(), np.array(command)
        middle, slopes = at(x, u), []
        for array, places, sizes in ((x, PLACES, STATE_STEPS), (u, range(N_COMMANDS), COMMAND_STEPS)):
            for place, size in zip(places, sizes, strict=True):
                kept = array[place]
                array[place] = kept + size
                slopes.append((at(x, u) - middle) / size)
                array[place] = kept
        return np.array(slopes[:N_STATES]).T, np.array(slopes[N_STATES:]).T

    def _costs(self, f, by):
        """Return (Q, q) from the dynamics and the slopes `by` (n, c, 18) of the columns."""
        best, n, first = self.best, len(f), self.scored - self.first
        made = self.score.model(best.time, best.rows)
        g, h = np.zeros((2, n, len(self.columns)))
        g[first:], h[first:] = made.rows[:-1], made.row_curvature[:-1]
        q = np.einsum("nc,ncz->nz", g, by)
        curved = np.einsum("ncy,nc,ncz->nyz", by, h, by)
        g, h = np.zeros((2, n, len(self.columns)))
        g[first:], h[first:] = made.steps, made.step_curvature
        for name, slopes in (
            ("BldPitch1_[deg]", self._pitch_steps(f)), ("GenTq_[kN-m]", self._torque_steps(n)),
        ):  # fmt: skip
            if name in self.score.columns:
                place = self.score.columns.index(name)
                slopes = slopes * self.scale[place]
                q += g[:, place, None] * slopes
                curved += h[:, place, None, None] * slopes[:, :, None] * slopes[:, None, :]
        return curved, q

    def _pitch_steps(self, f):
        """Return the slopes (n, 18) of the increments of the blade pitch."""
        slopes = f[:, BLADE].copy()
        slopes[:, BLADE] -= 1.0
        return slopes

    def _torque_steps(self, n):
        """Return the slopes (n, 18) of the increments of the torque command, the row before to this row."""
        slopes = np.zeros((n, N_STATES + 2 * N_COMMANDS))
        slopes[:, N_STATES + N_COMMANDS] = 1.0
        return slopes

    def _backward(self, f, curved, q):
        """Return (offsets (n, 2), gains (n, 2, 16)) of the changes of the commands."""
        n, size = len(f), f.shape[1]
        v, slope = np.zeros((size, size)), np.zeros(size)
        offsets, gains = np.zeros((n, N_COMMANDS)), np.zeros((n, N_COMMANDS, size))
        held = np.vstack([self.before[-1:], self.best.commands])
        changes = np.diff(held, axis=0)
        low = np.maximum(-self.rate, self.low - held[:-1]) - changes
        high = np.minimum(self.rate, self.high - held[:-1]) - changes
        by_range = np.array([self.high - held[:-1] - changes <= high, self.low - held[:-1] - changes >= low])
        proximal = self.damping / n * np.diag(self.distances)
        for k in range(n - 1, -1, -1):
            move = f[k]
            whole = curved[k] + proximal + move.T @ v @ move
            first = q[k] + move.T @ slope
            inner = whole[size:, size:]
            offset, free = box_step(inner, first[size:], low[k], high[k])
            gain = np.zeros((N_COMMANDS, size))
            for j in np.flatnonzero(~free):
                at = 0 if offset[j] >= high[k, j] else 1
                if by_range[at, k, j]:  # the command stays at the end of its range
                    gain[j, N_STATES + j] = -1.0
            if free.any():
                inside = inner[np.ix_(free, free)]
                other = whole[size:][free][:, :size] + inner[np.ix_(free, ~free)] @ gain[~free]
                gain[free] = -np.linalg.solve(inside, other)
            offsets[k], gains[k] = offset, gain
            cross = whole[:size, size:]
            slope = first[:size] + gain.T @ (first[size:] + inner @ offset) + cross @ offset
            v = whole[:size, :size] + gain.T @ inner @ gain + cross @ gain + gain.T @ cross.T
            v = 0.5 * (v + v.T)
        return offsets, gains


def box_step(curved, slope, low, high):
    """Return (minimiser (2,), free (2,)) of x curved x/2 + slope x with low <= x <= high, exactly."""
    best, value, free = None, np.inf, None
    for fixed in ((), (0,), (1,), (0, 1)):
        for ends in np.ndindex(*(2,) * len(fixed)):
            x, open_ = np.zeros(2), np.ones(2, dtype=bool)
            for place, end in zip(fixed, ends, strict=True):
                x[place], open_[place] = (low, high)[end][place], False
            if open_.any():
                rest = slope[open_] + curved[np.ix_(open_, ~open_)] @ x[~open_]
                x[open_] = -np.linalg.solve(curved[np.ix_(open_, open_)], rest)
            if np.all(x >= low - 1e-15) and np.all(x <= high + 1e-15):
                here = 0.5 * x @ curved @ x + slope @ x
                if here < value:
                    best, value, free = x, here, open_
        if best is not None and not fixed:
            break
    return best, free


def optimum(
    cases,
    seeds,
    out,
    *,
    suite="above_rated",
    limits=LIMITS,
    start=START,
    iterations=ITERATIONS,
    progress=None,
):
    """Return (results, history) of clairvoyant optima, which are written to the folder `out`.

    cases       names of cases of a suite with a score; seeds: validation seeds
    limits      suite whose limits are penalties besides those of the suite, for channels of the run
    start       controller of the first commands
    iterations  most iterations of a case and seed, those of earlier calls included
    progress    called as progress(done, total, text) after each iteration

    results: rows as of evaluate, of the start, of the OPTIMUM and of the reference, with all metrics and the
    score as those of any controller. history: total, score and metrics after each iteration (0: the start).
    Files: results.csv, history.csv and commands_CASE_SEED.npz (time, s; torque, N m; pitch, rad), the latter
    written after every iteration, from which the same call continues.
    Raises: InputError for a suite without a score, unknown cases, seeds of the tests, and plants that Search
    does not support.
    """
    check_whole_number("iterations", iterations, 0)
    for seed in seeds:
        if seed < VALIDATION.start:
            raise InputError(f"seeds = {list(seeds)}: must be {VALIDATION.start} or more, as for all tuning")
    whole, folder = chosen_cases(suite, cases), Path(out)
    if whole.score is None:
        raise InputError(f"suite {whole.name!r}: has no score to minimise")
    bounds = [part for part in (whole.limits, read_suite(limits).limits) if part is not None]
    history = _stored(folder / "history.csv")
    results, done, total = _stored(folder / "results.csv"), 0, len(whole.cases) * len(seeds) * iterations
    for case in whole.cases:
        for seed in seeds:
            one = replace(whole, cases=(case,))
            if results.empty or not _rows(results, case, seed)["controller"].isin([start]).any():
                made = evaluate([start], one, seeds=(seed,))
                results = pd.concat([results, made], ignore_index=True)
                write_table(results, folder / "results.csv")
            here = _rows(results, case, seed).set_index("controller")
            if here.loc[start, "status"] != OK:
                raise InputError(f"case {case.name!r}, seed {seed}: {start!r} did not end well")
            file = folder / f"commands_{case.name}_{seed}.npz"
            search = (case, seed, one, here.loc[REFERENCE], bounds, start, iterations, file)

            def report(text, count, before=done):
                if progress is not None:
                    progress(before + count, total, text)

            history = _searched(*search, history, report)
            done += iterations
            replay = Replay(_commands(file), CONTROL_DT)
            made = evaluate({OPTIMUM: replay}, one, seeds=(seed,), reference=False)
            kept = results[~((results["controller"] == OPTIMUM) & _is(results, case, seed))]
            results = pd.concat([kept, made], ignore_index=True)
            write_table(results, folder / "results.csv")
    return results, history


def _searched(case, seed, suite, reference, bounds, start, iterations, file, history, report):
    """Return the history after the iterations of a case and seed, which is stored with the commands."""
    mine = _rows(history, case, seed)
    known = 0 if mine.empty or not file.is_file() else int(mine["iteration"].max())
    if known >= iterations or (known and mine["settled"].any()):
        report(f"{case.name}, seed {seed}: done", iterations)
        return history
    power = 1e-3 * turbine_of(case.platform).torque_law.rated_power
    power *= turbine_of(case.platform).drivetrain.generator_efficiency
    search = Search(
        case, seed, lambda names: RunScore(suite.score, reference, names, power, bounds),
        case.duration or suite.duration, suite.skip if case.skip is None else case.skip,
        _commands(file) if known else None, start,
    )  # fmt: skip
    for iteration in range(known, iterations + 1):
        settled = False
        if iteration > known:
            before = search.best.total
            settled = not search.improve() or before - search.best.total < SETTLED
        if iteration > known or not known:
            row = {"case": case.name, "seed": seed, "iteration": iteration, "settled": settled}
            history = pd.concat([history, pd.DataFrame([row | search.figures()])], ignore_index=True)
            with replacing(file) as path, path.open("wb") as stream:
                time = search.dt * np.arange(search.periods)
                np.savez(stream, time=time, torque=search.commands[:, 0], pitch=search.commands[:, 1])
            write_table(history, file.parent / "history.csv")
        report(f"{case.name}, seed {seed}: total {search.best.total:.4f}", iteration)
        if settled:
            break
    return history


def _commands(file):
    """Return the stored commands (periods, 2)."""
    with np.load(file, allow_pickle=False) as stored:
        return np.column_stack([stored["torque"], stored["pitch"]])


def _stored(file):
    """Return a table written before, or an empty one with the columns of a key."""
    return read_table(file) if file.is_file() else pd.DataFrame({"controller": [], "case": [], "seed": []})


def _is(table, case, seed):
    return (table["case"] == case.name) & (table["seed"] == seed)


def _rows(table, case, seed):
    """Return the rows of a case and seed."""
    return table[_is(table, case, seed)]
