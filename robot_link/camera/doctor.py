"""Looking through a camera for a while and saying in plain words what it sees, and what to try.

It starts the camera's own process, so that what it says is what the station would see.
"""

import asyncio
from asyncio.subprocess import DEVNULL, PIPE
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from autonomy.vision.tag import LATENCY_IDS, ROBOT_IDS, TANK_IDS
from robot_link.camera.process import COMMAND
from robot_link.camera.sighting import (
    BoardView,
    Order,
    Sighting,
    SourceReport,
    SourceSettings,
    TagSeen,
    perimeter_px,
)
from robot_link.camera.wire import CameraReader, CameraWireError, FromCamera, ToCamera, framed
from robot_link.child_process import kill_child

OPENING_S: Final = 40.0
"""So long the process may take to load, and the camera to open."""
_READ_BYTES: Final = 65536
_SLOW_PER_S: Final = 5.0
_BLURRED_PX: Final = 1.2
_SMALL_PX: Final = 20.0
_OFTEN: Final = 0.5
_FEWEST_TAGS: Final = 4
_EXPOSE: Final = (
    "expose for 1/60 s at most (exposure=0.016 of a webcam): a robot at 0.3 m/s is smeared by 4 px"
    " in 45 ms"
)
_FROM_THE_SIDE: Final = "light from the side, so that no lamp is mirrored in the water"


@dataclass(slots=True)
class Look:
    """What a camera showed."""

    report: SourceReport | None = None
    """The last."""
    pictures: int = 0
    tags: dict[int, list[TagSeen]] = field(default_factory=dict[int, list[TagSeen]])
    twice: Counter[int] = field(default_factory=Counter[int])
    board_corners: int = 0
    nonsense: str = ""

    def take(self, message: FromCamera | ToCamera) -> None:
        """Note what the process said."""
        match message:
            case SourceReport():
                self.report = message
            case Sighting():
                self.pictures += 1
                self.twice.update(message.twice)
                for tag in message.tags:
                    self.tags.setdefault(tag.id, []).append(tag)
            case BoardView():
                self.board_corners = max(self.board_corners, len(message.corners))
            case _:
                pass


async def examine_camera(
    settings: SourceSettings, watch_s: float, say: Callable[[str], None]
) -> bool:
    """Look through a camera and tell.

    Args:
        settings: The camera.
        watch_s: How long to look, from its first picture on, s.
        say: Takes each finding.

    Returns:
        Whether pictures come in which tags are found, and nothing needs to be put right.
    """
    look = await _watch(settings, watch_s)
    if look.nonsense:
        say(f"The camera's process spoke nonsense: {look.nonsense}.")
        return False
    return tell(look, say)


def tell(look: Look, say: Callable[[str], None]) -> bool:
    """Say what a camera showed; return whether it is as it should be."""
    report = look.report
    if report is None:
        say("The camera's process said nothing.")
        return False
    if look.pictures == 0:
        say(f"No picture: {report.words or 'the camera is open, but nothing came'}.")
        _tell_refused(report, say)
        return False
    findings = (_tell_pictures(look, report, say), _tell_light(report, say), _tell_tags(look, say))
    return all(findings)


async def _watch(settings: SourceSettings, watch_s: float) -> Look:
    look = Look()
    child = await asyncio.create_subprocess_exec(*COMMAND, stdin=PIPE, stdout=PIPE, stderr=DEVNULL)
    if child.stdin is None or child.stdout is None:
        raise AssertionError("the process was given pipes")
    try:
        child.stdin.write(framed(settings) + framed(Order(board_views=1)))
        await child.stdin.drain()
        await _listen(child.stdout, look, watch_s)
    except CameraWireError as error:
        look.nonsense = str(error)
    except (BrokenPipeError, ConnectionResetError):
        look.nonsense = "it ended by itself"
    finally:
        await kill_child(child)
    return look


