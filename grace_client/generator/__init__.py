"""Writes ``grace_client.generated`` of the station's OpenAPI document."""
