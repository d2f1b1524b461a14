"""The explorer: one page with which a system is looked at by hand."""
