import type { BlockView, Scope } from "../session/types";

/** One picture in the dock. */
export interface Source {
  path: string;
  drawing: string;
  /** What it shows, with the names for its legend. */
  signals: { address: string; label: string }[];
  fields: Record<string, unknown>;
}

const within = (at: string, name: string): string => (at ? `${at}/${name}` : name);

/** What a sink shows, in the diagram at a path that has these wires. */
export function sourceOf(at: string, node: BlockView, wires: Record<string, string>): Source {
  const path = within(at, node.name);
  const drawing = !node.drawing || node.drawing === "table" ? "lines" : node.drawing;
  const signals = node.inputs.map((port) => ({
    address: `${path}.${port.name}`,
    label: port.name === "u" ? (wires[`${node.name}.u`]?.replace(/\.y$/, "") ?? "u") : port.name,
  }));
  return { path, drawing, signals, fields: node.fields };
}

/** Everything that shows something: sinks that draw, outlets of the outermost diagram, and watched outputs. */
export function sourcesOf(scopes: Record<string, Scope>, watched: string[]): Source[] {
  const found: Source[] = [];
  for (const [at, scope] of Object.entries(scopes)) {
    for (const node of Object.values(scope.nodes)) {
      if (node.drawing || (node.type === "outlet" && at === "")) found.push(sourceOf(at, node, scope.wires));
    }
  }
  for (const address of watched)
    found.push({ path: address, drawing: "lines", signals: [{ address, label: address }], fields: {} });
  return found;
}
