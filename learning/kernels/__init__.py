"""Compiled kernels for MIND MELD's small networks, which torch's overhead would dominate."""
