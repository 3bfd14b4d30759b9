"""Talking to robots by satellite: every byte costs, every answer takes a surfacing or more.

It knows messages, gateways and budgets, and not what is sent: whoever sends registers what its rows
mean (``row_kind``). The bus is told ``OutboxChanged`` and ``RowsChanged``.
"""
