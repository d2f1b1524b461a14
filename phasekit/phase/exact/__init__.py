"""Phase space of the trigonometric law in closed form, arrays only."""
