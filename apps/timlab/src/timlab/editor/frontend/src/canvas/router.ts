/** Finds ways for wires round blocks: the cheapest path of each on a grid, one wire after the other. */

export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** A wire to be routed; wires of one net begin at the same output and may share their way. */
export interface Link {
  id: string;
  net: string;
  from: Point;
  to: Point;
}

export type Point = [x: number, y: number];

export interface Routes {
  paths: Map<string, Point[]>;
  /** Where wires of one net part, by net. */
  joints: Map<string, Point[]>;
}

const CELL = 10;
const MARGIN = 8; // cells round the outermost block
const MOST_CELLS = 3_000_000;
const MOST_STEPS = 250_000; // of one search
/** Costs in cells of way. */
const COST = { bend: 4, near: 1.5, crossing: 2, corner: 12, beside: 25, own: 0.4 };
const WAYS: [number, number][] = [
  [1, 0],
  [0, 1],
  [-1, 0],
  [0, -1],
];

/** The paths of wires among blocks. What was routed `before` stays, if its ends and the blocks in its way are the
 * same. */
export function route(boxes: Box[], links: Link[], before?: { boxes: Box[]; links: Link[]; routes: Routes }): Routes {
  const grid = new Grid(boxes, links);
  const paths = new Map<string, Point[]>();
  if (grid.size > MOST_CELLS) return { paths, joints: new Map() };
  const old = new Map(before?.links.map((link) => [link.id, link]));
  const key = (box: Box) => `${box.x},${box.y},${box.width},${box.height}`;
  const [known, there] = [new Set(before?.boxes.map(key)), new Set(boxes.map(key))];
  const news = boxes.filter((box) => !known.has(key(box)));
  const settled = [...known].every((each) => there.has(each));
  const rest: Link[] = [];
  for (const link of links) {
    const same = old.get(link.id);
    const path = before?.routes.paths.get(link.id);
    const stays =
      settled && same && path && same.net === link.net && `${same.from},${same.to}` === `${link.from},${link.to}`;
    if (stays && !news.some((box) => crosses(path, box))) {
      paths.set(link.id, path);
      grid.occupy(path, link.net);
    } else rest.push(link);
  }
  const far = ({ from, to }: Link) => Math.abs(from[0] - to[0]) + Math.abs(from[1] - to[1]);
  for (const link of rest.sort((a, b) => far(a) - far(b))) {
    const path = grid.search(link);
    if (!path) continue;
    paths.set(link.id, path);
    grid.occupy(path, link.net);
  }
  return { paths, joints: joints(links, paths) };
}

/** Whether a path comes into a box. */
function crosses(path: Point[], { x, y, width, height }: Box): boolean {
  return path.some(([ax, ay], i) => {
    const [bx, by] = path[i + 1] ?? [ax, ay];
    const inside = (low: number, high: number, a: number, b: number) => Math.max(a, b) > low && Math.min(a, b) < high;
    return inside(x - CELL, x + width + CELL, ax, bx) && inside(y - CELL, y + height + CELL, ay, by);
  });
}

/** Where at least three wires of a net meet. */
function joints(links: Link[], paths: Map<string, Point[]>): Map<string, Point[]> {
  const nets = new Map<string, Map<string, Set<number>>>();
  for (const { id, net } of links) {
    const meeting = nets.get(net) ?? new Map<string, Set<number>>();
    nets.set(net, meeting);
    const path = paths.get(id) ?? [];
    path.slice(1).forEach(([bx, by], i) => {
      const [ax, ay] = path[i]!;
      const way = WAYS.findIndex(([dx, dy]) => dx === Math.sign(bx - ax) && dy === Math.sign(by - ay));
      const steps = Math.round((Math.abs(bx - ax) + Math.abs(by - ay)) / CELL);
      for (let step = 0; step <= steps && way >= 0; step += 1) {
        const at = `${Math.round(ax / CELL + WAYS[way]![0] * step)},${Math.round(ay / CELL + WAYS[way]![1] * step)}`;
        const ways = meeting.get(at) ?? new Set<number>();
        meeting.set(at, ways);
        if (step < steps) ways.add(way);
        if (step > 0) ways.add((way + 2) % 4);
      }
    });
  }
  const found = new Map<string, Point[]>();
  for (const [net, meeting] of nets) {
    const points = [...meeting].filter(([, ways]) => ways.size > 2).map(([at]) => at.split(",").map(Number) as Point);
    if (points.length)
      found.set(
        net,
        points.map(([x, y]) => [x * CELL, y * CELL]),
      );
  }
  return found;
}

