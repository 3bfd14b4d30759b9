"""Which robots sign: a damaged key leaves its own robot without radio, and no other."""

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
    assert damaged.check(signed(KEY)) is Verdict.FORGED
    unsigned = Codec(SystemId(1), ROBOT_COMPONENT).pack(
        grace.MAVLink_heartbeat_message(12, 0, 1, 4, 4, 3)
    )
    assert damaged.check(unsigned) is Verdict.UNSIGNED
    assert whole is not None
    assert whole.check(signed(KEY)) is Verdict.GOOD
    assert f"{ONE} has no radio until its signing key is put right" in caplog.text
    assert signing(THREE) is None
