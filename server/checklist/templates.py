"""The templates of a station: delivered ones, a team's versions of them, and the team's own."""

import asyncio
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from sqlalchemy.orm import Session

from db.query.fleet.robots import RobotRecord
from db.query.mission import checklists as query
from db.query.mission.checklists import TemplateVersion
from db.query.station.events import add_event
from db.writer import tell_after_commit
from server.base.foundation import Foundation
from server.base.problem import conflict, not_found
from server.checklist.delivered import DELIVERED
from server.checklist.template import ChecklistTemplate, template_of


@dataclass(frozen=True, slots=True)
class TemplatesChanged:
    """A template was saved, reset or put away; told after the commit."""

    template: str


@dataclass(frozen=True, slots=True)
class KnownTemplate:
    """A template, and where it comes from."""

    key: str
    template: ChecklistTemplate
    version: int
    """0 as it was delivered."""
    origin: Literal["delivered", "changed", "own"]
    saved_at: datetime | None = None
    saved_by: str = ""


class Templates:
    """Belongs to one event loop; each version that was ever saved stays in the database."""

    def __init__(self, foundation: Foundation) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._versions: dict[str, TemplateVersion] = {}
        self._changing = asyncio.Lock()

    async def load(self) -> None:
        """Read what people saved."""
        self._versions = await self._store.query(query.newest_versions)

    @property
    def entries(self) -> list[KnownTemplate]:
        """Every template in use, the delivered ones first."""
        keys = [*DELIVERED, *(key for key in self._versions if key not in DELIVERED)]
        found = (self._entry(key) for key in keys)
        return [one for one in found if one is not None]

    def get(self, key: str) -> KnownTemplate:
        """Return a template.

        Raises:
            Problem: 404 if there is none; the sentence lists those that there are.
        """
        found = self._entry(key)
        if found is None:
            known = ", ".join(one.key for one in self.entries)
            raise not_found(f"There is no checklist {key!r}; there are {known}.")
        return found

    def applying(self, robot: RobotRecord) -> list[KnownTemplate]:
        """Return the templates that a robot goes through in the water that it works in."""
        return [
            one
            for one in self.entries
            if one.template.applies_to(is_simulated=robot.simulated, water=robot.site.kind)
        ]

    async def add(self, key: str, template: ChecklistTemplate, *, by: str) -> KnownTemplate:
        """Add a template of the team's own.

        Raises:
            Problem: 409 if the key is taken.
        """
        async with self._changing:
            if self._entry(key) is not None:
                raise conflict(f"There is a checklist {key!r} already; change that.")
            return await self._save(
                key, template, f"{by} added the checklist {template.title}.", by
            )

    async def change(
        self, key: str, template: ChecklistTemplate, version: int, *, by: str
    ) -> KnownTemplate:
        """Save a template as its next version; runs that are under way keep theirs.

        Args:
            key: Which.
            template: What it says from now on.
            version: The one that was changed.
            by: Who saves it.

        Raises:
            Problem: 404 if there is none; 409 if somebody saved another version meanwhile.
        """
        async with self._changing:
            now = self.get(key)
            if now.version != version:
                who = f"{now.saved_by} changed it meanwhile" if now.saved_by else "It is another"
                raise conflict(f"{who}: it is version {now.version} now, not {version}.")
            return await self._save(
                key, template, f"{by} changed the checklist {template.title}.", by
            )

    async def reset(self, key: str, *, by: str) -> KnownTemplate | None:
        """Let a template be as it was delivered again; the team's own is put away.

        Raises:
            Problem: 404 if there is none; 409 if it is as delivered already.
        """
        async with self._changing:
            now = self.get(key)
            if now.origin == "delivered":
                raise conflict(f"{now.template.title} is as it was delivered.")
            verb = "reset" if key in DELIVERED else "put away"
            await self._write(key, None, f"{by} {verb} the checklist {now.template.title}.", by)
            return self._entry(key)

    async def versions(self, key: str) -> list[TemplateVersion]:
        """Return every version that was saved, the newest first."""
        return await self._store.query(lambda session: query.template_versions(session, key))

    async def _save(
        self, key: str, template: ChecklistTemplate, text: str, by: str
    ) -> KnownTemplate:
        await self._write(key, template, text, by)
        return self.get(key)

    async def _write(
        self, key: str, template: ChecklistTemplate | None, text: str, by: str
    ) -> None:
        at = self._clock.now()
        document = None if template is None else template.model_dump(mode="json")

        def write(session: Session) -> TemplateVersion:
            saved = query.add_template_version(session, key, document, at=at, by=by)
            data = {"template": key, "version": saved.version}
            add_event(session, at, "checklist.template", text, data=data)
            tell_after_commit(session, TemplatesChanged(key), key)
            return saved

        self._versions[key] = await self._store.write(write)

    def _entry(self, key: str) -> KnownTemplate | None:
        saved = self._versions.get(key)
        if saved is None or saved.document is None:
            delivered = DELIVERED.get(key)
            return None if delivered is None else self._delivered(key, delivered, saved)
        origin: Literal["changed", "own"] = "changed" if key in DELIVERED else "own"
        template = template_of(saved.document)
        return KnownTemplate(key, template, saved.version, origin, saved.saved_at, saved.saved_by)

    @staticmethod
    def _delivered(
        key: str, template: ChecklistTemplate, saved: TemplateVersion | None
    ) -> KnownTemplate:
        version = 0 if saved is None else saved.version
        return KnownTemplate(key, template, version, "delivered")
