"""A station in a process of its own that tells people of a leak, and is killed over it.

    python -m tests.server.notice.doomed_station DATA_DIR HOOK MOMENT [HOOK_OF_THE_NEXT]

It says each event of a notice once that is kept. Of itself it dies at the moments ``written``, when
the message is in the outbox, and ``answered``, when the service took it and before that is kept;
at any other it lives until it is killed.
"""

import asyncio
import os
import signal
import sys
from pathlib import Path
from typing import Any

from server.base.event_bus import EventLogged
from server.notice import contact, delivery
from server.notice.sender import Sender
from tests.server.fake_link import World
from tests.server.notice.conftest import PATIENT, TIME_LIMITS, notice_station


def die(*_: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


async def die_soon(*_: Any) -> None:
    die()


def say(event: EventLogged) -> None:
    """Tell who watches what is kept of notices."""
    if event.event.kind.startswith("notice."):
        sys.stdout.write(f"{event.event.kind}\n")
        sys.stdout.flush()


async def main(folder: Path, hook: str, moment: str, *next_hook: str) -> None:
    """Raise a leak of which ann is told, and ben ten minutes later; live until killed."""
    delivery.BACK_OFF_S = (600.0,)  # pyright: ignore[reportConstantRedefinition]
    setattr(Sender, "__init__", PATIENT)  # noqa: B010 - the type checker takes no other form
    contact.TIME_LIMITS = TIME_LIMITS  # pyright: ignore[reportConstantRedefinition]
    async with notice_station(folder, World()) as here:
        here.foundation.bus.subscribe(EventLogged, say)
        for name, url in zip(("ann", "ben"), (hook, *next_hook), strict=False):
            await here.person(name)
            await here.contact(name, url)
        if next_hook:
            await here.wish("ben", alarms={"station": "none"})
            await here.set_up(steps=[{"people": ["ben"], "after_minutes": 10}])
        if moment == "written":
            vars(here.notices.deliveries)["begin"] = die
        if moment == "answered":
            vars(here.notices.deliveries)["_settle"] = die_soon
        await here.alarms.raise_("leak", "It leaks.", level="critical")
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), *sys.argv[2:]))
