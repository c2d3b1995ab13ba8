"""Connected components and their sums."""
