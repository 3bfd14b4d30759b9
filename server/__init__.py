"""The station: web application, services and command line."""
