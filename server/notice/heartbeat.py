"""A sign of life to who watches the station: its silence is an alarm there ("dead man").

A request goes out every few minutes of the wall, whatever the robots' clock does. That the watcher
does not answer is an alarm of this station; that it heard nothing is one of the watcher's.
"""

import asyncio
import contextlib
from dataclasses import dataclass
from datetime import datetime
from typing import Final
from urllib.parse import urlsplit

import httpx
from pydantic import BaseModel, ConfigDict, Field, field_validator

from db.fault import StoreUnavailableError
from robot_link.clock import set_or_after
from server.base.foundation import Foundation
from server.base.secret import SecretUnreadableError, secret_fault
from server.notice.settings import NoticeSettings, read_settings

CAUSE: Final = "heartbeat"
HEARTBEAT: Final = "heartbeat"
"""Name of the secret that holds the watcher's address."""
PATIENCE_S: Final = 10.0
FAILURES_BEFORE_ALARM: Final = 2
_REPLY_LENGTH_MAX: Final = 200
_MINUTE_S: Final = 60.0


class WatcherAddress(BaseModel):
    """Where the sign of life goes; whoever knows it can feign one."""

    model_config = ConfigDict(frozen=True, extra="forbid", hide_input_in_errors=True)

    url: str = Field(max_length=1000)

    @property
    def host(self) -> str:
        """Return what may be shown of it."""
        return urlsplit(self.url).hostname or ""

    @field_validator("url")
    @classmethod
    def _is_web(cls, value: str) -> str:
        try:
            parts = urlsplit(value)
            is_web = parts.scheme in ("http", "https") and bool(parts.hostname)
            _ = parts.port
        except ValueError:
            is_web = False
        if not is_web or not value.isprintable() or " " in value:
            raise ValueError("url is https://..., as the watching service shows it")
        return value


@dataclass(frozen=True, slots=True)
class Beat:
    """What came of the last sign of life."""

    at: datetime
    is_heard: bool
    reply: str
    """Status and words of the watcher, or why there are none."""


class Heartbeat:
    """Sends signs of life until cancelled. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        self._changed = asyncio.Event()
        self._failures = 0
        self.last: Beat | None = None
        """Of this run of the station."""

    def change(self) -> None:
        """Take that address or period are others; a sign of life goes out at once."""
        self._changed.set()

    async def run(self) -> None:
        """Send one every period while there is an address, though the database cannot be read."""
        settings = NoticeSettings()
        while True:
            self._changed.clear()
            with contextlib.suppress(StoreUnavailableError):
                settings = await self._foundation.store.query(read_settings)
            is_watched = await self.beat() is not None
            period_s = settings.heartbeat_minutes * _MINUTE_S
            await set_or_after(self._changed, period_s if is_watched else None)

    async def beat(self) -> Beat | None:
        """Send one now and return what came of it; None where nobody watches."""
        alarms, clock = self._foundation.alarms, self._foundation.clock
        try:
            text = await asyncio.to_thread(self._foundation.secrets.notice_address, HEARTBEAT)
            if text is None:
                self.last, self._failures = None, 0
                await alarms.clear(CAUSE)
                return None
            url = WatcherAddress.model_validate_json(text).url
        except (SecretUnreadableError, OSError) as error:
            reply, is_heard = secret_fault(error), False
        except ValueError:
            reply, is_heard = "Its address is damaged; enter it again.", False
        else:
            reply, is_heard = await _ask(url)
        self.last = Beat(clock.now(), is_heard, reply)
        self._failures = 0 if is_heard else self._failures + 1
        if is_heard:
            await alarms.clear(CAUSE)
        elif self._failures >= FAILURES_BEFORE_ALARM:
            await alarms.raise_(CAUSE, f"The station's sign of life is not heard: {reply}")
        self._foundation.feed.mark("notices")
        return self.last


async def _ask(url: str) -> tuple[str, bool]:
    """Send one request; what it says of a fault holds no address."""
    try:
        async with (
            asyncio.timeout(PATIENCE_S),
            # of two limits that are over at once the other one might be told
            httpx.AsyncClient(timeout=None, follow_redirects=True) as client,
            client.stream("POST", url) as answer,
        ):
            words = b""
            async for piece in answer.aiter_bytes(_REPLY_LENGTH_MAX):
                words = piece[:_REPLY_LENGTH_MAX]
                break
    except TimeoutError:
        return f"No answer within {PATIENCE_S:.0f} s.", False
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        return f"It could not be reached ({type(error).__name__}).", False
    said = " ".join(words.decode(errors="replace").split())
    text = f"HTTP {answer.status_code} {answer.reason_phrase}" + (f": {said}" if said else "")
    return text, answer.is_success
