"""Condition orders: all permutations, balanced within blocks, drawn by the protocol's seed."""

from collections.abc import Sequence
from hashlib import sha256
from itertools import permutations
from math import factorial


def order_at(
    conditions: Sequence[str], *, seed: int, block_size: int, index: int
) -> tuple[str, ...]:
    """The order of the ``index``-th test participant, from 0.

    Each block holds every order equally often, shuffled. A cyclic Latin square would balance
    positions only: with all orders, each condition also follows each other equally often.

    A block is shuffled by the hashes of its entries and not by a random generator, so that an
    assignment can be checked by any version of any library, forever.
    """
    block, place = divmod(index, block_size)
    copies = block_size // factorial(len(conditions))
    entries = [(order, copy) for order in permutations(conditions) for copy in range(copies)]

    def rank(entry: tuple[tuple[str, ...], int]) -> str:
        order, copy = entry
        return sha256(f"{seed}/{block}/{copy}/{'>'.join(order)}".encode()).hexdigest()

    return sorted(entries, key=rank)[place][0]


def allocation(conditions: Sequence[str], *, seed: int, block_size: int) -> str:
    """What the orders are drawn from; participants who share it share blocks."""
    return f"seed {seed}, blocks of {block_size}: {', '.join(conditions)}"
