"""Plans: made, checked, flown ahead, and moved from state to state.

One module moves a plan's state, by one table: ``server.plan.state``. The bus is told
``PlanChanged``, ``PlanSeen`` and ``PlanOutdated``.
"""
