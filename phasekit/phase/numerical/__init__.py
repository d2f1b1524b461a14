"""Phase space of x'' = -V'(x) for any potential, by numerical methods. Arrays only."""
