import type { Message } from "../session/session";

type Parts = { every: number; seeds?: number; ticks: number[]; [part: string]: unknown };

/** What was seen at one place in one branch: a column for every number. */
export interface Trace {
  every: number;
  /** How many seeds' numbers stand side by side, where they do. */
  seeds: number;
  ticks: number[];
  /** `rows` of one seed; of many `low`, `median` and `high`. */
  columns: Record<string, (number | null)[][]>;
}

const MOST = 20_000;
const kept = new Map<string, Map<string, Trace>>();
const listeners = new Set<() => void>();
let frame = 0;

function tell(): void {
  frame = 0;
  listeners.forEach((listener) => listener());
}

function changed(): void {
  if (!frame) frame = requestAnimationFrame(tell);
}

/** Be called after samples came, at most once a frame. Answers what ends that. */
export function onTraces(listener: () => void): () => void {
  listeners.add(listener);
  return () => void listeners.delete(listener);
}

export const traceOf = (branch: string, address: string): Trace | undefined => kept.get(branch)?.get(address);

export const tracedAddresses = (branch: string): string[] => [...(kept.get(branch)?.keys() ?? [])];

/** Of too much, the older half is kept in half the detail. */
function bound(trace: Trace): void {
  if (trace.ticks.length <= MOST) return;
  const half = trace.ticks.length / 2;
  const thin = <T>(list: T[]): T[] => list.filter((_, i) => i >= half || i % 2 === 0);
  trace.ticks = thin(trace.ticks);
  for (const part of Object.keys(trace.columns)) trace.columns[part] = trace.columns[part]!.map(thin);
}

function append(trace: Trace, parts: Parts): void {
  // A branch that was reset, or that went back and on again, brings ticks that are known already.
  const first = parts.ticks[0] ?? Number.POSITIVE_INFINITY;
  let keep = trace.ticks.length;
  while (keep > 0 && trace.ticks[keep - 1]! >= first) keep -= 1;
  if (keep < trace.ticks.length) {
    trace.ticks.length = keep;
    for (const columns of Object.values(trace.columns)) for (const column of columns) column.length = keep;
  }
  trace.ticks.push(...parts.ticks);
  for (const part of ["rows", "low", "median", "high"]) {
    const rows = parts[part] as (number | null)[][] | undefined;
    if (!rows) continue;
    const columns = (trace.columns[part] ??= (rows[0] ?? []).map(() => []));
    for (const row of rows) for (let i = 0; i < columns.length; i += 1) columns[i]!.push(row[i] ?? null);
  }
  bound(trace);
}

/** Take in what a branch saw; `fresh` is all that it saw, in place of what is known. */
export function takeSamples(message: Message): void {
  const branch = String(message.branch);
  let own = kept.get(branch);
  if (!own || message.fresh) {
    own = new Map();
    kept.set(branch, own);
  }
  for (const [address, parts] of Object.entries(message.signals as Record<string, Parts>)) {
    let trace = own.get(address);
    if (!trace) {
      trace = { every: parts.every, seeds: parts.seeds ?? 1, ticks: [], columns: {} };
      own.set(address, trace);
    }
    append(trace, parts);
  }
  changed();
}

/** Forget branches that there are no more. */
export function keepBranches(names: string[]): void {
  for (const name of kept.keys()) if (!names.includes(name)) kept.delete(name);
  changed();
}
