"""Figures of a journey: each step's beside what it must be, printed as the journey goes."""

import sys
from datetime import datetime
from pathlib import Path
from typing import Any

from playwright.sync_api import Page

from server.base.clock_file import ClockAnchors
from server.cli.data_folder import CLOCK_FILE

FOLDER = Path("build/journey")
WATCH = """
window.told = [];
const Plain = window.WebSocket;
window.WebSocket = class extends Plain {
  constructor(...words) {
    super(...words);
    this.addEventListener('message', ({ data }) => {
      for (const [robot, { channels }] of Object.entries(JSON.parse(data).robots ?? {})) {
        const { value, measured_at, received_at } = channels?.CHANNEL ?? {};
        if (value !== undefined)
          window.told.push({ at_ms: Date.now(), robot, value, measured_at, received_at });
      }
    });
  }
};
"""


class Journey:
    """Keeps and prints what was measured, step by step."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._lines: list[str] = []

    def tell(self, step: str, must: str, figure: str) -> None:
        """Print one figure beside its acceptance, and keep all of them as a table."""
        self._lines.append(f"| {self._name}.{step} | {must} | {figure} |")
        sys.stdout.write(f"\n{self._name}.{step}: {figure} (must: {must})\n")
        FOLDER.mkdir(parents=True, exist_ok=True)
        head = ["| step | must | measured |", "|---|---|---|"]
        text = "\n".join([*head, *self._lines]) + "\n"
        (FOLDER / f"{self._name}.md").write_text(text)


def watch_channel(page: Page, channel: str) -> None:
    """Let the pages that are opened from now on note each value of a channel as it comes live."""
    page.add_init_script(WATCH.replace("CHANNEL", channel))


def told_live(page: Page) -> list[dict[str, Any]]:
    """Return what the open page has noted: values, their times, and when they came (``at_ms``)."""
    return page.evaluate("window.told")


def wall_s(data: Path, at: str) -> float:
    """Return the moment of the wall, s since 1970, at which a demo's clock showed ``at``."""
    anchors = ClockAnchors.model_validate_json((data / CLOCK_FILE).read_text())
    passed = (datetime.fromisoformat(at) - anchors.time_anchor).total_seconds()
    return anchors.wall_anchor.timestamp() + passed / anchors.speed
