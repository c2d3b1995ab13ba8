"""One disc of what is wanted in drawn scenes: `match` and other methods that learn from samples."""
