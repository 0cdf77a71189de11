import { useRun } from "../session/store";
import { type Trace, traceOf } from "./traces";

/** What a branch saw, and before it began those that it comes from. */
export function lineage(name: string, address: string): Trace | undefined {
  const { branches } = useRun.getState();
  const branch = branches.find((each) => each.name === name);
  const own = traceOf(name, address);
  if (!branch?.parent) return own;
  const before = lineage(branch.parent, address);
  if (!before) return own;
  const count = before.ticks.filter((tick) => tick < branch.start).length;
  const join = <T>(past: T[], later: T[] | undefined): T[] => [...past.slice(0, count), ...(later ?? [])];
  const columns: Trace["columns"] = {};
  for (const [part, past] of Object.entries(before.columns)) {
    columns[part] = past.map((column, i) => join(column, own?.columns[part]?.[i]));
  }
  return { ...before, ticks: join(before.ticks, own?.ticks), columns };
}
