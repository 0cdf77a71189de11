import { ends, portOf } from "../session/ports";
import type { BlockView, Port, Scope } from "../session/types";

/** One picture in the dock. */
export interface Source {
  path: string;
  drawing: string;
  /** What it shows, with the names for its legend. */
  signals: { address: string; label: string }[];
  fields: Record<string, unknown>;
  /** What stands at its axes. */
  titles: [across: string, up: string];
}

const TITLES: Record<string, [string, string]> = {
  raster: ["time (s)", "unit"],
  histogram: ["u", "part of the samples"],
  map: ["x", "y"],
};

/** The names of its axes with units: a sink's own unit, or that of the outputs that it sees, if they have one. */
function titlesOf(drawing: string, labels: string[], units: string[], own: unknown): [string, string] {
  const known = (label: string, unit: string | undefined) => (unit ? `${label} (${unit})` : label);
  if (drawing === "portrait") return [known(labels[0]!, units[0]), known(labels[1]!, units[1])];
  if (drawing !== "lines") return TITLES[drawing] ?? ["", ""];
  const shared = units.every((unit) => unit === units[0]) ? units[0] : "";
  const unit = typeof own === "string" && own ? own : shared;
  return ["time (s)", labels.length === 1 ? known(labels[0]!, unit) : (unit ?? "")];
}

const within = (at: string, name: string): string => (at ? `${at}/${name}` : name);

/** What a sink shows, in the diagram at a path that has these wires. */
export function sourceOf(at: string, node: BlockView, { wires, nodes }: Pick<Scope, "wires" | "nodes">): Source {
  const path = within(at, node.name);
  const drawing = !node.drawing || node.drawing === "table" ? "lines" : node.drawing;
  const signals = node.inputs.map((port) => ({
    address: `${path}.${port.name}`,
    label: port.name === "u" ? (wires[`${node.name}.u`]?.replace(/\.y$/, "") ?? "u") : port.name,
  }));
  const units = node.inputs.map((port) => {
    const [block, output] = ends(wires[`${node.name}.${port.name}`] ?? ".");
    return port.unit || (portOf(nodes[block]?.outputs, output)?.unit ?? "");
  });
  const seen = (port: Port) => wires[`${node.name}.${port.name}`]?.replace(/\.y$/, "") ?? port.name;
  const labels = drawing === "portrait" ? node.inputs.map(seen) : signals.map(({ label }) => label);
  return { path, drawing, signals, fields: node.fields, titles: titlesOf(drawing, labels, units, node.fields.unit) };
}

/** Everything that shows something: sinks that draw, outlets of the outermost diagram, and watched outputs. */
export function sourcesOf(scopes: Record<string, Scope>, watched: string[]): Source[] {
  const found: Source[] = [];
  for (const [at, scope] of Object.entries(scopes)) {
    for (const node of Object.values(scope.nodes)) {
      if (node.drawing || (node.type === "outlet" && at === "")) found.push(sourceOf(at, node, scope));
    }
  }
  for (const address of watched)
    found.push({
      path: address,
      drawing: "lines",
      signals: [{ address, label: address }],
      fields: {},
      titles: ["time (s)", address],
    });
  return found;
}
