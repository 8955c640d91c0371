"""Dead time of a requested torque: which older request acts when, within a communication step."""

Requests = tuple[tuple[float, float], ...]
ROUNDING = 1e-9  # of a step: how far time stamps may be off


def split_step(
    requests: Requests, u: float, delay: float, time: float, step: float
) -> tuple[Requests, list[tuple[float, float]]]:
    """Return the requests that still matter after a step, and the step's pieces ``(delayed torque, length)``.

    Args:
        requests: ``(time [s], torque [N.m])`` of earlier steps, oldest first; the first may act already.
        u: torque that is requested from ``time`` on [N.m].
        delay: dead time [s]; with zero, requests act at once and none is kept. Before the first one acts, the
            torque is zero.
        time: start of the step [s].
        step: its length [s].
    """
    if delay == 0.0:
        return (), [(u, step)]
    if not requests or requests[-1][1] != u:
        requests = (*requests, (time, u))
    least = ROUNDING * step
    pieces: list[tuple[float, float]] = []
    begin, acting, first = time, 0.0, 0
    for n, (asked, value) in enumerate(requests):
        switch = asked + delay
        if switch >= time + step - least:
            break
        if switch <= time + least:
            first = n
        else:
            pieces.append((acting, switch - begin))
            begin = switch
        acting = value
    pieces.append((acting, time + step - begin))
    return requests[first:], pieces
