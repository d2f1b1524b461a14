"""The table of what is computed."""
