"""Tests, effect sizes and intervals: pure functions on arrays that return typed results."""
