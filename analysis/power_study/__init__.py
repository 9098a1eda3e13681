"""How many people does a study need? Many simulated studies, tested as real ones are."""
