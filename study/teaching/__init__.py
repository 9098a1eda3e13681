"""Teaching a robot in a study: first drive, then rounds of drive, correction and learning."""