async def _listen(stream: asyncio.StreamReader, look: Look, watch_s: float) -> None:
    reader = CameraReader()
    loop = asyncio.get_running_loop()
    end_s = loop.time() + OPENING_S
    has_begun = False
    with suppress(TimeoutError):
        while True:
            async with asyncio.timeout_at(end_s):
                data = await stream.read(_READ_BYTES)
            if not data:
                return
            for message in reader.take(data):
                look.take(message)
            has_told = look.report is not None and look.report.state != "opening"
            if not has_begun and (look.pictures or has_told):
                has_begun, end_s = True, loop.time() + watch_s


def _tell_pictures(look: Look, report: SourceReport, say: Callable[[str], None]) -> bool:
    size = "" if report.size is None else f" of {report.size[0]} x {report.size[1]} px"
    say(f"Pictures{size} come, {report.frames_per_s:.1f} a second are looked at.")
    if report.dropped:
        say(f"{report.dropped} more came sooner than they are looked at, and were dropped.")
    _tell_refused(report, say)
    if report.state in ("failed", "silent"):
        say(f"In the end none came any more: {report.words}.")
        return False
    if report.frames_per_s < _SLOW_PER_S:
        say("  Try: a smaller picture or a better cable; 5 to 10 pictures a second are wanted.")
    return True


def _tell_refused(report: SourceReport, say: Callable[[str], None]) -> None:
    for reason, count in sorted(report.refused.items()):
        say(f"{count} pictures were not looked at: {reason}.")


def _tell_light(report: SourceReport, say: Callable[[str], None]) -> bool:
    match report.state:
        case "dark":
            say("The picture is black.")
            say("  Try: take the cap off, switch the light on, or let the camera expose by itself.")
        case "glare":
            say("Most of the picture is white.")
            say(f"  Try: a shorter exposure; {_FROM_THE_SIDE}.")
        case _:
            return True
    return False


def _tell_tags(look: Look, say: Callable[[str], None]) -> bool:
    for tag_id, count in sorted(look.twice.items()):
        say(f"Id {tag_id} is in view twice, in {count} pictures: both are left out.")
    if look.board_corners:
        say(f"The calibration board is in view: {look.board_corners} of its corners are found.")
    if not look.tags:
        say("No tag is seen.")
        say("  Try: print plates with `grace camera print`; the white rim must be whole and flat.")
        say(f"  Try: focus, {_EXPOSE}, and {_FROM_THE_SIDE}.")
        return False
    for tag_id, seen in sorted(look.tags.items()):
        say(_words_of(tag_id, seen, look.pictures))
    blur_px = float(np.median([tag.blur_px for seen in look.tags.values() for tag in seen]))
    say(f"Edges are blurred by {blur_px:.1f} px.")
    is_sharp = blur_px <= _BLURRED_PX
    if not is_sharp:
        say(f"  Try: focus, and {_EXPOSE}.")
    if min(_side_px(seen) for seen in look.tags.values()) < _SMALL_PX:
        say(
            "  Try: a larger size of picture, larger tags, or hang the camera lower; 20 px are due."
        )
    if sum(tag_id in TANK_IDS for tag_id in look.tags) < _FEWEST_TAGS:
        say(f"Fewer than {_FEWEST_TAGS} fixed tags are in view; so many calibrate a camera.")
    return is_sharp and not look.twice


def _words_of(tag_id: int, seen: list[TagSeen], pictures: int) -> str:
    share = len(seen) / pictures
    often = "" if share >= _OFTEN else ", which is seldom"
    return (
        f"Tag {tag_id} ({_kind(tag_id)}) is found in {share:.0%} of the pictures{often},"
        f" {_side_px(seen):.0f} px large."
    )


def _kind(tag_id: int) -> str:
    for ids, kind in ((ROBOT_IDS, "a robot's"), (TANK_IDS, "fixed"), (LATENCY_IDS, "for latency")):
        if tag_id in ids:
            return kind
    return "of no use here"


def _side_px(seen: list[TagSeen]) -> float:
    return float(np.median([perimeter_px(tag) / 4.0 for tag in seen]))
