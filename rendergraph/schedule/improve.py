"""Local search over orders for what is really allocated: a pool of whole textures, not bytes."""

from __future__ import annotations

from collections.abc import Sequence

from rendergraph.schedule.model import Cost, Model


def improve(model: Model, order: Sequence[int], *, pool_bound: int, budget: int) -> tuple[list[int], Cost]:
    """Move single steps to other legal places while that makes the order cheaper.

    Args:
        model: the steps.
        order: where to start.
        pool_bound: stop where the pool is that small; no order is better.
        budget: touches to count before giving up, so that the result does not depend on the machine.
    """
    best, cost = list(order), model.cost(order)
    price = max(1, sum(model.toucher_count))
    improved = True
    while improved and budget > 0 and cost.pool > pool_bound:
        improved = False
        for step in list(best):
            place = best.index(step)
            early, late = _window(model, best, place)
            for target in (*range(place - 1, early - 1, -1), *range(place + 1, late + 1)):
                other = best.copy()
                del other[place]
                other.insert(target, step)
                budget -= price
                found = model.cost(other)
                if found.key < cost.key:
                    best, cost, improved = other, found, True
                    break
                if budget <= 0:
                    return best, cost
            if cost.pool <= pool_bound:
                break
    return best, cost


def _window(model: Model, order: Sequence[int], place: int) -> tuple[int, int]:
    """First and last place a step may move to while the others keep their order."""
    step = order[place]
    early = place
    waits = set(model.before[step])
    while early > 0 and order[early - 1] not in waits:
        early -= 1
    late = place
    waiting = set(model.after[step])
    while late + 1 < len(order) and order[late + 1] not in waiting:
        late += 1
    return early, late
