"""Phase space of phi'' = -V'(phi), arrays only."""
