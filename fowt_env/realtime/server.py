"""Runs a plant in real time for one client, with a deadline in every control period."""

import gc
import os
import platform
from math import isinf
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from fowt_env.descriptions.checks import check_number, check_whole_number
from fowt_env.descriptions.ratings import ratings
from fowt_env.errors import SimulationStopped, unknown
from fowt_env.loop.protection import Stop
from fowt_env.realtime.link import LINKS, Link
from fowt_env.realtime.record import (
    HEADER,
    VERSION,
    Flag,
    Kind,
    Malformed,
    Record,
    command_values,
    json_record,
)
from fowt_env.run.stepped import SteppedRun

LOOPBACK, PORT = "127.0.0.1", 5500
SPIN = 5e-4  # s before an instant in which the server polls instead of sleeping: a sleep ends late
IDLE = 0.1  # s between two looks at the sockets before the run
# what follows when a client has been silent for the periods of Timing.hold
SILENCE = {"hold": None, "stop": Stop.NORMAL, "feather": Stop.EMERGENCY, "end": Stop.END}
PERCENTILES = (50, 99, 99.9)


class Timing(NamedTuple):
    """Holds the pace of a server and what follows a missed deadline."""

    factor: float = 1.0  # simulated over wall-clock time; inf: as fast as the client answers
    deadline: float = 0.5  # fraction of a period, from the sending of a STATE to its command
    timeout: float = 5.0  # s, takes the place of the deadline at factor inf
    hold: int = 10  # control periods without a command after which `then` follows
    then: str = "hold"  # a key of SILENCE


def check_timing(timing: Timing) -> Timing:
    """Return a Timing after a check. Raises: InputError naming the field, value and allowed range."""
    check_number("factor", timing.factor, 0.0, low_open=True, infinite=True, allowed="positive, or inf")
    check_number("deadline", timing.deadline, 0.0, 1.0, low_open=True, allowed="in (0, 1] of a period")
    check_number("timeout", timing.timeout, 0.0, low_open=True, allowed="a positive number of seconds")
    check_whole_number("hold", timing.hold, 1)
    if timing.then not in SILENCE:
        raise unknown("then", timing.then, SILENCE)
    return timing


def open_link(protocol: str, host: str, port: int, patience: float) -> Link:
    """Return a Link that listens at an address; port 0: any free port. Raises: InputError.

    protocol: "tcp" or "udp"; patience (s): see Link.
    """
    if protocol not in LINKS:
        raise unknown("protocol", protocol, LINKS)
    check_whole_number("port", port, 0, 65535)
    return LINKS[protocol](host, port, patience)


