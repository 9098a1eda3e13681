"""Label windows, MIND MELD, the baselines and what is measured about them."""
