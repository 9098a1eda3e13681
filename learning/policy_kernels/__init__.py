"""The policy's forward pass and gradient as compiled kernels that round alike on any processor."""
