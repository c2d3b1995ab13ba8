"""Standard output, standard error and signals of the command line."""
