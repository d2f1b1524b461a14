"""From systems and arguments to cells: which line of the table answers, and its evaluation."""
