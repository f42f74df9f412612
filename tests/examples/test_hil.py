"""The clients of examples/hil control a plant over loopback, as their law does in the process of simulate."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import fowt

import fowt_env
from fowt_env.descriptions.units import DEGREE
from fowt_env.files.tables import read_series
from fowt_env.realtime.server import Server

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "hil"
PERIOD, DURATION = 0.01, 3.0
WEATHER = {"wind": "ntm:18:B", "seed": 2}


class Law:
    """The law of both clients; gains of the OC3-Hywind controller, 1/s and s rad/rad in deg and rpm."""

    information = ("generator_speed", "blade_pitch")

    def reset(self, measurement):
        self.integral = None

    def act(self, measurement):
        pitch = measurement.blade_pitch / DEGREE
        self.integral = pitch if self.integral is None else self.integral
        error = measurement.generator_speed * 30.0 / np.pi - 1173.7
        schedule = 1.0 / (1.0 + pitch / 6.302336)
        self.integral = min(max(self.integral + 0.00537909 * schedule * error * PERIOD, 0.0), 90.0)
        return 43093.55, min(max(self.integral + 0.03765362 * schedule * error, 0.0), 90.0) * DEGREE


def built(folder):
    """The client in C, compiled without a warning."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    subprocess.run([compiler, *flags, "-o", folder / "client", FOLDER / "client.c"], check=True)
    return [folder / "client"]


@pytest.mark.parametrize("protocol", ["tcp", "udp"])
def test_a_client_controls_the_plant_as_its_law_does_in_simulate(protocol, tmp_path, monkeypatch):
    program = [sys.executable, FOLDER / "client.py"] if protocol == "tcp" else built(tmp_path)
    serve, clients = Server.serve, []

    def with_client(server):
        address = [str(part) for part in server.link.address]
        clients.append(subprocess.Popen([*program, *address], stdout=subprocess.PIPE, text=True))
        return serve(server)

    monkeypatch.setattr(Server, "serve", with_client)
    out, report = tmp_path / "run.outb", tmp_path / "report.json"
    words = f"connect serve --protocol {protocol} --listen 127.0.0.1:0 --wind ntm:18:B --seed 2 --factor inf"
    words += f" --control-dt {PERIOD} --duration {DURATION} --channels GenSpeed,BldPitch1 --out {out}"
    stdout, stderr = fowt(*words.split(), "--report", str(report))
    assert "ended: end of the run" in stdout and f"listening on {protocol}://127.0.0.1:" in stderr
    (client,) = clients
    told = json.loads(client.communicate(timeout=10.0)[0])
    assert client.returncode == 0 and told["reason"] == "end of the run"
    statistics = json.loads(report.read_text())
    assert statistics["periods"] == 300 and statistics["missed"] == statistics["malformed"] == 0
    assert statistics["answer_[ms]"]["p50"] > 0.0
    rows = read_series(out)
    scene = fowt_env.build_scene("oc3_hywind", **WEATHER)
    expected = fowt_env.simulate(scene, Law(), DURATION, control_dt=PERIOD, output_dt=PERIOD)
    np.testing.assert_allclose(rows, expected, rtol=1e-7, atol=1e-7)
