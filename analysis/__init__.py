"""Figures, summaries and reports: everything that turns finished data into something to read."""
