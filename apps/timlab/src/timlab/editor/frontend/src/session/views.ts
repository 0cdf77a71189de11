import type { BlockView, Port, Remark, Scope } from "./types";

interface Layout {
  comments?: Record<string, Remark>;
}

interface Wire {
  source: string;
  target: string;
}

/** The whole view of a diagram, as the session gives it. */
export interface View {
  head: Omit<Scope, "nodes" | "wires" | "comments">;
  nodes: Record<string, BlockView & { inner?: View }>;
  wires: Wire[];
  layout: Layout;
}

/** What is new in one diagram. */
export interface Change extends Partial<View> {
  at: string[];
  removed?: string[];
}

type Scopes = Record<string, Scope>;

const wireTable = (wires: Wire[]): Record<string, string> =>
  Object.fromEntries(wires.map((wire) => [wire.target, wire.source]));

/** A view and those of all subsystems in it, by path; "" is the outermost. */
export function flat(view: View, path = "", into: Scopes = {}): Scopes {
  into[path] = {
    ...view.head,
    nodes: view.nodes,
    wires: wireTable(view.wires),
    comments: view.layout.comments ?? {},
  };
  for (const [name, node] of Object.entries(view.nodes)) {
    if (node.inner) flat(node.inner, path ? `${path}/${name}` : name, into);
  }
  return into;
}

function without(scopes: Scopes, path: string): void {
  for (const key of Object.keys(scopes)) {
    if (key === path || key.startsWith(`${path}/`)) delete scopes[key];
  }
}

/** The views after changes; what did not change stays the same object, so that it is not drawn again. */
export function changed(before: Scopes, changes: Change[]): Scopes {
  const scopes = { ...before };
  for (const change of changes) {
    const path = change.at.join("/");
    const inner = (name: string) => (path ? `${path}/${name}` : name);
    const old = scopes[path];
    if (!old) continue;
    const nodes = { ...old.nodes };
    for (const name of change.removed ?? []) {
      delete nodes[name];
      without(scopes, inner(name));
    }
    for (const [name, node] of Object.entries(change.nodes ?? {})) {
      nodes[name] = node;
      if (node.inner) {
        without(scopes, inner(name));
        flat(node.inner, inner(name), scopes);
      } else if (node.type !== "diagram") without(scopes, inner(name));
    }
    scopes[path] = {
      ...old,
      ...change.head,
      nodes,
      wires: change.wires ? wireTable(change.wires) : old.wires,
      comments: change.layout ? (change.layout.comments ?? {}) : old.comments,
    };
  }
  return scopes;
}

/** The views with the shapes that wires give to ports, by address; what keeps its shapes stays the same object. */
export function shaped(before: Scopes, shapes: Record<string, number[]>): Scopes {
  let scopes = before;
  for (const [path, scope] of Object.entries(before)) {
    let nodes = scope.nodes;
    for (const [name, node] of Object.entries(scope.nodes)) {
      const at = path ? `${path}/${name}` : name;
      const fit = (port: Port): Port => {
        const shape = port.follows ? (shapes[`${at}.${port.name}`] ?? []) : port.shape;
        return String(shape) === String(port.shape) ? port : { ...port, shape };
      };
      const [inputs, outputs] = [node.inputs.map(fit), node.outputs.map(fit)];
      const same = inputs.every((port, i) => port === node.inputs[i]) && outputs.every((p, i) => p === node.outputs[i]);
      if (!same) nodes = { ...nodes, [name]: { ...node, inputs, outputs } };
    }
    if (nodes !== scope.nodes) scopes = { ...scopes, [path]: { ...scope, nodes } };
  }
  return scopes;
}
