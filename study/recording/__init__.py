"""Rerun recordings of attempts: one description of them, for live ones and for rebuilt ones."""
