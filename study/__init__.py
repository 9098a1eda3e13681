"""The study engine: the protocol, its participants, and what each of them does next."""
