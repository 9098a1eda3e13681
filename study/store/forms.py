"""Forms that were sent: one that comes twice, as after a page that said "try again", is done once."""

from steerlab.study.store.connection import StoreConnection

TAKEN = "form taken"
"""The audit's act; the detail is the form's key, a blank, and what came of it."""


def result_of(connection: StoreConnection, form: str | None) -> str | None:
    """What came of a form; None if it is new, or has no key."""
    if form is None:
        return None
    rows = connection.read(
        "SELECT detail FROM audit WHERE act = ? AND substr(detail, 1, ?) = ?",
        *(TAKEN, len(form) + 1, f"{form} "),
    )
    return rows[0][0].removeprefix(f"{form} ") if rows else None


def take(connection: StoreConnection, form: str | None, result: str) -> None:
    """Keep that a form is done, in the transaction that does it.

    Args:
        form: its key, without blanks; None keeps nothing.
        result: nothing of a person but their pseudonym: an erasure leaves it.
    """
    if form is not None:
        connection.log(TAKEN, f"{form} {result}")
