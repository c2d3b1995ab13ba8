"""Grey becomes labels: arrays in, arrays out."""
