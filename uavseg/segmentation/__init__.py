"""Grey to labels: arrays in, arrays out."""
