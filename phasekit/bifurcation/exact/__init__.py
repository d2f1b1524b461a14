"""The atlas of one equation, by exact arithmetic: critical values, loci and branches."""
