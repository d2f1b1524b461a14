"""The machine, arrays only."""
