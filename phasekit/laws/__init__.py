"""Laws of motion as text: formulas, read safely and once."""
