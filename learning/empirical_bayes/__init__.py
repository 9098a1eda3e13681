"""The simulation-free empirical-Bayes mapper: a linear model a person, its prior from the others."""
