"""Label windows, MIND MELD, the baseline ladder and what is measured about them."""
