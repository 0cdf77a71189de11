import type { BlockView, Kind, Port, Scope } from "./types";

const WIDENS: Kind[] = ["bool", "int", "float"];

/** "block.port" as its two parts; neither has a point in it. */
export function ends(address: string): [string, string] {
  const point = address.indexOf(".");
  return [address.slice(0, point), address.slice(point + 1)];
}

export const describe = (port: Port): string =>
  port.shape.length ? `${port.kind}s of shape (${port.shape.join(", ")})` : `one ${port.kind}`;

/** Why a wire would be wrong, as `Diagram.mismatch` decides; null if it fits. */
export function misfit(source: string, given: Port, target: string, wanted: Port): string | null {
  const same = given.shape.length === wanted.shape.length && given.shape.every((n, i) => n === wanted.shape[i]);
  const fits = same || given.follows || wanted.follows;
  if (fits && WIDENS.indexOf(given.kind) <= WIDENS.indexOf(wanted.kind)) return null;
  return `${target} accepts ${describe(wanted)}, but ${source} outputs ${describe(given)}`;
}

export const portOf = (ports: Port[] | undefined, name: string): Port | undefined =>
  ports?.find((port) => port.name === name);

/** As `misfit`, of addresses in a diagram. */
export function misfitAt(scope: Scope, source: string, target: string): string | null {
  const [from, output] = ends(source);
  const [to, input] = ends(target);
  const given = portOf(scope.nodes[from]?.outputs, output);
  const wanted = portOf(scope.nodes[to]?.inputs, input);
  if (!given || !wanted) return "a wire leads from an output to an input";
  return misfit(source, given, target, wanted);
}

/** "[3, 2]" behind a port's name; nothing for one number. */
export const shapeLabel = (port: Port): string => (port.shape.length ? `[${port.shape.join("×")}]` : "");

export const pathOf = (at: string[], name: string): string => [...at, name].join("/");

export const isSubsystem = (block: BlockView): boolean => block.type === "diagram";
