"""Reads and writes, one module a subject; every function takes a session of ``db.store``."""
