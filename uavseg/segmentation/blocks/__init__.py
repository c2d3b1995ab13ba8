"""Texture and hierarchical division: LBP, contrast, G, the block map and its leaves."""
