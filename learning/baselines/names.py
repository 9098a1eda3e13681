"""The baselines by name: every report and every ``summary.json`` uses these keys."""

BASELINES = (
    "identity",
    "shared_gain",
    "person_gain",
    "person_gain_lag",
    "shared_ridge",
    "person_ridge",
    "no_embedding",
    "mean_embedding",
    "shuffled_embedding",
    "mind_meld",
    "mind_meld_paper",
    "eb_nonlinear",
    "sim_pretrained",
    "sim_pretrained_context",
)
"""Every baseline. A baseline that cannot be judged is named with the reason, see ``left_out``."""

CEILING = "true_style"
"""Told the teachers' true styles: a reference, not a method."""

FULL_ONLY = ("no_embedding", "mind_meld_paper", CEILING)
"""These train a network each; the quick choice does without."""
