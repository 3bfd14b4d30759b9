"""The dashboard and the alerts that come with the station, against a real station."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.free_port import free_port
from tests.server.conftest import MINI, StationClient, until
from tests.server.watch.test_metrics import figures_of

DEPLOY = Path(__file__).parents[3] / "deploy"
DASHBOARD = json.loads((DEPLOY / "grafana-dashboard.json").read_text())
RULES = DEPLOY / "prometheus-alerts.yml"
_NAME = re.compile(r"\b(?:grace|process)_[a-z0-9_]+\b")
ON_DEMAND = {
    "grace_jobs_total", "grace_jobs_running", "grace_robot_link_frames_total",
    "grace_robot_samples_total", "grace_robot_acknowledgement_lag_seconds",
    "grace_robot_clock_offset_seconds", "grace_robot_plan_state", "grace_satellite_outbox_rows",
    "grace_satellite_credits_today", "grace_satellite_credits_per_day",
    "grace_clock_synchronised", "grace_clock_max_error_seconds", "grace_metrics_failures_total",
    "grace_robot_link_silence_seconds",
}  # fmt: skip
"""Figures that are there once there is something to tell; each family is declared in the code."""


def expressions() -> list[str]:
    return [target["expr"] for panel in DASHBOARD["panels"] for target in panel["targets"]]


async def test_every_metric_of_dashboard_and_alerts_is_one_that_the_station_tells(
    client: StationClient,
):
    await client.get("/api/session")
    told = {name for name, _ in figures_of((await client.get("/metrics")).text)}
    source = "".join(one.read_text() for one in (DEPLOY.parent / "server").rglob("*figures.py"))
    source += "".join(
        (DEPLOY.parent / "server" / one).read_text()
        for one in ("satellite/install.py", "watch/station_clock.py", "base/metric/metrics.py")
    )
    wanted = set(_NAME.findall(" ".join(expressions()) + RULES.read_text()))
    assert len(wanted) > 30
    for name in wanted - told:
        assert name in ON_DEMAND, name
        assert f'"{name.removeprefix("grace_").removesuffix("_total")}"' in source, name


def test_no_panel_covers_another_and_each_has_its_own_number():
    panels: list[dict[str, Any]] = DASHBOARD["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    covered = {
        (x, y)
        for panel in panels
        for x in range(panel["gridPos"]["x"], panel["gridPos"]["x"] + panel["gridPos"]["w"])
        for y in range(panel["gridPos"]["y"], panel["gridPos"]["y"] + panel["gridPos"]["h"])
    }
    assert len(covered) == sum(one["gridPos"]["w"] * one["gridPos"]["h"] for one in panels)


needs_prometheus = pytest.mark.skipif(
    shutil.which("prometheus") is None or shutil.which("promtool") is None,
    reason="there is no prometheus on this machine",
)


@needs_prometheus
@pytest.mark.process
def test_promtool_finds_no_fault_in_settings_and_alerts(tmp_path: Path):
    for name in ("prometheus.yml", "prometheus-alerts.yml"):
        shutil.copy(DEPLOY / name, tmp_path)
    (tmp_path / "grace-token").write_text("none")
    command = ["promtool", "check", "config", "prometheus.yml"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "12 rules found" in run.stdout + run.stderr


@pytest.fixture
def prometheus(tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """Where a Prometheus is told what to read, and its own address."""
    address = f"127.0.0.1:{free_port()}"
    folder = tmp_path / "prometheus"
    folder.mkdir()
    (folder / "prometheus.yml").write_text("global: {scrape_interval: 1s}\n")
    shutil.copy(RULES, folder)
    with (folder / "prometheus.log").open("wb") as log:
        process = subprocess.Popen(
            ["prometheus", "--config.file=prometheus.yml", f"--web.listen-address={address}",
             "--storage.tsdb.path=kept", "--web.enable-lifecycle"],
            cwd=folder, stdout=log, stderr=log,
        )  # fmt: skip
    yield folder, f"http://{address}"
    process.terminate()
    process.wait(60)


@needs_prometheus
@pytest.mark.process
async def test_a_real_prometheus_answers_every_question_of_the_dashboard(
    prometheus: tuple[Path, str], client: StationClient, address: str
):
    folder, prometheus_url = prometheus
    (folder / "grace-token").write_text(client.headers["Authorization"].removeprefix("Bearer "))
    text = (DEPLOY / "prometheus.yml").read_text()
    text = text.replace("127.0.0.1:8000", address).replace("15s", "1s")
    (folder / "prometheus.yml").write_text(text)
    async with httpx.AsyncClient(base_url=prometheus_url, timeout=30.0) as asking:

        async def ask(question: str) -> list[Any]:
            answer = await asking.get("/api/v1/query", params={"query": question})
            assert answer.status_code == 200, f"{question}: {answer.text}"
            return answer.json()["data"]["result"]

        async def reloaded() -> bool:
            try:
                return (await asking.post("/-/reload")).status_code == 200
            except httpx.TransportError:
                return False

        async def is_up() -> bool:
            found = await ask('up{job="grace"}')
            return bool(found) and found[0]["value"][1] == "1"

        await until(reloaded)
        await until(is_up)
        for question in expressions():
            await ask(question)
        (battery,) = await ask("grace_robot_battery_ratio")
        assert battery["metric"]["robot"] == MINI
        rules = (await asking.get("/api/v1/rules")).json()["data"]["groups"][0]["rules"]
        assert {rule["health"] for rule in rules} <= {"ok", "unknown"}
