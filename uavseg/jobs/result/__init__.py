"""What a job returns: regions with attributes, metadata and confidence."""
