"""Data only: the calibration set, and later questionnaires and wheel profiles."""
