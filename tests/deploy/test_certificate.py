"""A station that speaks TLS itself, and whose certificate is renewed under it."""

import asyncio
import os
import re
import signal
import ssl
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from cryptography import x509

from server.system.certificate import CertificateError, ServedCertificate
from tests.deploy.authority import make_pair

ROOT = Path(__file__).parents[2]
LIMIT_S = 90.0


class Board:
    """Stands for the alarm board."""

    def __init__(self):
        self.raised = {}
        self.judged = asyncio.Event()

    async def raise_(self, cause, text, *, level):
        assert level == "warning"
        self.raised[cause] = text
        self._note(cause)

    async def clear(self, cause):
        self.raised.pop(cause, None)
        self._note(cause)

    def _note(self, cause):
        if cause == "certificate:expires":
            self.judged.set()


class Station:
    """``grace serve`` with certificate and key of a folder."""

    def __init__(self, data, tls, *options):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "server.cli", "serve", "--data", data, "--port", "0",
             "--tls-certificate", tls / "fullchain.pem", "--tls-key", tls / "key.pem", *options],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def url(self):
        found = re.search(r"https://\S+", self.process.stdout.readline())
        assert found is not None, self.process.stderr.read()
        return found[0]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.communicate(timeout=60)


def served_number(url):
    at = urlsplit(url)
    pem = ssl.get_server_certificate((at.hostname, at.port), timeout=30)
    return x509.load_pem_x509_certificate(pem.encode()).serial_number


def until(condition):
    give_up = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < give_up
        time.sleep(0.1)


def client_of(url, pair):
    trusts = ssl.create_default_context(cadata=pair.certificate.decode())
    return httpx.Client(base_url=url, verify=trusts, timeout=60.0)


@pytest.mark.process
def test_a_renewed_certificate_is_taken_up_without_a_restart_and_a_bad_one_is_not(tmp_path):
    first, second = make_pair(days=5), make_pair(days=90)
    tls, data = tmp_path / "tls", tmp_path / "data"
    first.write(tls)
    with Station(data, tls) as station:
        url = station.url()
        with client_of(url, first) as client:
            told = client.get("/api/health")
            assert told.json()["certificate_expires"] == (
                x509.load_pem_x509_certificate(first.certificate)
                .not_valid_after_utc.isoformat().replace("+00:00", "Z")
            )  # fmt: skip
            assert "max-age" in told.headers["Strict-Transport-Security"]
            until(lambda: client.get("/api/health").json()["unacknowledged_alarms"] >= 1)
            (tls / "fullchain.pem").write_bytes(second.certificate)  # its key is not there yet
            station.process.send_signal(signal.SIGHUP)
            until(lambda: client.get("/api/health").json()["unacknowledged_alarms"] >= 2)
            assert served_number(url) == first.number
            second.write(tls)
            station.process.send_signal(signal.SIGHUP)
            until(lambda: served_number(url) == second.number)
        with client_of(url, second) as client:
            client.get("/api/health").raise_for_status()


@pytest.mark.process
def test_a_station_does_not_start_with_a_key_of_another_certificate(tmp_path):
    tls = tmp_path / "tls"
    make_pair().write(tls)
    (tls / "key.pem").write_bytes(make_pair().key)
    with Station(tmp_path / "data", tls) as station:
        _, said = station.process.communicate(timeout=LIMIT_S)
    assert station.process.returncode == 1
    assert "key.pem cannot be used" in said.splitlines()[-1]


async def test_a_link_that_leads_to_another_certificate_is_noticed_by_itself(tmp_path, monkeypatch):
    monkeypatch.setattr("server.system.certificate.LOOK_PERIOD_S", 0.05)
    old, new = make_pair(days=90), make_pair(days=60)
    old.write(tmp_path / "old")
    new.write(tmp_path / "new")
    (tmp_path / "live").symlink_to("old")
    served = ServedCertificate(tmp_path / "live/fullchain.pem", tmp_path / "live/key.pem")
    before = served.expires
    os.symlink("new", tmp_path / "next")
    board = Board()
    watching = asyncio.create_task(served.watch(board))
    (tmp_path / "next").replace(tmp_path / "live")
    async with asyncio.timeout(60):
        while served.expires == before:  # noqa: ASYNC110 - it watches files
            await asyncio.sleep(0.02)
    watching.cancel()
    assert board.raised == {}


@pytest.mark.parametrize(("days", "said"), [(20, None), (13, "expires on"), (-1, "expired on")])
async def test_an_alarm_says_14_days_before_that_a_certificate_expires(tmp_path, days, said):
    served = ServedCertificate(*make_pair(days=days).write(tmp_path / "tls"))
    board = Board()
    watching = asyncio.create_task(served.watch(board))
    async with asyncio.timeout(60):
        await board.judged.wait()
    watching.cancel()
    text = board.raised.get("certificate:expires")
    assert (text is None) if said is None else said in text


def test_a_file_that_is_no_certificate_is_refused(tmp_path):
    pair = make_pair()
    certificate, key = pair.write(tmp_path / "tls")
    certificate.write_text("nothing")
    with pytest.raises(CertificateError, match=r"fullchain\.pem"):
        ServedCertificate(certificate, key)
