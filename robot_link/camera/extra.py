"""The packages that cameras need and nothing else does: OpenCV and the AprilTag library.

They are the optional extra ``camera``. ``detector``, ``board``, ``picture``, ``source`` and
``plate`` import them when they are themselves imported; whoever imports those calls
``check_extra`` before.
"""

from importlib.util import find_spec
from typing import Final

_PACKAGES: Final = {"cv2": "OpenCV", "pyapriltags": "pyapriltags"}


class CameraExtraMissingError(RuntimeError):
    """A package of the extra ``camera`` is not installed; the sentence says how to get it."""


def check_extra() -> None:
    """Make sure that the packages are there.

    Raises:
        CameraExtraMissingError: If one is not.
    """
    missing = [title for name, title in _PACKAGES.items() if find_spec(name) is None]
    if missing:
        raise CameraExtraMissingError(
            f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not installed: "
            "install the extra camera (pip install 'grace-ground-station[camera]', or "
            "requirements-camera.lock in a clone)"
        )
