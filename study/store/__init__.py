"""What a study keeps: one SQLite database, its triggers and its hash-chained audit."""
