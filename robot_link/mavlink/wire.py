"""The generated dialect, or a sentence that says how to get it."""

try:
    from robot_link.mavlink.dialect import grace
except ImportError as error:
    raise ImportError(
        "the MAVLink dialect is not built yet: run `make setup`"
        " or `python -m robot_link.mavlink.build`"
    ) from error

__all__ = ["grace"]
