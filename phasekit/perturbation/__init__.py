"""What damping and drive do to first order: next to separatrices, in resonances, with noise."""
