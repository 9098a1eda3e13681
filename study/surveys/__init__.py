"""Questionnaires: what is asked, what was answered, and how it is scored."""
