"""The simulation-pretrained mapper: MIND MELD's task, learned from simulated teachers."""
