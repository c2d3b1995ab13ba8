"""Parameters of the segmentation: ranges, classes and illumination."""
