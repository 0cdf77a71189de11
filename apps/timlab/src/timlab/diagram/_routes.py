"""Ways of wires round blocks: the cheapest path of each on a grid, one wire after the other, as in the editor."""

import heapq
import itertools
from collections.abc import Mapping, Sequence

Point = tuple[float, float]
Box = tuple[float, float, float, float]
Cell = tuple[int, int]
GRID = 10  # pixels
MARGIN = 6  # cells round everything
MAX_ROUTING_WORK = 4_000_000  # cells times wires, beyond which wires are straight
# costs in cells of way
BEND = 4.0
NEAR = 1.5
CROSSING = 2.0
BESIDE = 25.0
OWN = 0.4
WAYS = ((1, 0), (0, 1), (-1, 0), (0, -1))


def routes(boxes: Sequence[Box], wires: Mapping[str, tuple[str, Point, Point]]) -> dict[str, list[Point]]:
    """The points of every wire by its name.

    **Arguments:** `(x, y, width, height)` of the blocks; of each wire its net, whose wires may share their way, and its
    ends: it leaves the first to the right, and comes to the second from the left.
    """
    grid = _Grid(boxes, [end for _, *ends in wires.values() for end in ends])
    if grid.size * len(wires) > MAX_ROUTING_WORK:
        return {name: [start, end] for name, (_, start, end) in wires.items()}
    found = {}
    for name, (net, start, end) in sorted(wires.items(), key=lambda wire: _far(*wire[1][1:])):
        found[name] = grid.path(net, start, end)
    return found


def joints(paths: Mapping[str, list[Point]], nets: Mapping[str, str]) -> list[Point]:
    """Where wires of one net part."""
    meeting: dict[tuple[str, Cell], set[Cell]] = {}
    for name, path in paths.items():
        for (x0, y0), (x1, y1) in itertools.pairwise(path):
            dx = _sign(x1 - x0)
            dy = _sign(y1 - y0)
            steps = round((abs(x1 - x0) + abs(y1 - y0)) / GRID)
            for step in range(steps + 1):
                cell = round(x0 / GRID) + dx * step, round(y0 / GRID) + dy * step
                ways = meeting.setdefault((nets[name], cell), set())
                ways |= {(dx, dy)} if step < steps else set()
                ways |= {(-dx, -dy)} if step > 0 else set()
    return [(GRID * x, GRID * y) for (_, (x, y)), ways in meeting.items() if len(ways) > 2]


class _Grid:
    """Cells: which are in or beside a block, and which net lies between two of them."""

    def __init__(self, boxes: Sequence[Box], ends: Sequence[Point]):
        self.inside: set[Cell] = set()
        self.beside: set[Cell] = set()
        xs = [x for box in boxes for x in (box[0], box[0] + box[2])] + [x for x, _ in ends] or [0]
        ys = [y for box in boxes for y in (box[1], box[1] + box[3])] + [y for _, y in ends] or [0]
        self.left = int(min(xs) // GRID) - MARGIN
        self.right = int(max(xs) // GRID) + MARGIN
        self.top = int(min(ys) // GRID) - MARGIN
        self.bottom = int(max(ys) // GRID) + MARGIN
        self.size = (self.right - self.left) * (self.bottom - self.top)
        for x, y, width, height in boxes:
            x0 = int(x // GRID)
            x1 = int(-(-(x + width) // GRID))
            y0 = int(y // GRID)
            y1 = int(-(-(y + height) // GRID))
            self.inside |= {(i, j) for i in range(x0, x1 + 1) for j in range(y0, y1 + 1)}
            self.beside |= {(i, j) for i in range(x0 - 1, x1 + 2) for j in range(y0 - 1, y1 + 2)}
        self.laid: dict[tuple[Cell, bool], str] = {}  # net on the way to the right of a cell, or down from it

    def path(self, net: str, start: Point, end: Point) -> list[Point]:
        """The cheapest way of a wire by A*; a state is a cell and the way by which it was come to."""
        first = round(start[0] / GRID) + 1, round(start[1] / GRID)
        goal = round(end[0] / GRID) - 1, round(end[1] / GRID)
        costs: dict[tuple[Cell, int], float] = {(first, 0): 0.0}
        origin: dict[tuple[Cell, int], tuple[Cell, int]] = {}
        heap = [(0.0, first, 0)]
        while heap:
            _, cell, way = heapq.heappop(heap)
            if cell == goal and way == 0:
                return self._lay(net, start, end, (cell, way), origin)
            cost = costs[cell, way]
            for turn, (dx, dy) in enumerate(WAYS):
                if turn == (way + 2) % 4:
                    continue  # no hairpins
                there = cell[0] + dx, cell[1] + dy
                outside = not (self.left <= there[0] <= self.right and self.top <= there[1] <= self.bottom)
                if outside or (there in self.inside and there != goal):
                    continue
                more = cost + self._cost(net, cell, there) + (BEND if turn != way else 0)
                if more < costs.get((there, turn), float("inf")):
                    costs[there, turn] = more
                    origin[there, turn] = (cell, way)
                    ahead = abs(there[0] - goal[0]) + abs(there[1] - goal[1])
                    heapq.heappush(heap, (more + OWN * ahead, there, turn))
            if cell == goal and cost + BEND < costs.get((cell, 0), float("inf")):  # it turns in the last cell
                costs[cell, 0] = cost + BEND
                origin[cell, 0] = (cell, way)
                heapq.heappush(heap, (cost + BEND, cell, 0))
        return [start, end]

    def _cost(self, net: str, cell: Cell, there: Cell) -> float:
        flat = cell[1] == there[1]
        held = self.laid.get((min(cell, there), flat))
        if held == net:
            return OWN
        cost = 1 + (NEAR if there in self.beside else 0) + (BESIDE if held else 0)
        back = (there[0], there[1] - 1) if flat else (there[0] - 1, there[1])
        others = {self.laid.get((there, not flat)), self.laid.get((back, not flat))} - {None, net}
        return cost + (CROSSING if others else 0)

    def _lay(self, net: str, start: Point, end: Point, last: tuple[Cell, int], origin: dict) -> list[Point]:
        """Keep the way, and give the points at which it bends; its ends go through the ports."""
        cells = [last[0]]
        while last in origin:
            last = origin[last]
            if last[0] != cells[-1]:
                cells.append(last[0])
        cells.reverse()
        for a, b in itertools.pairwise(cells):
            self.laid[min(a, b), a[1] == b[1]] = net
        points = [start, *((GRID * x, GRID * y) for x, y in cells), end]
        path = [start]
        for before, point, after in zip(points, points[1:], points[2:], strict=False):
            straight = before[0] == point[0] == after[0] or before[1] == point[1] == after[1]
            if not straight:
                path.append(point)
        path.append(end)
        if len(path) > 3:
            path[1] = (path[1][0], start[1])
            path[-2] = (path[-2][0], end[1])
        return path


def _far(start: Point, end: Point) -> float:
    return abs(start[0] - end[0]) + abs(start[1] - end[1])


def _sign(x: float) -> int:
    return (x > 0) - (x < 0)
