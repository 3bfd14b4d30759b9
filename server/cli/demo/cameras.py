"""Emulated cameras of a demo: the station knows where they are to be found, and no more.

They begin uncalibrated. What a laboratory would have measured of its tags is told with them.
"""

from collections.abc import Iterable
from datetime import datetime

from sqlalchemy.orm import Session

from db.query.camera.cameras import add_camera, change_camera, list_cameras
from db.query.camera.tag_sets import add_tag_set, newest_tag_set
from robot_link.messages import RobotId
from simulator.camera.laboratory import (
    CAMERAS_MAX,
    bundle_documents,
    camera_names,
    layout_document,
    tank_robots,
)

BY = "grace demo"


def tell_cameras(session: Session, robots: Iterable[RobotId], port: int, at: datetime) -> None:
    """Make cameras and tags known to a folder's database; tags that it knows stay as they are.

    Args:
        session: Transaction.
        robots: Those of the demo.
        port: Loopback port of the cameras' pictures.
        at: Now.
    """
    known = {camera.id: camera for camera in list_cameras(session)}
    for name in camera_names(CAMERAS_MAX):
        uri = f"http://127.0.0.1:{port}/camera/{name}"
        if name not in known:
            add_camera(session, name, uri, at=at, by=BY)
        elif known[name].uri != uri:
            change_camera(session, name, {"uri": uri}, at=at)
    told, bundles = newest_tag_set(session), bundle_documents(tank_robots(robots))
    if told is None:
        add_tag_set(session, layout_document(), tuple(bundles), at=at, by=BY)
        return
    names = {bundle["robot"] for bundle in told.bundles}
    new = tuple(bundle for bundle in bundles if bundle["robot"] not in names)
    if new:
        add_tag_set(session, told.layout, (*told.bundles, *new), at=at, by=BY)


def camera_link(robot: RobotId) -> tuple[str, ...]:
    """Return the link by which cameras see a robot; none of one that is not in the tank."""
    return (f"cameras:///?tags={robot}",) if tank_robots((robot,)) else ()
