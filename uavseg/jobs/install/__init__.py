"""Jobs about the installation: doctor and warm-up."""