class Server:
    """Advances a SteppedRun in step with the clock, under the commands of the client of a Link.

    At the instant of a control period the server sends its STATE, waits for the COMMAND that answers it, and
    advances the plant under that command, or under the one before if none arrives in time. The next STATE is
    thus computed ahead of its instant, and the loop has the delays of simulate and no others.

    channels: columns of simulate that a STATE contains; (): all. Raises: InputError for unknown ones.
    """

    def __init__(self, run: SteppedRun, link: Link, timing: Timing, channels: tuple[str, ...] = ()) -> None:
        self.run, self.link, self.timing = run, link, check_timing(timing)
        columns = [channel.column for channel in run.scene.channels]
        known = columns + [channel.name for channel in run.scene.channels]
        for name in channels:
            if name not in known:
                raise unknown("channel", name, known)
        self.chosen = np.array(
            [known.index(name) % len(columns) for name in channels] or range(len(columns)), dtype=np.intp
        )
        self._columns = [columns[i] for i in self.chosen]
        self._state = bytearray(HEADER.size + 8 * len(self.chosen))
        self._values = np.frombuffer(self._state, dtype="<f8", offset=HEADER.size)
        self._period = 0.0 if isinf(timing.factor) else run.control_dt / timing.factor  # s, wall clock
        self._command = run.command
        self._answered = -1  # sequence of the newest command
        self._sequence = 0  # of the newest STATE
        self._ready = self._ended = False
        self.missed = self.late = self.overruns = self.silent = self.longest = 0
        # s, of each period: delay of the sending, time to the command, time to advance the plant
        self._delays, self._answers, self._work = np.full((3, run.periods), np.nan)

    def description(self) -> dict[str, Any]:
        """Return the mapping of the DESCRIPTION."""
        run, timing, scene = self.run, self.timing, self.run.scene
        split = [column[:-1].split("_[") for column in self._columns]
        commands = [column[:-1].split("_[") for column in run.command_columns]
        return {
            "version": VERSION,
            "platform": scene.label,
            "channels": [{"name": name, "unit": unit} for name, unit in split],
            "commands": [{"name": name, "unit": unit} for name, unit in commands],
            "command_in_force": list(run.command),
            "control_dt_[s]": run.control_dt,
            "periods": run.periods,
            "factor": None if isinf(timing.factor) else timing.factor,
            "deadline_[s]": self._deadline,
            "hold_[periods]": timing.hold,
            "then": timing.then,
            "sequence": self._sequence,
            "ratings": ratings(scene.turbine),
        }

    @property
    def _deadline(self):
        """Return the time for an answer, s of the wall clock."""
        return self.timing.deadline * self._period if self._period else self.timing.timeout

    def serve(self) -> str:
        """Wait for a client, then run to the end; return the reason of the end.

        Collection of garbage is off during the run. Raises: SimulationStopped as simulate, after an END.
        """
        while not (self._ready or self._ended):
            self._hear(IDLE)
        gc.collect()
        gc.freeze()
        gc.disable()
        try:
            reason = self._periods()
        except SimulationStopped as error:
            reason = str(error)
            raise
        except KeyboardInterrupt:
            reason = "interrupted"
            raise
        finally:
            gc.enable()
            gc.unfreeze()
            self.link.send(json_record(Kind.END, {"reason": reason, **self.statistics()}, self._sequence))
        return reason

    def _periods(self):
        """Run the control periods; return the reason of the end."""
        run, begin, period = self.run, perf_counter(), self._period
        held = False
        for number in range(run.periods):
            self._fill(number, held)
            due = begin + number * period if period else perf_counter()
            if period and perf_counter() > due:
                self.overruns += number > 0
            self._wait(due)
            if self._ended:
                return "stopped by the client"
            sent = perf_counter()
            self._send_state(number)
            self._delays[number] = sent - due
            self._wait(sent + self._deadline, number)
            if self._ended:
                return "stopped by the client"
            held = self._answered != number
            if held:
                self._miss()
                if self._ended:
                    return f"no command for {self.silent} control periods"
            else:
                self.silent = 0
                self._answers[number] = perf_counter() - sent
            begun = perf_counter()
            run.advance(self._command)
            self._work[number] = perf_counter() - begun
        self._fill(run.periods, held)
        self._send_state(run.periods)
        return "end of the run"

    def _send_state(self, number):
        """Send the STATE to a client that is ready for it."""
        self._sequence = number
        if self._ready:
            self.link.send(self._state)

    def _fill(self, number, held):
        """Fill the STATE of the present control instant."""
        np.take(self.run.channels(), self.chosen, out=self._values)
        flags = Flag.STOPPING * self.run.is_stopping | Flag.HELD * held
        Record(Kind.STATE, number, self.run.time, flags, self.missed).pack_into(self._state)

    def _miss(self):
        """Count a missed deadline; after Timing.hold of them in a row do what is set."""
        self.missed += 1
        self.silent += 1
        self.longest = max(self.longest, self.silent)
        if self.silent == self.timing.hold:
            stop = SILENCE[self.timing.then]
            if stop == Stop.END:
                self._ended = True
            elif stop is not None:
                self.run.stop(stop)

    def _wait(self, moment, sequence=None):
        """Take records until an instant (perf_counter, s), or until a sequence has been answered."""
        while True:
            self._hear(max(moment - perf_counter() - SPIN, 0.0), sequence)
            if self._ended or sequence is not None and self._answered == sequence:
                return
            if perf_counter() >= moment:
                return

    def _hear(self, timeout, sequence=None):
        """Take the records that arrive within a time, s."""
        connections = self.link.connections
        records = self.link.receive(timeout)
        if self.link.connections != connections:  # a new client begins with HELLO and READY
            self._ready = False
        for record in records:
            self._take(record, sequence)

    def _take(self, record, sequence):
        """Do what a record asks for; sequence: of the period that waits for a command, else None."""
        if record.kind == Kind.HELLO:
            self.link.send(json_record(Kind.DESCRIPTION, self.description(), self._sequence))
        elif record.kind == Kind.READY:
            self._ready = True
        elif record.kind == Kind.STOP:
            self._ended = True
        elif record.kind != Kind.COMMAND:
            self.link.refuse(f"kind {record.kind.name}: only a server sends it")
        else:
            self._take_command(record, sequence)

    def _take_command(self, record, sequence):
        """Store a command, if it is newer than the one before."""
        try:
            values = command_values(record, len(self._command))
        except Malformed as error:
            self.link.refuse(str(error))
            return
        if record.sequence > self._sequence or not self._ready:
            self.link.refuse(f"command of sequence {record.sequence}: no STATE of it has been sent")
            return
        if record.sequence != sequence:
            self.late += 1
        if record.sequence > self._answered:
            self._command, self._answered = values, record.sequence

    def statistics(self) -> dict[str, Any]:
        """Return counts and times of the run, with the circumstances of the machine."""
        link = self.link
        times = {"send_delay": self._delays, "answer": self._answers, "advance": self._work}
        return {
            "periods": int(np.isfinite(self._work).sum()),
            "missed": self.missed,
            "longest_silence_[periods]": self.longest,
            "late_commands": self.late,
            "overruns": self.overruns,
            "malformed": link.malformed,
            "refused_clients": link.refused,
            "connections": link.connections,
            **{f"{name}_[ms]": _summary(values) for name, values in times.items()},
            "cores": os.cpu_count(),
            "load_of_1_min": os.getloadavg()[0],
            "python": platform.python_version(),
        }


def _summary(seconds):
    """Return percentiles, largest value and standard deviation in ms of times in s; {} of none."""
    known = 1e3 * seconds[np.isfinite(seconds)]
    if not known.size:
        return {}
    parts = {f"p{percent:g}": np.percentile(known, percent) for percent in PERCENTILES}
    parts |= {"max": known.max(), "std": known.std(), "share_below_1_ms": np.mean(known < 1.0)}
    return {name: round(float(value), 4) for name, value in parts.items()}
