"""What REST and the live stream say, declared once.

Frozen dataclasses: FastAPI derives the OpenAPI schema from them and msgspec encodes them for the
live stream, so both interfaces cannot drift apart. Numbers are SI and radians with a unit suffix,
times are aware UTC.
"""
