"""Pictures are taken or refused with a reason; nothing that is sent brings the process down."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_link.camera.picture import (
    PictureError,
    grey_picture,
    jpeg_of,
    light_state,
    picture_size,
)
from tests.robot_link.camera.camera_server import jpeg

GREY = np.tile(np.linspace(40, 200, 160, dtype=np.uint8), (120, 1))
COLOUR = np.dstack([GREY, GREY, GREY])
PLAIN = jpeg(GREY, cv2.IMWRITE_JPEG_QUALITY, 60)
PROGRESSIVE = jpeg(COLOUR, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
PNG16 = cv2.imencode(".png", GREY.astype(np.uint16) << 8)[1].tobytes()


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        jpeg(COLOUR),
        PROGRESSIVE,
        PLAIN + bytes(10),
        PNG16,
        GREY,
        COLOUR,
        GREY.astype(np.uint16) << 8,
    ],
)
def test_every_usual_kind_of_picture_becomes_the_same_grey(content):
    grey = grey_picture(content)
    assert grey.shape == GREY.shape
    assert np.abs(grey.astype(int) - GREY).max() <= 6


def _with_size(width, height):
    """Return a JPEG whose header tells another size."""
    at = PLAIN.index(b"\xff\xc0") + 5
    return PLAIN[:at] + struct.pack(">HH", height, width) + PLAIN[at + 4 :]


def _bomb():
    """Return a small PNG that would be 30000 x 30000 px."""
    head = b"IHDR" + struct.pack(">IIBBBBB", 30000, 30000, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "neither JPEG nor PNG"),
        (b"<html>", "neither JPEG nor PNG"),
        (b"GIF89a" + bytes(100), "neither JPEG nor PNG"),
        (PLAIN[: len(PLAIN) // 2], "cut"),
        (PLAIN[:10], "broken"),
        (_with_size(5000, 120), "a side is not 64 to 4096 px"),
        (_with_size(160, 20), "a side is not 64 to 4096 px"),
        (_with_size(0, 0), "a side is not 64 to 4096 px"),
        (PLAIN.replace(b"\xff\xc0\x00\x0b\x08", b"\xff\xc0\x00\x0b\x0c"), "a kind of JPEG that"),
        (PLAIN.replace(b"\xff\xc0", b"\xff\xc3"), "a kind of JPEG that is not read"),
        (_bomb(), "a side is not 64 to 4096 px"),
        (PLAIN + bytes(9 << 20), "longer than 8 MiB"),
        (GREY[:20], "a side is not 64 to 4096 px"),
        (np.zeros((100, 100, 2), dtype=np.uint8), "broken"),
        (np.zeros(100, dtype=np.uint8), "broken"),
    ],
)
def test_a_picture_that_cannot_be_is_refused_with_its_reason(content, reason):
    with pytest.raises(PictureError, match=reason):
        grey_picture(content)


def shape_or_reason(content):
    try:
        return grey_picture(content).shape
    except PictureError as refusal:
        return str(refusal)


@settings(max_examples=300)
@given(
    content=st.sampled_from([PLAIN, PROGRESSIVE, PNG16]),
    changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=8),
    cut=st.integers(0, 10**6),
)
def test_a_spoilt_picture_is_decoded_as_its_header_says_or_counted(content, changes, cut):
    spoilt = bytearray(content)
    for place, value in changes:
        spoilt[place % len(spoilt)] = value
    kept = bytes(spoilt[: cut % (2 * len(spoilt))])
    outcome = shape_or_reason(kept)
    if isinstance(outcome, tuple):
        width, height = picture_size(kept)
        assert outcome == (height, width)
    else:
        assert outcome


@given(content=st.binary(max_size=400))
def test_bytes_behind_the_begin_of_a_jpeg_are_refused(content):
    assert isinstance(shape_or_reason(b"\xff\xd8\xff" + content), str)


def test_black_and_white_pictures_are_told():
    assert light_state(np.full((240, 320), 8, dtype=np.uint8)) == "dark"
    assert light_state(np.full((240, 320), 255, dtype=np.uint8)) == "glare"
    assert light_state(GREY) == "running"
    dim = np.full((240, 320), 8, dtype=np.uint8)
    dim[:80, :80] = 90
    assert light_state(dim) == "running"


def test_a_preview_is_the_cameras_own_jpeg_or_made_of_what_it_sent():
    assert jpeg_of(PROGRESSIVE) is PROGRESSIVE
    for content in (PNG16, COLOUR, GREY):
        assert grey_picture(jpeg_of(content)).shape == GREY.shape
