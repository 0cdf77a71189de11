/** What the session tells: see `_protocol.py` and `_views.py`, which are the truth. */
export type Value = null | boolean | number | string | Value[] | { [name: string]: Value };
export type Kind = "bool" | "int" | "float";

export interface Port {
  name: string;
  shape: number[];
  kind: Kind;
  feedthrough: boolean;
  default: number | null;
  unit: string;
  help: string;
  /** Whether it takes its shape from its wire. */
  follows?: boolean;
}

export interface BlockView {
  name: string;
  type: string;
  id: string;
  category: string;
  fields: Record<string, Value>;
  /** The parameters of the diagram that stand for its own, by the names of these. */
  uses: Record<string, string>;
  inputs: Port[];
  outputs: Port[];
  position: [number, number] | null;
  /** How a sink shows what it sees. */
  drawing?: string;
  /** Whether what has been learned stays as it is: all of it, or each unit's. */
  frozen?: boolean | boolean[];
  /** Parameters that its settings bring beyond those of its type. */
  parameters?: Field[];
}

export interface Remark {
  text: string;
  box: [number, number, number, number];
}

/** One diagram: the outermost, or a subsystem. */
export interface Scope {
  title: string;
  comment: string;
  tick: number;
  substeps: number;
  solver: string;
  relative_tolerance: number;
  absolute_tolerance: number;
  precision: string;
  loops: string;
  on_fault: string;
  /** What blocks may use, and which of their parameters do: "block.parameter". */
  parameters: Record<string, Value>;
  uses: Record<string, string>;
  nodes: Record<string, BlockView>;
  /** The source of every connected input, both as "block.port". */
  wires: Record<string, string>;
  comments: Record<string, Remark>;
}

/** A field of a type of block: a parameter may change while it runs, a setting may not. */
export interface Field {
  name: string;
  /** As Python writes it, such as "float | None". */
  type: string;
  role?: "parameter" | "setting";
  required: boolean;
  default: Value;
  help?: string;
  unit?: string;
  low?: number | null;
  high?: number | null;
  open?: boolean;
  kind?: Kind;
  choices?: string[];
  /** What is allowed, in words. */
  allowed?: string;
}

export interface Declaration {
  name: string;
  category: string;
  help: string;
  fields: Field[];
  /** Of a new one; null where some field must be given first. */
  inputs: Port[] | null;
  outputs: Port[] | null;
  drawing: string | null;
}

export interface GalleryEntry {
  name: string;
  title: string;
  comment: string;
  learns: boolean;
  /** Left and upper edge, width, height and category of each block. */
  boxes: [number, number, number, number, string][];
  /** From where to where each wire leads. */
  wires: [number, number, number, number][];
}

export interface Problem {
  path: string;
  port: string | null;
  message: string;
  /** Of the run, or something to beware of; otherwise it keeps the diagram from running. */
  grade?: "fault" | "warning";
}

/** Code that a diagram brings, which nobody has trusted yet. */
export interface ForeignCode {
  path: string;
  type: string;
  code: string;
  key: string;
  /** Whether the page may let it run: it came with a file. */
  offered: boolean;
}

/** One course of events. */
export interface Branch {
  name: string;
  parent: string | null;
  /** The tick at which it left its parent, and the last that it made. */
  start: number;
  head: number;
  /** Whether it began because the diagram was changed. */
  edited: boolean;
  changes: { tick: number; address: string; value: Value }[];
}

export interface RunState {
  state: "empty" | "compiling" | "playing" | "paused";
  branch: string | null;
  tick: number;
  time: number;
  head: number;
  speed: number | null;
  /** The speed that it has. */
  achieved: number | null;
  seeds: number[] | number;
  watch: string[];
  branches: Branch[];
  /** Whether the diagram was changed in structure since it was compiled. */
  stale: boolean;
  /** Why it cannot go back in time. */
  fixed: string | null;
  /** Parameters that this branch has otherwise than the diagram. */
  overrides: Record<string, Value>;
  fresh: string[];
  /** For how many seconds it has been compiling. */
  waited: number | null;
  /** Signals and states of this branch that are NaN or infinite. */
  faults: Problem[];
}
