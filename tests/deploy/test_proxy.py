"""The station behind Caddy and nginx, by the files that an administrator gets."""

import io
import json
import os
import re
import shutil
import socket
import ssl
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect
from websockets.sync.client import connect

from tests.browser.walk import CHROMIUM, chromium, expect_scene
from tests.deploy.authority import make_pair
from tests.free_port import free_port

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
GRACE = [sys.executable, "-m", "server.cli"]
LIMIT_S = 240.0
PASSWORD = "correct horse battery"
UPLOAD_BYTES = 50 * 2**20
PROXIES = {
    "caddy": shutil.which("caddy"),
    "nginx": shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin"),
}
pytestmark = [pytest.mark.process, pytest.mark.timeout(900)]


def caddy(folder, site, upstream):
    """Return the command of Caddy with our file, and the authority that it makes for itself."""
    own = "{\n\tadmin off\n\tskip_install_trust\n\tauto_https disable_redirects\n}\n"
    file = folder / "Caddyfile"
    file.write_text(own + (DEPLOY / "Caddyfile").read_text())
    environment = {
        **os.environ,
        "GRACE_SITE": f"localhost:{site}",
        "GRACE_UPSTREAM": f"127.0.0.1:{upstream}",
        "XDG_DATA_HOME": str(folder / "caddy-data"),
        "HOME": str(folder),
    }
    trusted = folder / "caddy-data/caddy/pki/authorities/local/root.crt"
    command = [PROXIES["caddy"], "run", "--adapter", "caddyfile", "--config", str(file)]
    return command, environment, trusted


