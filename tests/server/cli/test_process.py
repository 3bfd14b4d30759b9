"""Processes that start, die, are started again, and leave nothing behind."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

from server.cli.demo import supervisor as supervisor_module
from server.cli.demo.supervisor import Child, Supervisor
from tests.server.recording.test_import import dive_csv
from tests.tcp_peer import serving

pytestmark = pytest.mark.process
ROOT = Path(__file__).parents[3]
WRITE_PID_AND_WAIT = (
    "import os,sys,time; open(sys.argv[1],'a').write(f'{os.getpid()}\\n'); time.sleep(600)"
)


def alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def wait_until(condition, limit_s=120.0):
    give_up = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < give_up
        time.sleep(0.02)


def serve(folder, *options):
    process = subprocess.Popen(
        [sys.executable, "-m", "server.cli", "serve", "--data", str(folder), "--port", "0",
         *options],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    line = process.stdout.readline()
    assert line.startswith("The station is at http://127.0.0.1:"), line
    return process, line.split()[-1]


def health(url):
    with urllib.request.urlopen(f"{url}/api/health", timeout=120) as answer:
        return json.load(answer)


def resident_mb(pid):
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_station_starts_small_and_stops_in_order(tmp_path, number):
    process, url = serve(tmp_path)
    with process:
        assert "use the code" in process.stdout.readline()
        assert health(url)["ready"]
        assert resident_mb(process.pid) < 400
        process.send_signal(number)
        assert process.wait(120) == 0
    with pytest.raises(OSError, match="refused"):
        health(url)


def test_a_recording_comes_in_through_a_running_station(tmp_path):
    folder, file = tmp_path / "data", tmp_path / "dive.csv"
    file.write_text(dive_csv(rows=12, broken=(4,)))
    process, url = serve(folder)

    def grace(*words, token=None):
        environment = os.environ | ({} if token is None else {"GRACE_TOKEN": token})
        return subprocess.run(
            [sys.executable, "-m", "server.cli", *words],
            cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip

    with process:
        token = grace("token", "create", "--role", "pilot", "--data", str(folder)).stdout.strip()
        order = ("import", str(file), "--robot", "eva", "--url", url)
        refused = grace(*order, token=token)
        assert refused.returncode == 1
        assert refused.stdout == "line 6: time is not a number: 'oops'\n"
        assert "Nothing was imported" in refused.stderr
        done = grace(*order, "--policy", "skip", token=token)
        assert "deployment-1 of eva: 11 rows imported, 1 left out." in done.stdout
        assert "token is unknown" in grace(*order, token="grace_wrong").stderr
        process.terminate()
        assert process.wait(120) == 0
    assert "does not answer" in grace(*order, token=token).stderr


def test_a_station_ends_when_whoever_started_it_is_killed(tmp_path):
    """The station is a grandchild: its parent is killed, and it must notice."""
    parent = subprocess.Popen(
        [sys.executable, "-c",
         "import os,subprocess,sys,time\n"
         "p = subprocess.Popen([sys.executable,'-m','server.cli','serve','--data',sys.argv[1],"
         "'--port','0','--parent-pid',str(os.getpid())], stderr=subprocess.DEVNULL)\n"
         "print(p.pid, flush=True); time.sleep(600)", str(tmp_path)],
        cwd=ROOT, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    with parent:
        station = int(parent.stdout.readline())
        assert parent.stdout.readline().startswith("The station is at")
        parent.kill()
        wait_until(lambda: not alive(station))


def test_the_station_never_loads_the_compiler():
    """numba costs 100 MB; planning and fitting load it in processes of their own."""
    code = "import sys, server.app; sys.exit('numba' in sys.modules or 'sklearn' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def pids(path):
    return [int(line) for line in path.read_text().split()] if path.exists() else []


def child(name, path, **more):
    return Child(name, (sys.executable, "-c", WRITE_PID_AND_WAIT, str(path)), **more)


async def until(condition, limit_s=120.0):
    async with asyncio.timeout(limit_s):
        while not condition():  # noqa: ASYNC110 - it watches another process
            await asyncio.sleep(0.02)


async def test_a_child_that_is_killed_is_started_again_and_the_other_goes_on(tmp_path, capsys):
    ready = []
    supervisor = Supervisor(
        (child("station", tmp_path / "a"), child("simulator", tmp_path / "b")),
        tmp_path / "log",
        lambda: ready.append(True),
    )
    running = asyncio.create_task(supervisor.run())
    await until(lambda: pids(tmp_path / "a") and pids(tmp_path / "b") and ready)
    assert ready == [True]
    os.kill(pids(tmp_path / "a")[0], signal.SIGKILL)
    await until(lambda: len(pids(tmp_path / "a")) == 2)
    assert "The station ended unexpectedly; starting it again." in capsys.readouterr().out
    assert len(pids(tmp_path / "b")) == 1
    os.kill(os.getpid(), signal.SIGTERM)
    assert await asyncio.wait_for(running, 120) == 0
    assert not any(alive(pid) for name in "ab" for pid in pids(tmp_path / name))


async def test_a_child_that_ends_again_and_again_ends_the_whole_with_its_last_words(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(supervisor_module, "QUICK_DEATH_S", 60.0)
    broken = Child("station", (sys.executable, "-c", "raise SystemExit('no such planet')"))
    supervisor = Supervisor(
        (broken, child("simulator", tmp_path / "b")), tmp_path / "log", lambda: None
    )
    assert await asyncio.wait_for(supervisor.run(), 120) == 1
    assert "no such planet" in capsys.readouterr().out
    assert not any(alive(pid) for pid in pids(tmp_path / "b"))


async def test_a_child_starts_when_there_is_what_it_awaits(tmp_path):
    port = tmp_path / "port"
    supervisor = Supervisor(
        (child("simulator", tmp_path / "a"), child("station", tmp_path / "b", awaits=(port,))),
        tmp_path / "log",
        lambda: None,
    )
    running = asyncio.create_task(supervisor.run())
    await until(lambda: pids(tmp_path / "a"))
    assert not (tmp_path / "log" / "station.log").exists()
    port.touch()
    await until(lambda: pids(tmp_path / "b"))
    os.kill(os.getpid(), signal.SIGTERM)
    assert await asyncio.wait_for(running, 120) == 0


async def test_a_station_that_is_slow_to_start_is_waited_for(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(supervisor_module, "SLOW_S", 0.0)
    monkeypatch.setattr(supervisor_module, "HEALTH_PERIOD_S", 0.01)
    is_ready, announced = asyncio.Event(), asyncio.Event()

    async def answer(reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        body = json.dumps({"ready": is_ready.is_set()}).encode()
        head = f"HTTP/1.1 200 OK\r\nContent-Length: {len(body)}\r\nConnection: close\r\n\r\n"
        writer.write(head.encode() + body)
        await writer.drain()

    async with serving(answer) as port:
        url = f"http://127.0.0.1:{port}/api/health"
        station = child("station", tmp_path / "a", health_url=url)
        supervisor = Supervisor((station,), tmp_path / "log", announced.set)
        running = asyncio.create_task(supervisor.run())
        said = []

        def waits():
            said.append(capsys.readouterr().out)
            return "takes longer than 0 s to start; still waiting" in "".join(said)

        await until(waits)
        is_ready.set()
        await asyncio.wait_for(announced.wait(), 120)
        os.kill(os.getpid(), signal.SIGTERM)
        assert await asyncio.wait_for(running, 120) == 0
