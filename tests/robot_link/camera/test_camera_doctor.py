"""What the doctor says of a camera, before a real process and a camera in the network."""

from datetime import UTC, datetime

import numpy as np
import pytest

from robot_link.camera.doctor import Look, examine_camera, tell
from robot_link.camera.sighting import Sighting, SourceReport, SourceSettings, TagSeen
from tests.robot_link.camera.camera_server import jpeg, serving
from tests.robot_link.camera.drawn import scene

RNG = np.random.default_rng()
PLACES = {0: (90, 90, 34), 100: (250, 90, 60), 101: (430, 90, 60), 102: (110, 290, 60)}
FIXED = {103: (430, 290, 60)}


def fixed_tags():
    return jpeg(scene(RNG, (640, 400), PLACES | FIXED)[0])


async def words_of(uri, **settings):
    said = []
    is_well = await examine_camera(SourceSettings("tank-1", uri, **settings), 2.0, said.append)
    return is_well, "\n".join(said)


@pytest.mark.process
async def test_a_good_camera_is_well_and_its_tags_are_named():
    with serving(fixed_tags, 0.1) as camera:
        is_well, said = await words_of(f"{camera.address}/stream?fps=20")
    assert is_well, said
    assert "Pictures of 640 x 400 px come" in said
    assert "Tag 0 (a robot's) is found in" in said
    assert "Tag 103 (fixed) is found in" in said
    assert "Edges are blurred by" in said
    assert "Fewer than" not in said


@pytest.mark.process
@pytest.mark.parametrize(
    ("grey", "words"), [(5, "The picture is black"), (253, "light from the side"), (120, "No tag")]
)
async def test_what_hides_the_tags_is_told_with_what_to_try(grey, words):
    def picture():
        return jpeg(np.clip(grey + RNG.normal(0, 1.5, (240, 320)), 0, 255).astype(np.uint8))

    with serving(picture, 0.1) as camera:
        is_well, said = await words_of(f"{camera.address}/stream")
    assert not is_well
    assert words in said
    assert "Try: " in said


@pytest.mark.process
@pytest.mark.parametrize(
    ("path", "words"),
    [("page", "text/html"), ("elsewhere", "not followed"), ("closed", "a user and a password")],
)
async def test_a_camera_that_gives_nothing_says_why(path, words):
    with serving(fixed_tags) as camera:
        is_well, said = await words_of(f"{camera.address}/{path}")
    assert not is_well
    assert said.startswith("No picture: ")
    assert words in said


def look(side_px=40.0, blur_px=0.8, ids=(100, 101, 102, 103), twice=(), **report):
    seen = Look()
    fields = {"state": "running", "words": "", "pictures": 9, "dropped": 0, "refused": {}}
    fields |= {"size": (1280, 720), "frames_per_s": 9.8} | report
    seen.take(SourceReport("tank-1", **fields))
    corners = ((0.0, 0.0), (side_px, 0.0), (side_px, side_px), (0.0, side_px))
    tags = [TagSeen(i, corners, 0.1, 50.0, 0, blur_px) for i in ids]
    at = datetime(2026, 11, 22, tzinfo=UTC)
    for frame in range(4):
        size = (1280, 720)
        seen.take(Sighting("tank-1", frame, at, at, size, "whole", tags, list(twice)))
    return seen


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"blur_px": 1.7}, "expose for 1/60 s at most"),
        ({"side_px": 14.0}, "hang the camera lower"),
        ({"ids": (100,)}, "Fewer than 4 fixed tags"),
        ({"twice": (5,)}, "Id 5 is in view twice, in 4 pictures"),
        ({"frames_per_s": 2.0}, "5 to 10 pictures a second are wanted"),
        ({"refused": {"cut": 7}}, "7 pictures were not looked at: cut"),
        ({"dropped": 12}, "12 more came sooner"),
        ({"state": "silent", "words": "no picture for 3 s"}, "In the end none came any more"),
        ({"ids": (216,)}, "Tag 216 (of no use here)"),
    ],
)
def test_what_could_be_better_is_told(changed, words):
    said = []
    tell(look(**changed), said.append)
    assert words in "\n".join(said)


def test_a_camera_without_fault_is_well_and_one_with_blur_is_not():
    assert tell(look(), lambda _: None)
    assert not tell(look(blur_px=1.7), lambda _: None)
    assert not tell(look(twice=(5,)), lambda _: None)
    assert not tell(Look(), lambda _: None)
