import type { Problem, Scope } from "../session/types";
import { describe, ends, pathOf, portOf } from "../session/ports";
import type { BlockNodeType } from "./BlockNode";
import { isPictured, portHeight, sizeOf } from "./geometry";
import { placed } from "./layout";
import type { RemarkNodeType } from "./RemarkNode";
import { type Box, type Link, type Point, route, type Routes } from "./router";
import type { WireType } from "./Wire";
import { Position } from "@xyflow/react";

export type AnyNode = BlockNodeType | RemarkNodeType;

/** The id of a comment's node; a block's is its name, which has no "/". */
export const REMARK = "comment/";

const NONE: Problem[] = [];
const NO_POINTS: Point[] = [];

function problemsOf(problems: Problem[], path: string): Problem[] {
  const own = problems.filter((problem) => problem.path === path || problem.path.startsWith(`${path}/`));
  return own.length ? own : NONE;
}

const same = (a: unknown[], b: unknown[]): boolean => a.length === b.length && a.every((x, i) => x === b[i]);

/** The nodes of a diagram. Those that did not change stay the same objects, with what is selected and where they are
 * dragged to. */
export function nodesOf(
  scope: Scope,
  at: string[],
  problems: Problem[],
  before: AnyNode[],
  moving: boolean,
): AnyNode[] {
  const old = new Map(before.map((node) => [node.id, node]));
  const where = placed(scope, at.join("/"));
  const wired = new Map<string, string[]>();
  for (const target of Object.keys(scope.wires)) {
    const [name, port] = ends(target);
    wired.set(name, [...(wired.get(name) ?? []), port]);
  }
  const blocks = Object.entries(scope.nodes).map(([name, view]): AnyNode => {
    const path = pathOf(at, name);
    const data = {
      view,
      name,
      path,
      wired: wired.get(name) ?? [],
      problems: problemsOf(problems, path),
      pictured: isPictured(view),
    };
    const known = old.get(name) as BlockNodeType | undefined;
    const [x, y] = where[name] ?? [0, 0];
    const stays = known && ((moving && known.dragging) || (known.position.x === x && known.position.y === y));
    if (
      known &&
      stays &&
      known.data.view === view &&
      known.data.path === path &&
      known.data.pictured === data.pictured &&
      same(known.data.wired, data.wired) &&
      same(known.data.problems, data.problems)
    )
      return known;
    const size = sizeOf(name, view);
    const end = (type: "target" | "source", ports: typeof view.inputs) =>
      ports.map((port, row) => ({
        id: port.name,
        type,
        position: type === "target" ? Position.Left : Position.Right,
        x: type === "target" ? -5 : size.width - 5,
        y: portHeight(row) - 5,
        width: 10,
        height: 10,
      }));
    return {
      ...(known && { selected: known.selected, dragging: known.dragging }),
      id: name,
      type: "block",
      position: stays ? known.position : { x, y },
      data,
      ...size,
      measured: size,
      handles: [...end("target", view.inputs), ...end("source", view.outputs)],
      ariaLabel: `block ${name}`,
    } as BlockNodeType;
  });
  const remarks = Object.entries(scope.comments).map(([id, remark]): AnyNode => {
    const known = old.get(REMARK + id) as RemarkNodeType | undefined;
    if (known && known.data.remark === remark) return known;
    const [x, y, width, height] = remark.box;
    return {
      ...(known && { selected: known.selected }),
      id: REMARK + id,
      type: "remark",
      position: { x, y },
      width,
      height,
      measured: { width, height },
      zIndex: -1,
      data: { remark, id },
      ariaLabel: "comment",
    };
  });
  return [...remarks, ...blocks];
}

/** The ways of the wires of the diagrams that were shown, by path. */
const ways = new Map<string, { boxes: Box[]; links: Link[]; routes: Routes }>();

/** The ways of a diagram's wires round its blocks. */
export function routesOf(scope: Scope, at: string): Routes {
  const where = placed(scope, at);
  const boxes = Object.entries(scope.nodes).map(([name, view]): Box => {
    const [x, y] = where[name] ?? [0, 0];
    return { x, y, ...sizeOf(name, view) };
  });
  const end = (address: string, side: "inputs" | "outputs"): Point | null => {
    const [name, port] = ends(address);
    const block = scope.nodes[name];
    const row = block?.[side].findIndex((each) => each.name === port) ?? -1;
    const [x, y] = where[name] ?? [0, 0];
    if (!block || row < 0) return null;
    return [side === "inputs" ? x : x + sizeOf(name, block).width, y + portHeight(row)];
  };
  const links = Object.entries(scope.wires).flatMap(([target, source]): Link[] => {
    const [from, to] = [end(source, "outputs"), end(target, "inputs")];
    return from && to ? [{ id: target, net: source, from, to }] : [];
  });
  const before = ways.get(at);
  if (before && JSON.stringify([before.boxes, before.links]) === JSON.stringify([boxes, links])) return before.routes;
  const routes = route(boxes, links, before);
  ways.set(at, { boxes, links, routes });
  return routes;
}

/** The wires of a diagram, each by its target; as with nodes, those that did not change stay. */
export function wiresOf(scope: Scope, at: string[], problems: Problem[], before: WireType[]): WireType[] {
  const old = new Map(before.map((wire) => [wire.id, wire]));
  const wrong = new Map(problems.map((problem) => [`${problem.path}.${problem.port}`, problem.message]));
  const routes = routesOf(scope, at.join("/"));
  const joined = new Set<string>();
  return Object.entries(scope.wires).map(([target, from]) => {
    const [source, sourceHandle] = ends(from);
    const [name, targetHandle] = ends(target);
    const port = portOf(scope.nodes[source]?.outputs, sourceHandle);
    const wide = !!port?.shape.length;
    const problem = wrong.get(`${pathOf(at, name)}.${targetHandle}`) ?? null;
    const title = `${from} → ${target}${port ? `: ${describe(port)}` : ""}`;
    const path = routes.paths.get(target) ?? null;
    // The first wire of a net draws the joints of all.
    const joints = joined.has(from) ? NO_POINTS : (routes.joints.get(from) ?? NO_POINTS);
    joined.add(from);
    const known = old.get(target);
    if (
      known &&
      known.data?.path === path &&
      known.data.joints === joints &&
      known.data.title === title &&
      known.data.wide === wide &&
      known.data.problem === problem
    )
      return known;
    return {
      ...(known && { selected: known.selected }),
      id: target,
      type: "wire",
      source,
      sourceHandle,
      target: name,
      targetHandle,
      data: { wide, problem, title, path, joints },
      ariaLabel: `wire from ${from} to ${target}`,
    };
  });
}
