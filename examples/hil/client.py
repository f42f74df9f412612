"""A client of `fowt connect serve` over TCP: OC3-Hywind's pitch controller, with the standard library alone.

python client.py [HOST PORT]  # after: fowt connect serve --wind ntm:18:B --control-dt 0.01
"""

import json
import socket
import struct
import sys

HELLO, READY, STATE, COMMAND = 1, 3, 4, 5
HEADER = struct.Struct("<4sHHIIIId")  # magic, version, kind, sequence, flags, missed, size, time


def send(kind, sequence=0, values=()):
    payload = struct.pack(f"<{len(values)}d", *values)
    server.sendall(HEADER.pack(b"FOWT", 1, kind, sequence, 0, 0, len(payload), 0.0) + payload)


def receive():
    _, _, kind, sequence, _, _, size, _ = HEADER.unpack(server.recv(32, socket.MSG_WAITALL))
    return kind, sequence, server.recv(size, socket.MSG_WAITALL)


server = socket.create_connection(sys.argv[1:3] or ("127.0.0.1", 5500))
server.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
send(HELLO)
about = json.loads(receive()[2])
names, period = [channel["name"] for channel in about["channels"]], about["control_dt_[s]"]
torque, integral = about["command_in_force"][:2]
send(READY)
while (record := receive())[0] == STATE:
    state = dict(zip(names, struct.unpack(f"<{len(names)}d", record[2]), strict=True))
    error = state["GenSpeed"] - 1173.7  # rpm
    schedule = 1.0 / (1.0 + state["BldPitch1"] / 6.302336)
    integral = min(max(integral + 0.00537909 * schedule * error * period, 0.0), 90.0)
    pitch = min(max(integral + 0.03765362 * schedule * error, 0.0), 90.0)
    send(COMMAND, record[1], (torque, pitch))  # kN m, deg
print(json.dumps(json.loads(record[2]), indent=1))  # END, with the statistics
