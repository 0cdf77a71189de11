"""Where blocks go: in layers from left to right along the wires (Sugiyama, Tagawa and Toda, 1981)."""

import itertools
from collections.abc import Iterable, Mapping

Name = str | tuple[str, str, int]
"""A block, or the place of a wire `(source, target, layer)` in a layer that it passes."""
# pixels between layers, and between blocks of a layer
ACROSS = 70
DOWN = 30
SWEEPS = 12


def layered(sizes: Mapping[str, tuple[int, int]], wires: Iterable[tuple[str, str]]) -> dict[str, tuple[float, float]]:
    """The positions of blocks.

    **Arguments:** widths and heights by name; the wires as pairs of names, from source to target.
    """
    edges = _without_cycles(sizes, dict.fromkeys(pair for pair in wires if pair[0] != pair[1]))
    depth = _depths(sizes, edges)
    layers: list[list[Name]] = [[] for _ in range(max(depth.values(), default=-1) + 1)]
    for name in sizes:
        layers[depth[name]].append(name)
    links: list[tuple[Name, Name]] = []
    for source, target in edges:
        chain: list[Name] = [source]
        for layer in range(depth[source] + 1, depth[target]):
            layers[layer].append((source, target, layer))
            chain.append(layers[layer][-1])
        chain.append(target)
        links += itertools.pairwise(chain)
    before: dict[Name, list[Name]] = {each: [] for layer in layers for each in layer}
    after: dict[Name, list[Name]] = {each: [] for each in before}
    for source, target in links:
        before[target].append(source)
        after[source].append(target)
    layers = _ordered(layers, before, after)
    heights: dict[Name, float] = {each: sizes[each][1] if isinstance(each, str) else 0.0 for each in before}
    middles = _middles(layers, before, after, heights)
    places = {}
    x = 0.0
    for layer in layers:
        blocks = [each for each in layer if isinstance(each, str)]
        for name in blocks:
            places[name] = (x, middles[name] - heights[name] / 2)
        x += max(sizes[name][0] for name in blocks) + ACROSS
    top = min((y for _, y in places.values()), default=0.0)
    return {name: (10 * round(x / 10), 10 * round((y - top) / 10)) for name, (x, y) in places.items()}


def _without_cycles(names: Iterable[str], wires: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The wires, with those turned round that lead back in a search in depth, which begins where nothing leads to."""
    leads: dict[str, list[str]] = {name: [] for name in names}
    reached = set()
    for source, target in wires:
        leads[source].append(target)
        reached.add(target)
    done: set[str] = set()
    found: dict[tuple[str, str], None] = {}
    for first in sorted(leads, key=reached.__contains__):
        stack = [(first, iter(leads[first]))] if first not in done else []
        path = {first}
        done.add(first)
        while stack:
            name, rest = stack[-1]
            target = next(rest, None)
            if target is None:
                path.discard(stack.pop()[0])
                continue
            found[(target, name) if target in path else (name, target)] = None
            if target not in done:
                done.add(target)
                path.add(target)
                stack.append((target, iter(leads[target])))
    return list(found)


def _depths(names: Iterable[str], edges: list[tuple[str, str]]) -> dict[str, int]:
    """The layer of each block: the longest way to it; what nothing leads to stands just before what it leads to."""
    before: dict[str, list[str]] = {name: [] for name in names}
    after: dict[str, list[str]] = {name: [] for name in before}
    for source, target in edges:
        before[target].append(source)
        after[source].append(target)
    waiting = {name: len(sources) for name, sources in before.items()}
    depth = dict.fromkeys(before, 0)
    ready = [name for name, count in waiting.items() if not count]
    for name in ready:  # grows
        for target in after[name]:
            depth[target] = max(depth[target], depth[name] + 1)
            waiting[target] -= 1
            if not waiting[target]:
                ready.append(target)
    for name, sources in before.items():
        if not sources and after[name]:
            depth[name] = min(depth[target] for target in after[name]) - 1
    return depth


Near = Mapping[Name, list[Name]]


def _ordered(layers: list[list[Name]], before: Near, after: Near) -> list[list[Name]]:
    """The layers in the order with the fewest crossings that sweeps to and fro by means of neighbours find."""
    best = layers
    fewest = _crossings(layers, after)
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        near = before if forward else after
        made = list(layers)
        for i in range(1, len(layers)) if forward else range(len(layers) - 2, -1, -1):
            order = {each: place for place, each in enumerate(made[i - 1 if forward else i + 1])}
            own = {each: place for place, each in enumerate(made[i])}
            means = {each: _mean([order[other] for other in near[each]], own[each]) for each in own}
            made[i] = sorted(made[i], key=means.__getitem__)
        layers = made
        count = _crossings(made, after)
        if count < fewest:
            best, fewest = layers, count
    return best


def _crossings(layers: list[list[Name]], after: Near) -> int:
    count = 0
    for left, right in itertools.pairwise(layers):
        order = {each: place for place, each in enumerate(right)}
        ends: list[int] = []
        for each in left:
            own = sorted(order[target] for target in after[each])
            count += sum(end > mine for mine in own for end in ends)
            ends += own
    return count


def _middles(layers: list[list[Name]], before: Near, after: Near, heights: Mapping[Name, float]) -> dict[Name, float]:
    """Heights at which blocks are close to their neighbours, without overlaps."""
    middles: dict[Name, float] = {}
    for layer in layers:
        y = 0.0
        for each in layer:
            middles[each] = y + heights[each] / 2
            y += heights[each] + DOWN
    for sweep in range(SWEEPS):
        for layer in layers if sweep % 2 == 0 else reversed(layers):
            near = {each: (*before[each], *after[each]) for each in layer}
            wanted = [_mean([middles[other] for other in near[each]], middles[each]) for each in layer]
            offsets = [0.0]
            for above, below in itertools.pairwise(layer):
                offsets.append(offsets[-1] + (heights[above] + heights[below]) / 2 + DOWN)
            rising = _rising([want - offset for want, offset in zip(wanted, offsets, strict=True)])
            middles |= {each: y + offset for each, y, offset in zip(layer, rising, offsets, strict=True)}
    return middles


def _rising(values: list[float]) -> list[float]:
    """The numbers that do not fall and are closest in the mean square: pools of adjacent violators."""
    pools: list[list[float]] = []  # sum and count
    for value in values:
        pools.append([value, 1])
        while len(pools) > 1 and pools[-2][0] / pools[-2][1] > pools[-1][0] / pools[-1][1]:
            total, count = pools.pop()
            pools[-1] = [pools[-1][0] + total, pools[-1][1] + count]
    return [total / count for total, count in pools for _ in range(int(count))]


def _mean(values: list[float] | list[int], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise
