"""Strongly connected components of a small directed graph, in topological order."""

from collections.abc import Iterable, Mapping, Sequence


def components(nodes: Sequence[str], edges: Mapping[str, Iterable[str]]) -> list[tuple[str, ...]]:
    """Return the strongly connected components, sources first.

    Among components that are free to run, the one whose first node was declared earliest comes first, and the nodes
    of one component keep their order of declaration: the answer does not depend on hashing.
    """
    reach = {node: _reachable(node, edges) for node in nodes}
    groups: list[tuple[str, ...]] = []
    placed: set[str] = set()
    for node in nodes:
        if node not in placed:
            group = tuple(n for n in nodes if n == node or (n in reach[node] and node in reach[n]))
            groups.append(group)
            placed.update(group)
    return _topological(groups, edges)


def _reachable(node: str, edges: Mapping[str, Iterable[str]]) -> set[str]:
    seen: set[str] = set()
    waiting = [node]
    while waiting:
        for target in edges.get(waiting.pop(), ()):
            if target not in seen:
                seen.add(target)
                waiting.append(target)
    return seen


def _topological(groups: list[tuple[str, ...]], edges: Mapping[str, Iterable[str]]) -> list[tuple[str, ...]]:
    group_of = {node: k for k, group in enumerate(groups) for node in group}
    before: list[set[int]] = [set() for _ in groups]
    for node, targets in edges.items():
        for target in targets:
            if group_of[node] != group_of[target]:
                before[group_of[target]].add(group_of[node])
    order: list[int] = []
    while len(order) < len(groups):
        order.append(next(k for k in range(len(groups)) if k not in order and before[k] <= set(order)))
    return [groups[k] for k in order]
