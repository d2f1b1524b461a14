"""Motion in time of any law x' = f(t, x), arrays only: integration, events, sections."""
