"""A page as an operator has it open: in a browser that nothing records.

What drives a browser in tests has it keep the body of every answer, up to 100 MB, in the process of
the page. That would be measured instead of the page. This one is only asked for figures.
"""

import itertools
import json
import subprocess
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from tests.browser.walk import CHROMIUM, FLAGS

_PATIENCE_S: Final = 240.0
_DRAWS: Final = "document.querySelector('iframe')?.contentDocument?.querySelector('canvas') != null"


class PlainPage:
    """One page, spoken to by the protocol of the browser's inspector."""

    def __init__(self, line: Connection) -> None:
        self._line, self._numbers = line, itertools.count(1)

    def ask(self, method: str, **params: object) -> dict[str, Any]:
        """Return the answer to one request.

        Raises:
            RuntimeError: If the browser refuses it.
        """
        number = next(self._numbers)
        self._line.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            told = json.loads(self._line.recv(timeout=_PATIENCE_S))
            if told.get("id") == number:
                if "error" in told:
                    raise RuntimeError(f"{method}: {told['error']['message']}")
                return told["result"]

    def open(self, address: str) -> None:
        """Go to an address."""
        self.ask("Page.navigate", url=address)

    def wait_for(self, expression: str) -> None:
        """Wait until an expression of the page is true.

        Raises:
            TimeoutError: If that takes longer than four minutes.
        """
        give_up_s = time.monotonic() + _PATIENCE_S
        while not self.ask("Runtime.evaluate", expression=expression)["result"].get("value"):
            if time.monotonic() > give_up_s:
                raise TimeoutError(f"The page never came to: {expression}")
            time.sleep(0.5)

    def wait_for_scene(self) -> None:
        """Wait until the 3D view is there."""
        self.wait_for(_DRAWS)

    def cookies(self) -> dict[str, str]:
        """Return the page's cookies."""
        return {one["name"]: one["value"] for one in self.ask("Network.getCookies")["cookies"]}

    def heap(self) -> dict[str, float]:
        """Return what is left of the page's objects after garbage is collected."""
        self.ask("Performance.enable")
        self.ask("HeapProfiler.collectGarbage")
        told = {one["name"]: one["value"] for one in self.ask("Performance.getMetrics")["metrics"]}
        return {"page_heap_mb": told["JSHeapUsedSize"] / 1e6, "page_nodes": told["Nodes"]}


@contextmanager
def plain_page(address: str) -> Generator[PlainPage, None, None]:
    """Start a browser of its own with one page; both end with the block."""
    with tempfile.TemporaryDirectory(prefix="grace-page-") as folder:
        words = [CHROMIUM or "chromium", *FLAGS, "--headless", "--remote-debugging-port=0",
                 "--window-size=1600,950", f"--user-data-dir={folder}", address]  # fmt: skip
        quiet = subprocess.DEVNULL
        with subprocess.Popen(words, stdout=quiet, stderr=quiet) as browser:
            try:
                with connect(_page_of(Path(folder)), max_size=None) as line:
                    yield PlainPage(line)
            finally:
                browser.terminate()


def _page_of(folder: Path) -> str:
    """Wait for the browser; return where its page is spoken to."""
    told, give_up_s = folder / "DevToolsActivePort", time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up_s:
        if told.exists() and (port := told.read_text().partition("\n")[0]):
            targets = httpx.get(f"http://127.0.0.1:{port}/json", timeout=60).json()
            found = [one["webSocketDebuggerUrl"] for one in targets if one["type"] == "page"]
            if found:
                return found[0]
        time.sleep(0.2)
    raise TimeoutError("The browser opened no page.")
