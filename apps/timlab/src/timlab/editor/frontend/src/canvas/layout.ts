import { Graph, layout } from "@dagrejs/dagre";
import { ends } from "../session/ports";
import type { Scope } from "../session/types";
import { GRID, portHeight, sizeOf } from "./geometry";

export type Positions = Record<string, [number, number]>;

const snapped = (x: number): number => Math.round(x / GRID) * GRID;

/** Where blocks go from left to right along the wires: of all, or of these. */
export function automaticLayout(scope: Scope, names: string[] = Object.keys(scope.nodes)): Positions {
  const graph = new Graph({ multigraph: true });
  graph.setGraph({ rankdir: "LR", nodesep: 30, ranksep: 70, marginx: 0, marginy: 0 });
  graph.setDefaultEdgeLabel(() => ({}));
  const chosen = new Set(names);
  for (const name of names) {
    const block = scope.nodes[name];
    if (block) graph.setNode(name, sizeOf(name, block));
  }
  for (const [target, source] of Object.entries(scope.wires)) {
    const [from] = ends(source);
    const [to] = ends(target);
    if (chosen.has(from) && chosen.has(to)) graph.setEdge(from, to, {}, target);
  }
  layout(graph);
  const found: Positions = {};
  for (const name of names) {
    const block = scope.nodes[name];
    if (!block) continue;
    const { x, y } = graph.node(name) as { x: number; y: number };
    const { width, height } = sizeOf(name, block);
    found[name] = [snapped(x - width / 2), snapped(y - height / 2)];
  }
  return straightened(scope, found);
}

/** Of how far apart two ends of a wire are brought to one height, and what is left free about a block, in pixels. */
const [NEAR, ROOM] = [2 * GRID, 2 * GRID];

/** Moves blocks up or down a little where that makes a wire straight, and no two come too close. */
function straightened(scope: Scope, places: Positions): Positions {
  const found = { ...places };
  const names = Object.keys(found).sort((a, b) => found[a]![0] - found[b]![0]);
  const boxOf = (name: string) => ({ x: found[name]![0], y: found[name]![1], ...sizeOf(name, scope.nodes[name]!) });
  const isFree = (name: string, by: number): boolean => {
    const { x, y, width, height } = boxOf(name);
    return names.every((other) => {
      const box = boxOf(other);
      const apart = other === name || x >= box.x + box.width + ROOM || box.x >= x + width + ROOM;
      return apart || y + by >= box.y + box.height + ROOM || box.y >= y + by + height + ROOM;
    });
  };
  for (const name of names) {
    for (const [row, port] of scope.nodes[name]!.inputs.entries()) {
      const [from, output] = ends(scope.wires[`${name}.${port.name}`] ?? ".");
      const source = found[from] && scope.nodes[from];
      if (!source || boxOf(from).x + boxOf(from).width > found[name]![0]) continue;
      const start = found[from]![1] + portHeight(source.outputs.findIndex((each) => each.name === output));
      const by = start - found[name]![1] - portHeight(row);
      if (Math.abs(by) <= NEAR && isFree(name, by)) found[name] = [found[name]![0], found[name]![1] + by];
      if (Math.abs(by) <= NEAR) break; // the first such wire decides
    }
  }
  return found;
}

/** Where blocks without a place were shown, by diagram: they stay there while others come and go. */
const shown = new Map<string, Positions>();

/** Forget where blocks were shown: another document was opened. */
export const forgetPlaces = (): void => shown.clear();

/** Where the blocks of the diagram at a path stand: where they were put, and the others by an automatic layout below
 * these. */
export function placed(scope: Scope, path: string): Positions {
  const all: Positions = {};
  const known = shown.get(path) ?? {};
  const loose: string[] = [];
  for (const [name, block] of Object.entries(scope.nodes)) {
    const place = block.position ?? known[name];
    if (place) all[name] = place;
    else loose.push(name);
  }
  if (loose.length) {
    const lowest = Object.entries(all).map(([name, [, y]]) => y + sizeOf(name, scope.nodes[name]!).height + 60);
    const shift = lowest.length ? Math.max(...lowest) : 0;
    const left = lowest.length ? Math.min(...Object.values(all).map(([x]) => x)) : 0;
    for (const [name, [x, y]] of Object.entries(automaticLayout(scope, loose))) all[name] = [x + left, y + shift];
  }
  shown.set(path, all);
  return all;
}
