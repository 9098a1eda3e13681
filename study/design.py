"""The design of a study: how many to recruit and when, and which orders and drop-outs came of it."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from steerlab.sim.errors import InvalidValue
from steerlab.study.contract import ParticipantView, Phase, Role, Standing


@dataclass(frozen=True, kw_only=True, slots=True)
class DesignPlan:
    """What is decided about recruiting.

    Attributes:
        network_first: no test participant is enrolled before there is a network, or enough training
            participants have finished to train one.
        turn_parts: where several calibration phases have a part of the rollouts each, every next
            participant of a role begins with another part, so that no part is always the first.
        blind: the experimenter is not shown which condition comes when.
        training, test: how many are to take part; 0 is no aim.
    """

    network_first: bool = True
    turn_parts: bool = False
    blind: bool = False
    training: int = 0
    test: int = 0

    def __post_init__(self) -> None:
        for role in Role:
            if self.wanted(role) < 0:
                raise InvalidValue(role.value, self.wanted(role), "0 (no aim) or more")

    def wanted(self, role: Role) -> int:
        """How many are to take part in that role; 0 is no aim."""
        return self.training if role is Role.TRAINING else self.test


@dataclass(frozen=True, kw_only=True, slots=True)
class Recruited:
    """How many of one role take part.

    Attributes:
        wanted: 0 is no aim.
        staying: enrolled, under way or finished.
    """

    role: Role
    wanted: int
    staying: int
    finished: int
    left: int


@dataclass(frozen=True, kw_only=True, slots=True)
class OrderCount:
    """How many test participants had one order of the conditions."""

    order: tuple[str, ...]
    staying: int
    finished: int
    left: int


@dataclass(frozen=True, kw_only=True, slots=True)
class DropOut:
    """A participant who left, and the phase that they did not finish; None after the last."""

    participant: str
    role: Role
    standing: Standing
    phase: Phase | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Design:
    """What came of the plan.

    Attributes:
        blind: the experimenter is not to know which condition comes when.
        recruited: by role.
        orders: of the conditions, each that anybody had.
        positions: by condition, how many who stay have it first, second, ...
        drop_outs: whoever declined or withdrew, in the order of their enrolment.
    """

    blind: bool
    recruited: tuple[Recruited, ...]
    orders: tuple[OrderCount, ...]
    positions: dict[str, tuple[int, ...]]
    drop_outs: tuple[DropOut, ...]


def design_of(people: Sequence[ParticipantView], plan: DesignPlan) -> Design:
    """Recruiting, counterbalancing and drop-outs of all who were enrolled."""
    stayed = [one for one in people if not has_left(one.standing)]
    left = [one for one in people if has_left(one.standing)]
    orders = {one.order for one in people if one.order}
    return Design(
        blind=plan.blind,
        recruited=tuple(
            Recruited(
                role=role,
                wanted=plan.wanted(role),
                staying=sum(one.role is role for one in stayed),
                finished=_finished(one for one in stayed if one.role is role),
                left=sum(one.role is role for one in left),
            )
            for role in Role
        ),
        orders=tuple(
            OrderCount(
                order=order,
                staying=sum(one.order == order for one in stayed),
                finished=_finished(one for one in stayed if one.order == order),
                left=sum(one.order == order for one in left),
            )
            for order in sorted(orders)
        ),
        positions=_positions([one.order for one in stayed if one.order]),
        drop_outs=tuple(
            DropOut(participant=one.id, role=one.role, standing=one.standing, phase=_cut_off(one))
            for one in left
        ),
    )


def has_left(standing: Standing) -> bool:
    """Whether a participant declined or withdrew, whatever became of their data."""
    return standing.withdrawn or standing is Standing.DECLINED


def _finished(people: Iterable[ParticipantView]) -> int:
    return sum(one.standing is Standing.FINISHED for one in people)


def _positions(orders: Sequence[tuple[str, ...]]) -> dict[str, tuple[int, ...]]:
    at = Counter((key, place) for order in orders for place, key in enumerate(order))
    keys = sorted({key for order in orders for key in order})
    return {key: tuple(at[key, place] for place in range(len(keys))) for key in keys}


def _cut_off(view: ParticipantView) -> Phase | None:
    return next((phase for phase, state in view.phases if not state.over), None)
