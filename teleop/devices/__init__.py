"""What a teacher steers with: one contract over wheels, sticks, keys, mouse, scripts and traces."""
