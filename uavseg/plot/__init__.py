"""Pictures: previews, suggested ranges."""
