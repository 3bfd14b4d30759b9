"""Field maps that grow while samples arrive; comparisons of their models, and learning.

Publishes ``MapChanged`` and ``DivesSmoothed`` (``server.map.event``).
"""
