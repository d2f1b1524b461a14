"""The laws of systems: what they say is written once, and everything else follows from it."""
