"""Heavy work, run by ``server.base.worker`` in a process of its own.

Each module has one task: a function of ``(payload, report, is_cancelled)``. What a task needs comes
in its payload and what it leaves goes out in its result; it touches neither database nor link.
"""
