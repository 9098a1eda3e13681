"""The paper's synthetic experiment: a 2-D world, artificial drives, artificial demonstrators."""
