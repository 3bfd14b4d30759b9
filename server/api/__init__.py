"""REST resources and live streams, one module a resource."""
