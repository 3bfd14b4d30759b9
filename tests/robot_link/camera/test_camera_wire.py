"""Messages of a camera's process survive any cutting; what is none is refused in words."""

import json
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.camera.sighting import (
    TAGS_MAX,
    BoardCorner,
    BoardView,
    Order,
    Region,
    Sighting,
    SourceReport,
    SourceSettings,
    TagSeen,
    nearest_first,
)
from robot_link.camera.wire import BODY_MAX, HEAD, CameraReader, CameraWireError, Kind, framed

_PIXEL = st.floats(-100.0, 5000.0)
_CORNERS = st.tuples(*(st.tuples(_PIXEL, _PIXEL) for _ in range(4)))
_TIME = st.floats(0.0, 4e9).map(lambda seconds: datetime.fromtimestamp(seconds, UTC))
_TAG = st.builds(
    TagSeen,
    id=st.integers(0, 586),
    corners_px=_CORNERS,
    sigma_px=st.floats(0.01, 50.0),
    margin=st.floats(0.0, 300.0),
    hamming=st.integers(0, 3),
    blur_px=st.floats(0.0, 9.0),
    is_fitted=st.booleans(),
)
_SIZE = st.tuples(st.integers(64, 4096), st.integers(64, 4096))
_MESSAGE = st.one_of(
    st.builds(
        Sighting,
        camera=st.text(max_size=20),
        frame=st.integers(0, 2**40),
        taken_at=_TIME,
        arrived_at=_TIME,
        size=_SIZE,
        sought=st.sampled_from(["region", "whole"]),
        tags=st.lists(_TAG, max_size=5, unique_by=lambda tag: tag.id),
        twice=st.lists(st.integers(0, 586), max_size=3),
        cpu_ms=st.floats(0.0, 1e4),
    ),
    st.builds(
        BoardView,
        camera=st.text(max_size=20),
        frame=st.integers(0, 2**40),
        size=_SIZE,
        corners=st.lists(
            st.builds(BoardCorner, id=st.integers(0, 69), pixel=st.tuples(_PIXEL, _PIXEL))
        ),
    ),
    st.builds(
        SourceReport,
        camera=st.text(max_size=20),
        state=st.sampled_from(["opening", "running", "silent", "dark", "glare", "failed"]),
        words=st.text(max_size=40),
        pictures=st.integers(0, 9999),
        dropped=st.integers(0, 9999),
        refused=st.dictionaries(st.text(max_size=9), st.integers(0, 99), max_size=3),
        size=st.none() | _SIZE,
        frames_per_s=st.floats(0.0, 99.0),
    ),
    st.binary(max_size=300),
    st.builds(
        Order,
        regions=st.lists(st.builds(Region, *(st.integers(-9, 5000) for _ in range(4))), max_size=9),
        wants_previews=st.booleans(),
        board_views=st.integers(0, 99),
    ),
    st.builds(SourceSettings, camera=st.text(max_size=20), uri=st.text(max_size=50)),
)


@given(messages=st.lists(_MESSAGE, max_size=6), data=st.data())
def test_messages_arrive_whole_however_the_stream_is_cut(messages, data):
    stream = b"".join(framed(message) for message in messages)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    reader, arrived = CameraReader(), []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        arrived += reader.take(stream[begin:end])
    assert arrived == messages


def complaint(stream):
    """Return what a reader complains of; None where it takes the bytes or waits for more."""
    try:
        CameraReader().take(stream)
    except CameraWireError as refusal:
        return str(refusal)
    return None


@given(stream=st.binary(max_size=200))
def test_nonsense_is_refused_in_words_or_waited_for(stream):
    assert complaint(stream) != ""


@given(
    kind=st.sampled_from([kind for kind in Kind if kind is not Kind.PREVIEW]),
    body=st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(st.sampled_from(["camera", "uri", "tags", "size", "x"]), inner)
        ),
        max_leaves=8,
    ),
)
def test_a_body_of_another_form_is_refused_by_the_name_of_its_kind(kind, body):
    text = json.dumps(body).encode()
    said = complaint(HEAD.pack(len(text), kind) + text)
    if said is None:
        assert kind in (Kind.ORDER, Kind.SETTINGS)  # of which nothing, or little, must be told
    else:
        assert said.startswith(kind.name.lower())


def test_who_announces_too_much_is_not_believed():
    with pytest.raises(CameraWireError, match="longer than 8388608"):
        CameraReader().take(HEAD.pack(BODY_MAX + 1, Kind.PREVIEW))
    with pytest.raises(CameraWireError, match="longer than 8388608"):
        framed(bytes(BODY_MAX + 1))
    assert CameraReader().take(framed(bytes(BODY_MAX))) == [bytes(BODY_MAX)]


def test_an_unknown_kind_is_refused():
    with pytest.raises(CameraWireError, match="no message is of kind 9"):
        CameraReader().take(HEAD.pack(0, 9))


def _tag(tag_id=1, side=20.0, **changed):
    corners = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side))
    fields = {"sigma_px": 0.1, "margin": 50.0, "hamming": 0, "blur_px": 0.8, "corners_px": corners}
    return TagSeen(tag_id, **(fields | changed))


@pytest.mark.parametrize(
    ("was", "becomes", "complaint"),
    [
        ('"id":1', '"id":587', "id"),
        ('"sigma_px":0.1', '"sigma_px":0.0', "sigma_px"),
        ('"corners_px":[[0.0,0.0]', '"corners_px":[[1e9,0.0]', "corners_px"),
        ('"hamming":0', '"hamming":0,"more":1', "more"),
        ('"size":[640,480]', '"size":[640,48]', "64 to 4096 px"),
        ('"taken_at":"2026-11-22T15:04:05Z"', '"taken_at":"2026-11-22T15:04:05"', "aware"),
        ('"sought":"whole"', '"sought":"half"', "sought"),
    ],
)
def test_a_sighting_that_cannot_be_is_refused_with_its_field(was, becomes, complaint):
    at = datetime(2026, 11, 22, 15, 4, 5, tzinfo=UTC)
    body = framed(Sighting("tank-1", 0, at, at, (640, 480), "whole", [_tag()]))[HEAD.size :]
    assert was.encode() in body
    wrong = body.replace(was.encode(), becomes.encode())
    with pytest.raises(CameraWireError, match=complaint):
        CameraReader().take(HEAD.pack(len(wrong), Kind.SIGHTING) + wrong)


def test_a_sighting_tells_no_id_twice():
    at = datetime(2026, 11, 22, tzinfo=UTC)
    with pytest.raises(ValueError, match="twice"):
        Sighting("tank-1", 0, at, at, (640, 480), "whole", [_tag(), _tag()])


def test_of_too_many_tags_the_nearest_are_told():
    tags = [_tag(i, 10.0 + i) for i in range(TAGS_MAX + 50)]
    kept = nearest_first(tags)
    assert [tag.id for tag in kept] == list(range(TAGS_MAX + 49, 49, -1))
