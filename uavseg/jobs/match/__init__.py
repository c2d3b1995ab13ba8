"""Ways to search for regions like a sample: by colour and by texture."""
