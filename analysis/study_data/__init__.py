"""What an analysis reads: one typed record of a study, wherever its data come from."""
