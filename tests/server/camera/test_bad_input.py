"""Whatever somebody writes as a layout or an address, it is taken or refused in words."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from autonomy.vision.tag import Registry
from robot_link.camera.sighting import Sighting
from server.base.problem import Problem
from server.camera.address import checked_uri
from server.camera.event import PictureSeen
from server.camera.rig import CameraRig
from server.camera.tags import registry_of
from server.camera.view import NewCamera, TagsBody
from server.camera.watch import TOLD_AFTER
from tests.db.conftest import START
from tests.server.conftest import until

NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.integers(-3, 600)
TAGS = st.lists(
    st.fixed_dictionaries(
        {"id": st.integers(-5, 700), "size_m": NUMBERS, "position_m": st.tuples(*[NUMBERS] * 3)},
        optional={
            "roll_deg": NUMBERS,
            "position_std_m": NUMBERS | st.none(),
            "angle_std_deg": NUMBERS | st.none(),
        },
    ),
    max_size=4,
)
LAYOUTS = st.fixed_dictionaries(
    {
        "layout": st.fixed_dictionaries({"tags": TAGS}),
        "bundles": st.lists(
            st.fixed_dictionaries({"robot": st.text(max_size=5), "tags": TAGS}), max_size=3
        ),
    }
)
SECRET = "hunter2"


def complaints(document):
    """Return the paths of what is wrong with a document of tags; none where it is taken."""
    try:
        found = registry_of(TagsBody.model_validate(document))
    except ValidationError as error:
        return [list(one["loc"]) for one in error.errors()]
    except Problem as problem:
        return [one.loc for one in problem.errors or []]
    return [] if isinstance(found, Registry) else [["nothing"]]


@settings(max_examples=200, deadline=None)
@given(LAYOUTS)
def test_any_layout_is_taken_or_refused_with_a_path(document):
    assert all(path[0] in {"layout", "bundles"} for path in complaints(document))


def complaint(uri):
    """Return what is wrong with an address; empty where it is a camera's."""
    try:
        checked_uri(uri)
    except ValueError as error:
        return str(error)
    return ""


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(["http://", "https://", "rtsp://", "v4l2:///dev/", "folder:", "file:///", ""]),
    st.text(max_size=20),
    st.text(max_size=20),
)
@example("folder:", "a?", "")
@example("v4l2:///dev/", "video0?size=", "")
@example("http://", "127.0.0.1/?fps=", "")
def test_any_address_is_a_cameras_or_refused_without_its_secret(scheme, first, last):
    uri = f"{scheme}{first}:{SECRET}@{last}"
    said = complaint(uri)
    assert SECRET not in said
    with pytest.raises(ValidationError) as refused:
        NewCamera.model_validate({"id": "Tank 1", "uri": uri})
    assert not any(SECRET in error["msg"] for error in refused.value.errors())


def twice(frame, ids):
    return Sighting("tank-1", frame, START, START, (640, 480), "whole", [], list(ids))


async def test_a_tag_that_is_there_twice_is_told_after_ten_pictures(foundation):
    def publish(frame, ids):
        foundation.bus.publish(PictureSeen("tank-1", twice(frame, ids), START))

    cause = "camera-twice:tank-1:3"
    for frame in range(TOLD_AFTER - 1):
        publish(frame, [3])
    publish(50, [])
    for frame in range(TOLD_AFTER - 1):
        publish(100 + frame, [3])
    assert foundation.alarms.standing(cause, None) is None
    publish(200, [3])
    alarm = await until(lambda: foundation.alarms.standing(cause, None))
    assert alarm.text.startswith("tank-1 sees tag 3 twice")
    publish(201, [])
    await until(lambda: foundation.alarms.standing(cause, None) is None)
    assert foundation.services.get(CameraRig).rig is None
