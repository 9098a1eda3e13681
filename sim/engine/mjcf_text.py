"""Numbers as MJCF attributes want them."""


def numbers(*values: float) -> str:
    """``values`` for an MJCF attribute, each written so that it is read back to the bit."""
    return " ".join(repr(float(value)) for value in values)