def nginx(folder, site, upstream):
    """Return the command of nginx with our file, and a certificate made for it now."""
    certificate, key = make_pair().write(folder / "tls")
    ours = (DEPLOY / "nginx.conf").read_text()
    for written, here in (
        ("station.example.org", "localhost"),
        ("/etc/grace/tls/fullchain.pem", str(certificate)),
        ("/etc/grace/tls/key.pem", str(key)),
        ("127.0.0.1:8000", f"127.0.0.1:{upstream}"),
        ("listen 443 ", f"listen 127.0.0.1:{site} "),
        ("listen 80;", f"listen 127.0.0.1:{free_port()};"),
    ):
        assert written in ours
        ours = ours.replace(written, here)
    kept = "".join(
        f"{kind}_temp_path {folder}/{kind};\n"
        for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    file = folder / "nginx.conf"
    file.write_text(
        f"pid {folder}/pid;\nerror_log stderr;\nevents {{}}\n"
        f"http {{\naccess_log off;\n{kept}{ours}}}\n"
    )
    command = [PROXIES["nginx"], "-p", str(folder), "-c", str(file), "-g", "daemon off;"]
    return command, dict(os.environ), certificate


class Behind:
    """A station, the proxy before it, and somebody who may sign in."""

    def __init__(self, kind, folder):
        site, inner = free_port(), free_port()
        self.url = f"https://localhost:{site}"
        self.data = folder / "data"
        self.grace("user", "add", "ann", "--role", "admin", typed=PASSWORD)
        link = f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}?listen=1"
        self.grace(
            "robot", "add", "eva", "--system", "21", "--model", "miniglider", "--water",
            "test-tank", "--unsigned", "--link", link,
        )  # fmt: skip
        self._log = (folder / "log").open("w")
        make = caddy if kind == "caddy" else nginx
        command, environment, trusted = make(folder, site, inner)
        self._processes = [
            self._start([*GRACE, "serve", "--data", str(self.data), "--port", str(inner),
                         "--behind-proxy", "--public-origin", self.url], dict(os.environ)),
            self._start(command, environment),
        ]  # fmt: skip
        give_up = time.monotonic() + LIMIT_S
        while not self._is_there(trusted):
            assert time.monotonic() < give_up, (folder / "log").read_text()
            time.sleep(0.1)

    def _start(self, command, environment):
        return subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=self._log, stderr=subprocess.STDOUT
        )

    def _is_there(self, trusted):
        try:
            self.trust = ssl.create_default_context(cafile=trusted)
            with self.client() as client:
                return client.get("/api/health").is_success
        except (OSError, httpx.HTTPError):
            return False

    def client(self, **headers):
        return httpx.Client(base_url=self.url, verify=self.trust, timeout=LIMIT_S, headers=headers)

    def grace(self, *words, typed=None):
        done = subprocess.run(
            [*GRACE, *words, "--data", str(self.data)], cwd=ROOT, capture_output=True, text=True,
            check=False, input=typed and f"{typed}\n", timeout=LIMIT_S,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def stop(self):
        for process in reversed(self._processes):
            process.terminate()
        for process in self._processes:
            process.wait(60)
        self._log.close()


@pytest.fixture(scope="module", params=PROXIES)
def behind(request, tmp_path_factory):
    if PROXIES[request.param] is None:
        pytest.skip(f"there is no {request.param} on this machine")
    behind = Behind(request.param, tmp_path_factory.mktemp(request.param))
    yield behind
    behind.stop()


@pytest.fixture
def ann(behind):
    with behind.client() as client:
        answer = client.post("/api/session", json={"name": "ann", "password": PASSWORD})
        client.headers["X-CSRF-Token"] = answer.raise_for_status().json()["csrf_token"]
        yield client


def test_a_person_signs_in_and_the_browser_is_told_to_stay_with_tls(ann):
    answer = ann.get("/api/session")
    assert answer.json()["name"] == "ann"
    assert answer.headers.get_list("Strict-Transport-Security") == ["max-age=31536000"]
    cookies = {cookie.name: cookie.secure for cookie in ann.cookies.jar}
    assert cookies
    assert all(cookies.values())


def test_the_live_feed_comes_through(behind, ann):
    ticket = ann.post("/api/session/ticket").raise_for_status().json()["ticket"]
    address = behind.url.replace("https", "wss") + f"/api/live?ticket={ticket}"
    with connect(address, ssl=behind.trust, origin=behind.url, open_timeout=60) as feed:
        assert json.loads(feed.recv(timeout=60))


def test_a_long_poll_is_answered_when_something_happens_and_not_before(behind, ann):
    newest = ann.get("/api/events").raise_for_status().json()["next"]
    waiting = {"after": newest, "kind": "person.signed_in", "wait_s": 25}
    with ThreadPoolExecutor() as pool:
        polls = [pool.submit(ann.get, "/api/events", params=waiting) for _ in range(4)]
        assert not wait(polls, timeout=1.0).done
        with behind.client() as other:
            other.post("/api/session", json={"name": "ann", "password": PASSWORD})
        told = [poll.result().raise_for_status().json()["events"] for poll in polls]
    assert [[event["text"] for event in events] for events in told] == [["ann signed in."]] * 4


def test_a_file_of_50_mb_comes_through(ann):
    rows = b"2026-01-01T00:00:00Z,4.5,12.0\n"
    content = b"time,depth,temperature\n" + rows * (UPLOAD_BYTES // len(rows) + 1)
    answer = ann.post("/api/imports/uploads", files={"files": ("long.csv", io.BytesIO(content))})
    assert answer.status_code == 202, answer.text
    job = answer.json()
    give_up = time.monotonic() + LIMIT_S
    while job["state"] not in ("done", "failed"):
        assert time.monotonic() < give_up, job
        job = ann.get(f"/api/jobs/{job['id']}", params={"wait_s": 20, "until": "end"}).json()
    assert job["state"] == "done", job["message"]


def test_an_address_that_somebody_makes_up_is_no_way_around_the_pause_after_wrong_passwords(behind):
    wrong = {"name": "nobody", "password": "wrong horse battery"}
    answers = []
    for number in range(7):
        with behind.client(**{"X-Forwarded-For": f"203.0.113.{number}"}) as client:
            answers.append(client.post("/api/session", json=wrong).status_code)
    assert answers[:5] == [401] * 5
    assert answers[5:] == [429] * 2


@pytest.mark.browser
@pytest.mark.walk
@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")
def test_the_page_is_live_and_the_3d_view_draws_in_a_browser(behind):
    way_in = re.search(r"/sign-in\?\S+", behind.grace("user", "link", "ann"))
    assert way_in is not None
    with chromium() as browser:
        page = browser.new_context(ignore_https_errors=True).new_page()
        page.context.set_default_timeout(240_000)
        page.goto(f"{behind.url}{way_in[0]}")
        page.goto(f"{behind.url}/robot/eva")
        expect(page.get_by_role("status").get_by_text("Live", exact=True)).to_be_visible()
        expect_scene(page)
        page.context.close()
