"""The plant served over loopback: rows of simulate, missed deadlines, refusals, reconnections."""

import struct
import time
from math import inf

import numpy as np
import pytest
from served import FAST, served, small_scene

import fowt_env
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.realtime.record import Flag, Kind, Record, unpack
from fowt_env.realtime.server import Server, Timing, check_timing, open_link
from fowt_env.run.stepped import SteppedRun

SILENT = Timing(factor=inf, timeout=0.02, hold=3)


def proportional(speed):
    """Blade pitch (deg) of a law of the generator speed, rpm."""
    return 14.92 + 0.05 * (speed - 1173.7)


class Law:
    """The same law as a controller in the process of simulate."""

    information = ("generator_speed",)

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return 43.09355 * 1e3, proportional(measurement.generator_speed * (30.0 / np.pi)) * DEGREE


def answer(record):
    """Command (kN m, deg) to a STATE whose only channel is GenSpeed."""
    return 43.09355, proportional(record.values()[0])


@pytest.mark.parametrize("protocol", ["tcp", "udp"])
def test_a_closed_loop_over_the_socket_has_the_rows_of_simulate(protocol):
    with served(protocol=protocol, channels=("GenSpeed",)) as (server, connect):
        client = connect()
        states = client.states(answer)
    assert [state.sequence for state in states] == list(range(31))
    assert [state.time for state in states] == pytest.approx(np.arange(31) * 0.1)
    assert client.about["channels"] == [{"name": "GenSpeed", "unit": "rpm"}]
    assert [each["name"] for each in client.about["commands"]] == ["GenTq", "BlPitchC1"]
    assert client.end["reason"] == server.reason == "end of the run"
    assert client.end["missed"] == client.end["malformed"] == client.end["refused_clients"] == 0
    expected = fowt_env.simulate(server.run.scene, Law(), 3.0)
    np.testing.assert_array_equal(server.run.frame(), expected)
    assert [state.values()[0] for state in states] == expected["GenSpeed_[rpm]"].tolist()


def test_a_silent_client_is_held_then_stopped_and_its_missed_deadlines_are_told():
    timing = SILENT._replace(then="feather")
    with served(1.0, timing=timing) as (server, connect):
        client = connect()
        first = client.receive()
        client.send(Kind.COMMAND, first.sequence, (40.0, 15.0))
        states = client.states()
    assert client.end["missed"] == 9 and client.end["longest_silence_[periods]"] == 9
    assert [state.missed for state in states] == list(range(10))
    held = [bool(state.flags & Flag.HELD) for state in states]
    stopping = [bool(state.flags & Flag.STOPPING) for state in states]
    assert held == [False] + 9 * [True]
    assert stopping == 3 * [False] + 7 * [True]  # three periods held, then the stop
    frame = server.run.frame()
    assert frame.attrs["stop"] == "emergency"
    assert (frame["GenTq_[kN-m]"][4:] == 0.0).all() and (frame["GenTq_[kN-m]"][:4] >= 40.0).all()


def test_a_silent_client_can_end_the_run_and_a_client_can_stop_it():
    with served(timing=SILENT._replace(then="end")) as (server, connect):
        connect().states()
    assert server.reason == "no command for 3 control periods"
    assert len(server.run.frame()) == 2
    with served() as (server, connect):
        client = connect()
        client.receive()
        client.send(Kind.STOP)
        assert client.receive().kind == Kind.END
    assert server.reason == "stopped by the client"


def test_a_late_command_is_the_one_held_and_one_from_the_future_is_refused():
    with served(0.4, timing=SILENT, channels=("GenTq",)) as (server, connect):
        client = connect()
        assert client.receive().sequence == 0
        client.send(Kind.COMMAND, 3, (1.0, 1.0))
        assert client.receive().json()["reason"].startswith("command of sequence 3")
        assert client.receive().sequence == 1  # the deadline of 0 has passed
        client.send(Kind.COMMAND, 0, (42.0, 15.0))
        while client.receive().kind != Kind.END:
            pass
    assert (server.missed, server.late, server.link.malformed) == (4, 1, 1)
    # from the instant after its arrival, at the rate limit of 15 kN m/s
    torque = server.run.frame()["GenTq_[kN-m]"].to_numpy()
    np.testing.assert_allclose(torque, [torque[0], 42.0, 42.0, 42.0, 42.0], atol=1e-9)


