"""How a person departs from the oracle: over- or under-correcting, late or early (paper, Eq. 3)."""