/** The canvas in cells: what is blocked, and which net lies where. */
class Grid {
  readonly size: number;
  private readonly left: number;
  private readonly top: number;
  private readonly columns: number;
  private readonly rows: number;
  /** 2 in a block, 1 beside it. */
  private readonly ground: Uint8Array;
  /** The net on the way to the right of a cell, on the way below it, and of a bend in it; 0 is none. */
  private readonly across: Uint16Array;
  private readonly down: Uint16Array;
  private readonly bends: Uint16Array;
  private readonly cost: Float32Array;
  private readonly from: Int32Array;
  private readonly stamp: Int32Array;
  private readonly nets = new Map<string, number>();
  private round = 0;

  constructor(boxes: Box[], links: Link[]) {
    const xs = [...boxes.flatMap((box) => [box.x, box.x + box.width]), ...links.flatMap((l) => [l.from[0], l.to[0]])];
    const ys = [...boxes.flatMap((box) => [box.y, box.y + box.height]), ...links.flatMap((l) => [l.from[1], l.to[1]])];
    const least = (all: number[]) => all.reduce((a, b) => Math.min(a, b), Number.POSITIVE_INFINITY);
    const most = (all: number[]) => all.reduce((a, b) => Math.max(a, b), Number.NEGATIVE_INFINITY);
    this.left = Math.floor(least(xs) / CELL) - MARGIN;
    this.top = Math.floor(least(ys) / CELL) - MARGIN;
    this.columns = xs.length ? Math.ceil(most(xs) / CELL) + MARGIN - this.left + 1 : 0;
    this.rows = ys.length ? Math.ceil(most(ys) / CELL) + MARGIN - this.top + 1 : 0;
    this.size = this.columns * this.rows;
    const room = this.size > MOST_CELLS ? 0 : this.size;
    this.ground = new Uint8Array(room);
    this.across = new Uint16Array(room);
    this.down = new Uint16Array(room);
    this.bends = new Uint16Array(room);
    this.cost = new Float32Array(4 * room);
    this.from = new Int32Array(4 * room);
    this.stamp = new Int32Array(4 * room);
    if (room) for (const box of boxes) this.block(box);
  }

  private block({ x, y, width, height }: Box): void {
    const [x0, x1] = [Math.floor(x / CELL) - this.left, Math.ceil((x + width) / CELL) - this.left];
    const [y0, y1] = [Math.floor(y / CELL) - this.top, Math.ceil((y + height) / CELL) - this.top];
    for (let row = y0 - 1; row <= y1 + 1; row += 1)
      for (let column = x0 - 1; column <= x1 + 1; column += 1) {
        const inside = row >= y0 && row <= y1 && column >= x0 && column <= x1;
        const cell = row * this.columns + column;
        this.ground[cell] = Math.max(this.ground[cell]!, inside ? 2 : 1);
      }
  }

  private cellOf([x, y]: Point): number {
    return (Math.round(y / CELL) - this.top) * this.columns + Math.round(x / CELL) - this.left;
  }

  private pointOf(cell: number): Point {
    return [CELL * ((cell % this.columns) + this.left), CELL * (Math.floor(cell / this.columns) + this.top)];
  }

  private netOf(name: string): number {
    const known = this.nets.get(name) ?? this.nets.size + 1;
    this.nets.set(name, known);
    return known;
  }

  /** Lay a wire down, so that others keep away from it. */
  occupy(path: Point[], net: string): void {
    const own = this.netOf(net);
    path.slice(1).forEach((to, i) => {
      const [a, b] = [this.cellOf(path[i]!), this.cellOf(to)];
      const flat = Math.floor(a / this.columns) === Math.floor(b / this.columns);
      const step = flat ? 1 : this.columns;
      for (let cell = Math.min(a, b); cell < Math.max(a, b); cell += step) (flat ? this.across : this.down)[cell] = own;
      if (i > 0) this.bends[a] = own;
    });
  }

  /** The cheapest path of a wire by A*: its state is a cell and the way by which it was come to. */
  search({ net, from, to }: Link): Point[] | null {
    const own = this.netOf(net);
    const [start, goal] = [this.cellOf(from) + 1, this.cellOf(to) - 1];
    const [goalX, goalY] = [goal % this.columns, Math.floor(goal / this.columns)];
    const heap = new Heap();
    this.round += 1;
    const reach = (state: number, cost: number, parent: number) => {
      if (this.stamp[state] === this.round && this.cost[state]! <= cost) return;
      this.stamp[state] = this.round;
      this.cost[state] = cost;
      this.from[state] = parent;
      const cell = state >> 2;
      const away = Math.abs((cell % this.columns) - goalX) + Math.abs(Math.floor(cell / this.columns) - goalY);
      heap.push(cost + away, state);
    };
    reach(start << 2, 0, -1);
    for (let step = 0; step < MOST_STEPS; step += 1) {
      const state = heap.pop();
      if (state < 0) return null;
      const [cell, way] = [state >> 2, state & 3];
      if (cell === goal && way === 0) return this.traced(state, from, to);
      const cost = this.cost[state]!;
      for (let next = 0; next < 4; next += 1) {
        if (next === (way + 2) % 4) continue; // no hairpins
        const there = cell + WAYS[next]![0] + WAYS[next]![1] * this.columns;
        if (this.isOutside(cell, next) || (this.ground[there] === 2 && there !== goal)) continue;
        let more = this.stepCost(cell, there, next, own);
        if (next !== way) more += COST.bend + (this.foreign(this.bends[cell]!, own) ? COST.corner : 0);
        if (there === goal && next !== 0) more += COST.bend;
        reach((there << 2) | next, cost + more, state);
      }
      if (cell === goal) reach(goal << 2, cost, state); // it turned into the last cell
    }
    return null;
  }

