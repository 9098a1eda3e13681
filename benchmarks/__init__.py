"""What must be fast and accurate, measured beside a limit or a plain alternative in one run."""
