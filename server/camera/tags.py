"""The fixed tags of the tank and the tags of robots, as somebody told them."""

import re
from collections.abc import Callable, Sequence
from typing import TypeVar

from sqlalchemy.orm import Session

from autonomy.vision.tag import Bundle, Layout, Registry, Tag, bundle_of, layout_of
from db.query.camera import tag_sets as query
from db.query.camera.tag_sets import TagsChangedError, TagSetRecord
from db.query.fleet.robots import list_robots
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, unprocessable
from server.camera.event import TagsChanged
from server.camera.view import TagBody, TagsBody

T = TypeVar("T")
_NUMBERED = re.compile(r"\[(\d+)\]")


class Tags:
    """All tags of the site. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        self.record: TagSetRecord | None = None
        """As they are kept; None before anybody told any."""
        self.registry = Registry(Layout(()))
        """The same, as they were surveyed."""

    async def load(self) -> None:
        """Take up the tags that the database knows."""
        record = await self._foundation.store.query(query.newest_tag_set)
        if record is not None:
            self._take(record)

    @property
    def version(self) -> int:
        """Grows with each change; 0 before the first."""
        return 0 if self.record is None else self.record.key

    @property
    def etag(self) -> str:
        """Name of the version for ``ETag`` and ``If-Match``, quotes included."""
        return f'"{self.version}"'

    async def put(self, body: TagsBody, *, by: str, if_match: str | None = None) -> None:
        """Replace all tags; what was before stays in the history.

        Raises:
            Problem: 412 if ``if_match`` names another version; 422 with the paths of what is wrong.
        """
        if if_match is not None and if_match not in {"*", self.etag}:
            raise _outdated()
        registry_of(body)
        at, follows = self._foundation.clock.now(), self.version
        layout = body.layout.model_dump(mode="json")
        bundles = tuple(bundle.model_dump(mode="json") for bundle in body.bundles)

        def write(session: Session) -> TagSetRecord:
            known = {robot.id for robot in list_robots(session)}
            for i, bundle in enumerate(body.bundles):
                if bundle.robot not in known:
                    raise _wrong(f"bundles[{i}].robot: there is no robot {bundle.robot}")
            record = query.add_tag_set(session, layout, bundles, at=at, by=by, follows=follows)
            count = len(body.layout.tags)
            text = f"{by} changed the tags: {count} in the tank, {len(bundles)} robots with tags."
            add_event(session, at, "camera.tags", text, data={"version": record.key})
            return record

        try:
            self._take(await self._foundation.store.write(write))
        except TagsChangedError as error:
            raise _outdated() from error
        self._foundation.bus.publish(TagsChanged(self.version))

    def _take(self, record: TagSetRecord) -> None:
        bundles = tuple(bundle_of(one) for one in record.bundles)
        self.registry = Registry(layout_of(record.layout), bundles)
        self.record = record


def registry_of(body: TagsBody) -> Registry:
    """Return the tags that a request tells.

    Raises:
        Problem: 422 with the path of what is wrong.
    """
    layout = _at("layout", lambda: Layout(_tags(body.layout.tags)))
    bundles: list[Bundle] = []
    for i, one in enumerate(body.bundles):
        bundles.append(_at(f"bundles[{i}]", lambda one=one: Bundle(one.robot, _tags(one.tags))))
    return _at("bundles", lambda: Registry(layout, tuple(bundles)))


def _tags(bodies: Sequence[TagBody]) -> tuple[Tag, ...]:
    tags: list[Tag] = []
    for i, body in enumerate(bodies):
        try:
            tags.append(body.tag())
        except ValueError as error:
            raise ValueError(f"tags[{i}].{error}") from None
    return tuple(tags)


def _at(path: str, made: Callable[[], T]) -> T:
    try:
        return made()
    except ValueError as error:
        raise _wrong(f"{path}.{error}") from error


def _wrong(complaint: str) -> Problem:
    """Return the 422 of ``path: what is wrong``, where the path is like ``layout.tags[3].id``."""
    path, _, words = complaint.partition(": ")
    loc: list[str | int] = [
        int(part) if part.isdigit() else part
        for part in _NUMBERED.sub(r".\1", path).split(".")
        if part
    ]
    return unprocessable("1 field is wrong.", [FieldError(loc=loc, msg=words)])


def _outdated() -> Problem:
    return Problem(412, "The tags were changed meanwhile; read them again.")
