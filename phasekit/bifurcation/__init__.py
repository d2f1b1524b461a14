"""Critical values and loci, arrays only."""