@pytest.mark.parametrize("protocol", ["tcp", "udp"])
def test_a_second_client_is_refused_until_the_first_has_gone(protocol):
    with served(1.0, protocol=protocol, timing=FAST._replace(timeout=3.0), channels=("GenTq",)) as (
        server,
        connect,
    ):
        first = connect()
        first.send(Kind.COMMAND, first.receive().sequence, (40.0, 15.0))
        assert first.receive().sequence == 1
        second = connect(hello=False)
        if protocol == "udp":
            second.send(Kind.HELLO)
        assert second.receive().kind == Kind.REFUSED
        if protocol == "tcp":  # over UDP it just falls silent
            first.socket.close()
        time.sleep(0.5)  # more than the patience of the server
        third = connect()
        states = third.states(lambda record: (40.0, 15.0))
    assert third.about["sequence"] >= 1 and states[-1].sequence == 10
    assert (server.link.refused, server.link.connections) == (1, 2)


def test_malformed_packets_are_refused_and_counted_and_the_run_goes_on():
    with served(0.5, protocol="udp", channels=("GenTq",)) as (server, connect):
        client = connect()
        state = client.receive()
        stranger = connect(hello=False)
        stranger.socket.send(b"GET / HTTP/1.1\r\n")
        stranger.send(Kind.COMMAND, 0, (1.0, 1.0))  # of another address: no command
        for bad in (b"", b"FOWT", bytes(64), Record(Kind.COMMAND, 0, payload=bytes(7)).pack()):
            client.socket.send(bad)
            assert client.receive().kind == Kind.REFUSED
        client.send(Kind.STATE)
        assert "only a server sends it" in client.receive().json()["reason"]
        client.send(Kind.COMMAND, 0, (float("nan"), 1.0))
        assert "not finite" in client.receive().json()["reason"]
        client.send(Kind.COMMAND, state.sequence, (40.0, 15.0))
        states = client.states(lambda record: (40.0, 15.0))
    assert (server.link.malformed, server.link.refused) == (7, 1)
    assert states[-1].sequence == 5 and server.missed == 0


def test_a_stream_that_is_not_of_records_is_closed():
    with served(0.5, channels=("GenTq",)) as (server, connect):
        browser = connect(hello=False)
        browser.socket.send(b"GET / HTTP/1.1\r\n\r\n")
        assert "closed" in browser.receive().json()["reason"]
        assert browser.socket.recv(1) == b""
        client = connect()
        client.states(lambda record: (40.0, 15.0))
    assert (server.link.malformed, server.missed) == (1, 0)


def test_the_silence_that_counts_is_without_a_break():
    with served(1.2, timing=SILENT._replace(then="end"), channels=("GenTq",)) as (server, connect):
        client = connect()
        client.states(lambda record: (43.0, 15.0), answered=lambda record: record.sequence % 3 == 2)
    assert server.reason == "end of the run"
    assert (server.missed, client.end["longest_silence_[periods]"]) == (8, 2)


def test_a_run_in_step_with_the_clock_takes_its_time():
    with served(2.0, timing=Timing(8.0), channels=("GenSpeed",)) as (_, connect):
        client = connect()
        begin = time.perf_counter()
        client.states(answer)
        took = time.perf_counter() - begin
    assert took > 0.2  # 20 periods of 12.5 ms, of which the first may begin before this client reads
    assert set(client.end["send_delay_[ms]"]) == {"p50", "p99", "p99.9", "max", "std", "share_below_1_ms"}


