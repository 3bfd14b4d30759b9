"""Plans on their way to robots, by radio or by satellite.

One module moves a transfer's state, by one table: ``server.transfer.state``; ``machine`` finds what
to do next whenever something is told. The bus is told ``TransferChanged`` and ``TransferFailed``.
What plans and their withdrawals are by satellite is registered there (``plan_row``,
``withdrawal_row``).
"""
