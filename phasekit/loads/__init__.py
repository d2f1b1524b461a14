"""Bearing forces and rotators along the motions of the disk, arrays only."""
