"""``steerlab study backup`` and ``merge``: copies of a study, and one of two."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from steerlab.app.commands.printing import print_check

if TYPE_CHECKING:
    from steerlab.study.verify import Verified


@dataclass(frozen=True, kw_only=True)
class Backup:
    """Copy a study to a folder while it goes on, check the copy, and print its audit's head.

    An earlier backup of the study in that folder is replaced by a whole one, or stays. Exit code 1
    if verify finds something wrong in the copy.
    """

    folder: Annotated[
        tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY", help="The study's folder.")
    ]
    to: Annotated[
        tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR", help="The backup's folder.")
    ]
    derived: Annotated[
        bool,
        tyro.conf.arg(help="Also recordings, exports and reports, which can be made anew."),
    ] = False

    def do(self) -> int:
        """Copy."""
        from steerlab.study.backup import backup

        verified = backup(self.folder, self.to, derived=self.derived)
        print(f"Copied {self.folder} to {self.to}.")
        return _print_verified(verified)


@dataclass(frozen=True, kw_only=True)
class Merge:
    """Make one study of two that ran on computers of their own, under the same protocol.

    It goes on from the first and takes in the second's participants; both stay as they are. Exit
    code 1 if verify finds something wrong in it.
    """

    first: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY")]
    second: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="OTHER")]
    out: Annotated[Path, tyro.conf.arg(metavar="DIR", help="The merged study: a new folder.")]

    def do(self) -> int:
        """Merge."""
        from steerlab.study.merge import merge

        done = merge(self.first, self.second, self.out)
        for folder, people in zip((self.first, self.second), done.participants, strict=True):
            print(f"From {folder}: {', '.join(people)}")
        if done.network is not None:
            print(f"The network stays that of {done.network}; it learnt from nobody of the other.")
        _print_orders(done.orders)
        print(f"Made {self.out}. Go on there, and no longer in {self.first} or {self.second}.")
        return _print_verified(done.verified)


def _print_orders(orders: Mapping[tuple[str, ...], tuple[int, int]]) -> None:
    """How often each order was drawn: each computer balanced its own."""
    totals = [sum(counts) for counts in orders.values()]
    if not any(totals):
        return
    print("Condition orders of test participants, in the first study + in the second:")
    for order, (one, other) in orders.items():
        print(f"  {one + other:3d} = {one} + {other}  {' > '.join(order)}")
    if max(totals) > min(totals):
        print(
            f"Each study drew them in blocks of its own, so they differ by up to "
            f"{max(totals) - min(totals)} people. Who is enrolled from now on goes on in the "
            "first study's blocks."
        )


def _print_verified(verified: "Verified") -> int:
    for check in verified.findings:
        if not check.ok:
            print_check(check)
    print(f"Head of the audit (keep it elsewhere): {verified.head}")
    return 0 if verified.ok else 1
