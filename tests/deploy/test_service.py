"""The unit of systemd: that it fits systemd's words, and refuses nothing that the station needs."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

UNIT = Path(__file__).parents[2] / "deploy/grace.service"
ANALYZE = shutil.which("systemd-analyze")
with_systemd = pytest.mark.skipif(ANALYZE is None, reason="there is no systemd on this machine")


def analyze(*words):
    return subprocess.run(
        [ANALYZE, *map(str, words)], capture_output=True, text=True, check=False, timeout=60
    )


@pytest.fixture
def unit(tmp_path):
    """The unit of an installation that is there."""
    file = tmp_path / UNIT.name
    file.write_text(UNIT.read_text().replace("/opt/grace/current/bin/grace", shutil.which("true")))
    return file


@with_systemd
def test_systemd_understands_every_line(unit):
    done = analyze("verify", unit)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


@with_systemd
def test_what_the_page_says_of_its_rights_is_so(unit):
    told = analyze("security", "--offline=true", unit).stdout
    level = re.search(r"exposure level for grace\.service: ([\d.]+)", told)
    assert level is not None, told
    assert float(level[1]) < 2.5


def test_the_station_may_ask_the_kernel_whether_its_clock_is_kept_right():
    words = [line.split("=", 1) for line in UNIT.read_text().splitlines() if "=" in line]
    assert not [line for line in words if line[0] == "ProtectClock"]
    filters = [value for name, value in words if name == "SystemCallFilter"]
    assert filters.index("adjtimex clock_adjtime") > filters.index("~@privileged")
