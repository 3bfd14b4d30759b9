"""Radios and acoustic modems, and the intake of all that robots say by whichever link.

Publishes ``SamplesStored``, ``PlanReported``, ``TargetReported``, ``UploadReported``,
``CommandReported`` and ``RadiosChanged`` (``server.link.event``).
"""
