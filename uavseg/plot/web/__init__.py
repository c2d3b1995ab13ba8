"""Maps as web pages: one HTML file that loads nothing."""
