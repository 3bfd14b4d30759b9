"""Which robots sign: a damaged key leaves its own robot without radio, and no other."""

from datetime import UTC, datetime, timedelta

import pytest

from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.signing import MemorySigningMemory, Signing, Verdict
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId, SystemId
from server.base.secret import SecretStore
from server.link.signing import RobotSigning

ONE, TWO, THREE = RobotId("grace-1"), RobotId("grace-2"), RobotId("grace-3")
KEY = bytes(range(32))


def signed(key: bytes) -> bytes:
    clock = SystemClock()
    codec = Codec(SystemId(1), ROBOT_COMPONENT, Signing(key, MemorySigningMemory(), clock))
    return codec.pack(grace.MAVLink_heartbeat_message(12, 0, 1, 4, 4, 3))


def test_a_robot_with_a_key_signs_and_one_without_does_not(tmp_path):
    secrets = SecretStore(tmp_path)
    (tmp_path / f"signing-{ONE}").write_text(KEY.hex())
    signing = RobotSigning(secrets, SystemClock())
    first = signing(ONE)
    assert first is not None
    assert signing(ONE) is first, "stamps go on when its links change"
    assert first.check(signed(KEY)) is Verdict.GOOD
    assert signing(TWO) is None


def test_a_damaged_key_lets_nobody_in_and_stops_nobody_else(tmp_path, caplog):
    secrets = SecretStore(tmp_path)
    for robot in (ONE, TWO):
        (tmp_path / f"signing-{robot}").write_text(KEY.hex())
    (tmp_path / f"signing-{ONE}").write_text("no key")
    signing = RobotSigning(secrets, SystemClock())
    damaged, whole = signing(ONE), signing(TWO)
    assert damaged is not None
    assert damaged.fault == "its signing key cannot be read; make a new one"
    assert damaged.check(signed(KEY)) is Verdict.FORGED
    unsigned = Codec(SystemId(1), ROBOT_COMPONENT).pack(
        grace.MAVLink_heartbeat_message(12, 0, 1, 4, 4, 3)
    )
    assert damaged.check(unsigned) is Verdict.UNSIGNED
    assert whole is not None
    assert whole.check(signed(KEY)) is Verdict.GOOD
    assert f"{ONE} has no radio until its signing key is put right" in caplog.text
    assert signing(THREE) is None


@pytest.mark.parametrize("name", ["signing", "stamps"])
def test_a_disk_that_fails_asks_for_no_new_key_and_the_old_one_holds_again(tmp_path, caplog, name):
    (tmp_path / f"signing-{ONE}").write_text(KEY.hex())
    file = tmp_path / f"{name}-{ONE}"
    aside = file.rename(tmp_path / "aside") if file.exists() else None
    file.mkdir()
    signing = RobotSigning(SecretStore(tmp_path), SystemClock())
    known = signing.decisions(ONE)
    failing = signing(ONE)
    assert failing.check(signed(KEY)) is Verdict.FORGED
    fault = f"{tmp_path.name}/{name}-{ONE}: Is a directory."
    assert failing.fault == f"its signing key cannot be read now: {fault}"
    assert str(tmp_path) not in caplog.text
    assert signing.decisions(ONE) > known, "its links are made again with the next look"
    file.rmdir()
    if aside is not None:
        aside.rename(file)
    whole = signing(ONE)
    assert (whole.fault, whole.check(signed(KEY))) == ("", Verdict.GOOD)
    known = signing.decisions(ONE)
    assert signing(ONE) is whole
    assert signing.decisions(ONE) == known


def test_marks_that_are_no_text_are_set_aside(tmp_path):
    secrets = SecretStore(tmp_path)
    (tmp_path / f"signing-{ONE}").write_text(KEY.hex())
    secrets.signing_marks(ONE).write_bytes(b"\xff\xfe\xfd")
    assert RobotSigning(secrets, SystemClock())(ONE).fault == ""
    assert (tmp_path / f"stamps-{ONE}.damaged").exists()


def test_a_decision_is_kept_apart_from_no_decision_and_nobody_else_may_read_it(tmp_path):
    secrets = SecretStore(tmp_path / "secret")
    assert (secrets.signing_key(ONE), secrets.is_signing_off(ONE)) == (None, False)
    key = secrets.new_signing_key(ONE)
    assert (secrets.signing_key(ONE), len(key)) == (key, 32)
    assert (tmp_path / "secret" / f"signing-{ONE}").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "secret").stat().st_mode & 0o777 == 0o700
    assert secrets.new_signing_key(ONE) != key, "a new key ends the old one"
    secrets.turn_signing_off(ONE)
    assert (secrets.signing_key(ONE), secrets.is_signing_off(ONE)) == (None, True)


def test_stamps_go_on_over_a_restart_of_the_station_and_begin_anew_with_a_new_key(tmp_path):
    secrets = SecretStore(tmp_path)
    key = secrets.new_signing_key(ONE)

    class Clock:
        speed = 1.0
        at = datetime(2026, 6, 1, tzinfo=UTC)

        def now(self) -> datetime:
            return self.at

    clock = Clock()
    signing = RobotSigning(secrets, clock)(ONE)
    stamps = [signing.next_stamp() for _ in range(50)]
    heard = signed(key)
    assert signing.check(heard) is Verdict.GOOD
    clock.at -= timedelta(days=400)  # the station's clock lost its battery with the restart
    again = RobotSigning(SecretStore(tmp_path), clock)
    later = again(ONE)
    assert later.next_stamp() > max(stamps)
    assert later.check(heard) is Verdict.REPLAYED
    new = secrets.new_signing_key(ONE)
    again.decide_anew(ONE)
    renewed = again(ONE)
    assert renewed is not later
    assert renewed.check(signed(key)) is Verdict.FORGED
    assert renewed.check(signed(new)) is Verdict.GOOD
