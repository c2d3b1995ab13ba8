"""The original LBP/C of Ojala and Pietikäinen, for comparison."""
