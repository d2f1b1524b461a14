"""Special points of branches of equilibria, one kind a module."""
