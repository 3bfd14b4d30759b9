"""The camera node: which of the tank's tags the robot's own camera sees, and where in the picture.

Topic ``tags``: ``{"count_s", "tags": [{"id", "corners_px", "sigma_px"}]}`` for each picture that
was looked at, also where nothing is in it. ``count_s`` is the robot's counter when the picture was
taken; ``corners_px`` are in the order of ``autonomy.vision.tag.CORNERS``, ``sigma_px`` is their
noise. Topic ``state``: ``{"words"}``, what is wrong with the camera, "" where nothing is. Question
``counts``: how many pictures and tags there were. No picture leaves the node.
"""

from collections import Counter
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from onboard.node.server import NodeServer
from onboard.node.wire import Content
from robot_link.camera.sighting import TagSeen

TAGS, STATE = "tags", "state"


@dataclass(frozen=True, slots=True)
class TagView:
    """The tags of one picture."""

    count_s: float
    """The robot's counter when it was taken."""
    tags: Sequence[TagSeen]


@dataclass(frozen=True, slots=True)
class CameraWords:
    """What is wrong with a camera, for a person; "" where nothing is."""

    words: str


class TagSource(Protocol):
    """What looks at pictures: a camera with a detector, or what stands for both."""

    def views(self) -> AsyncIterator[TagView | CameraWords]:
        """Yield what is seen, picture by picture, for ever."""
        ...


class CameraNode:
    """Serves one camera to any number of programs.

    Args:
        source: What it sees.
    """

    def __init__(self, source: TagSource) -> None:
        self._source = source
        self._counts: Counter[str] = Counter()
        self.server = NodeServer("camera", {"counts": self._tell_counts}, (TAGS, STATE))

    async def run(self) -> None:
        """Look until cancelled."""
        async for seen in self._source.views():
            if isinstance(seen, CameraWords):
                self.server.publish(STATE, {"words": seen.words}, is_state=True)
            else:
                self._publish(seen)

    def _publish(self, view: TagView) -> None:
        self._counts["pictures"] += 1
        self._counts["tags"] += len(view.tags)
        tags = [
            {"id": tag.id, "corners_px": tag.corners_px, "sigma_px": tag.sigma_px}
            for tag in view.tags
        ]
        self.server.publish(TAGS, {"count_s": view.count_s, "tags": tags})

    async def _tell_counts(self, _values: dict[str, Any]) -> Content:
        return dict(self._counts)
