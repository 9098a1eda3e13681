"""Keeping what happens: the writer thread, the study store and the Rerun recordings."""
