"""Commands to robots, followed level by level until they are proved.

One module raises a command's level, by one table: ``server.command.state``. The bus is told
``CommandChanged`` and ``SurfaceOrdered``. What commands are by satellite is registered there
(``satellite_row``).
"""
