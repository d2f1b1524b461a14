"""What the labelled floors are made of: arguments, units and grids of labelled arrays."""