class ClockedLink:
    """A client that answers after a set time, by a clock that goes on only while the server waits."""

    malformed = refused = 0
    connections = 1

    def __init__(self, delay):
        self.delay, self.now, self.answers, self.sent = delay, 0.0, [], []

    def send(self, data):
        record = unpack(data)
        if record.kind == Kind.STATE:
            self.sent.append(self.now)
            command = Record(Kind.COMMAND, record.sequence, payload=struct.pack("<2d", 43.0, 15.0))
            self.answers.append((self.now + self.delay, command))

    def receive(self, timeout):
        if self.answers and self.answers[0][0] <= self.now + timeout:
            self.now = max(self.now, self.answers[0][0])
            return [self.answers.pop(0)[1]]
        self.now += max(timeout, 1e-6)
        return []


@pytest.mark.parametrize(("delay", "missed"), [(0.001, 0), (0.02, 0), (0.024, 40)])
def test_instants_do_not_drift_and_a_deadline_is_a_fraction_of_the_period(delay, missed, monkeypatch):
    link = ClockedLink(delay)
    server = Server(SteppedRun(small_scene(), 4.0, 0.1), link, Timing(4.0, deadline=0.9, hold=1000))
    server._ready = True
    monkeypatch.setattr("fowt_env.realtime.server.perf_counter", lambda: link.now)
    assert server.serve() == "end of the run"
    expected = 0.025 * np.arange(40)
    np.testing.assert_allclose(link.sent[:40], expected, atol=2e-6)  # with the delays added: 0.8 s later
    late = max(missed - 1, 0)  # the last one comes after the end
    assert (server.missed, server.late, server.overruns) == (missed, late, 0)
    assert server.statistics()["send_delay_[ms]"]["max"] < 0.01


def test_a_pause_is_caught_up_and_counted(monkeypatch):
    link = ClockedLink(0.001)
    server = Server(SteppedRun(small_scene(), 4.0, 0.1), link, Timing(4.0))
    server._ready = True
    monkeypatch.setattr("fowt_env.realtime.server.perf_counter", lambda: link.now)
    advance = server.run.advance

    def stalled(command):
        link.now += 0.06 if server._sequence == 10 else 0.0
        advance(command)

    monkeypatch.setattr(server.run, "advance", stalled)
    server.serve()
    late = np.array(link.sent[:40]) - 0.025 * np.arange(40)
    assert late[11] == pytest.approx(0.036, abs=1e-5)  # 1 ms to the answer, and the pause, less a period
    assert (late[:11] < 1e-5).all() and (late[13:] < 1e-5).all()
    assert (server.overruns, server.missed) == (2, 0)


def test_a_run_that_capsizes_tells_its_client_why():
    initial = {"start": "zero", "PtfmRVyi": 60.0}
    with served(4.0, initial=initial, channels=("PtfmPitch",)) as (server, connect):
        client = connect()
        client.states(lambda record: (0.0, 90.0))
    assert "capsize" in client.end["reason"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"factor": 0.0}, "factor = 0"), ({"factor": None}, "factor = None"), ({"factor": -inf}, "factor"),
        ({"deadline": 1.5}, "deadline = 1.5"), ({"deadline": 0.0}, "deadline = 0"),
        ({"timeout": inf}, "timeout = inf"), ({"hold": 0}, "hold = 0"), ({"then": "feathr"}, "'feather'"),
    ],
)  # fmt: skip
def test_a_wrong_timing_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        check_timing(Timing()._replace(**change))


def test_a_server_listens_where_it_is_told_and_nowhere_else():
    link = open_link("tcp", "127.0.0.1", 0, 1.0)
    host, port = link.address
    assert host == "127.0.0.1" and port > 0
    with pytest.raises(InputError, match=f"listen = 127.0.0.1:{port}"):
        open_link("tcp", "127.0.0.1", port, 1.0)
    link.close()
    with pytest.raises(InputError, match="'tcp'"):
        open_link("tpc", "127.0.0.1", 0, 1.0)
    with pytest.raises(InputError, match="listen = no.such.host.invalid"):
        open_link("udp", "no.such.host.invalid", 0, 1.0)
