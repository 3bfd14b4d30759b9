"""Tables, queries and migrations of the station's memory."""