  private isOutside(cell: number, way: number): boolean {
    const column = cell % this.columns;
    if (way === 0) return column === this.columns - 1;
    if (way === 2) return column === 0;
    return way === 1 ? cell + this.columns >= this.size : cell < this.columns;
  }

  private readonly foreign = (net: number, own: number): boolean => net !== 0 && net !== own;

  private stepCost(cell: number, there: number, way: number, own: number): number {
    const flat = way % 2 === 0;
    const edge = Math.min(cell, there);
    const held = (flat ? this.across : this.down)[edge]!;
    if (held === own) return COST.own;
    let cost = 1 + (this.ground[there] === 1 ? COST.near : 0);
    if (this.foreign(held, own)) cost += COST.beside;
    // Other nets that pass through the cell in the other direction are crossed there; their bends would look like joints.
    const crossing = flat ? this.down : this.across;
    const back = flat ? there - this.columns : there - 1;
    if (this.foreign(crossing[there]!, own) || this.foreign(crossing[back] ?? 0, own)) cost += COST.crossing;
    if (this.foreign(this.bends[there]!, own)) cost += COST.corner;
    return cost;
  }

  /** From the end back to the begin: the points at which the path bends, with the ends where the ports are. */
  private traced(state: number, from: Point, to: Point): Point[] {
    const cells: number[] = [];
    for (let at = state; at >= 0; at = this.from[at]!) if (cells[cells.length - 1] !== at >> 2) cells.push(at >> 2);
    const points = [from, ...cells.reverse().map((cell) => this.pointOf(cell)), to];
    const path = points.filter((point, i) => {
      const [before, after] = [points[i - 1], points[i + 1]];
      if (!before || !after) return true;
      return !(before[0] === point[0] && after[0] === point[0]) && !(before[1] === point[1] && after[1] === point[1]);
    });
    // A port beside the grid: the straight pieces at the ends go through it.
    if (path.length > 3) {
      path[1] = [path[1]![0], from[1]];
      path[path.length - 2] = [path[path.length - 2]![0], to[1]];
    }
    return path;
  }
}

/** A binary heap of states by cost. */
class Heap {
  private readonly costs: number[] = [];
  private readonly states: number[] = [];

  push(cost: number, state: number): void {
    let place = this.costs.length;
    this.costs.push(cost);
    this.states.push(state);
    while (place > 0) {
      const above = (place - 1) >> 1;
      if (this.costs[above]! <= cost) break;
      this.move(above, place);
      place = above;
    }
    this.costs[place] = cost;
    this.states[place] = state;
  }

  /** The cheapest state; -1 if there is none. */
  pop(): number {
    if (!this.states.length) return -1;
    const top = this.states[0]!;
    const [cost, state] = [this.costs.pop()!, this.states.pop()!];
    const length = this.states.length;
    if (!length) return top;
    let place = 0;
    for (let child = 1; child < length; child = 2 * place + 1) {
      if (child + 1 < length && this.costs[child + 1]! < this.costs[child]!) child += 1;
      if (this.costs[child]! >= cost) break;
      this.move(child, place);
      place = child;
    }
    this.costs[place] = cost;
    this.states[place] = state;
    return top;
  }

  private move(from: number, to: number): void {
    this.costs[to] = this.costs[from]!;
    this.states[to] = this.states[from]!;
  }
}

/** A path as SVG draws it, with rounded corners. */
export function drawnPath(points: Point[], radius = 5): string {
  return points
    .map(([x, y], i) => {
      const [before, after] = [points[i - 1], points[i + 1]];
      if (!before) return `M${x} ${y}`;
      if (!after) return `L${x} ${y}`;
      const toward = ([ax, ay]: Point): Point => {
        const length = Math.hypot(ax - x, ay - y) || 1;
        const by = Math.min(radius, length / 2) / length;
        return [x + (ax - x) * by, y + (ay - y) * by];
      };
      return `L${toward(before).join(" ")}Q${x} ${y} ${toward(after).join(" ")}`;
    })
    .join("");
}
