"""The explorer: one interactive page of a system."""
