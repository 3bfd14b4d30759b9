"""The tags of the site: told and changed as one document."""

from typing import Annotated

from fastapi import APIRouter, Depends, Header, Response

from server.access.caller import Caller
from server.access.dependency import Pilot, Viewer
from server.base.dependency import service
from server.camera.tags import Tags
from server.camera.view import BundleBody, LayoutBody, TagBody, TagsBody, TagsView

router = APIRouter(prefix="/api/tags", tags=["cameras"])

TagsDep = Annotated[Tags, Depends(service(Tags))]


@router.get("")
async def get_tags(caller: Viewer, tags: TagsDep, response: Response) -> TagsView:
    """Return all tags; their version is the ``ETag``."""
    response.headers["ETag"] = tags.etag
    return _view(tags, caller)


@router.put("")
async def put_tags(
    caller: Pilot,
    body: TagsBody,
    tags: TagsDep,
    response: Response,
    if_match: Annotated[str | None, Header()] = None,
) -> TagsView:
    """Replace all tags: those in the tank as surveyed, and those of robots.

    422 names what is wrong, such as an id that is there twice; 412 says that they have another
    version than ``If-Match``. Cameras are to be adjusted again after fixed tags were changed.
    """
    await tags.put(body, by=caller.name, if_match=if_match)
    response.headers["ETag"] = tags.etag
    return _view(tags, caller)


def _view(tags: Tags, caller: Caller) -> TagsView:
    registry, record = tags.registry, tags.record
    return TagsView(
        LayoutBody(tags=[TagBody.of(tag) for tag in registry.layout.tags]),
        [
            BundleBody(robot=bundle.robot, tags=[TagBody.of(tag) for tag in bundle.tags])
            for bundle in registry.bundles
            if caller.rights.sees(bundle.robot)
        ],
        tags.version,
        None if record is None else record.at,
        None if record is None else record.by,
    )
