"""Alembic environment of the station's database."""
