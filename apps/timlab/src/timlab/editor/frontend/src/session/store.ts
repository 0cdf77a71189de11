import { useMemo } from "react";
import { create } from "zustand";
import type { Recoverable } from "./recoverable";
import type { Declaration, ForeignCode, GalleryEntry, Problem, RunState, Scope } from "./types";

/** What the session holds, as this client last heard of it. */
export interface Document {
  linked: boolean;
  /** Whether this is a page without a server, which shows what was recorded. */
  recorded: boolean;
  revision: number | null;
  /** Counts the documents that were opened. */
  opened: number;
  scopes: Record<string, Scope>;
  file: string | null;
  saved: boolean;
  canUndo: boolean;
  canRedo: boolean;
  /** The types of blocks under each heading. */
  categories: Record<string, string[]>;
  declarations: Record<string, Declaration>;
  gallery: GalleryEntry[];
  /** Names that formulas know: functions, constants, words. */
  words: Set<string>;
  problems: Problem[];
  /** About a diagram that runs. */
  warnings: Problem[];
  /** Of ports, by address, as they follow from wires. */
  shapes: Record<string, number[]>;
  foreign: ForeignCode[];
  recoverable: Recoverable[];
}

export const emptyScope: Scope = {
  title: "",
  comment: "",
  tick: 0.01,
  substeps: 1,
  solver: "rk4",
  relative_tolerance: 1e-6,
  absolute_tolerance: 1e-9,
  precision: "single",
  loops: "refuse",
  on_fault: "stop",
  parameters: {},
  uses: {},
  nodes: {},
  wires: {},
  comments: {},
};

export const useDocument = create<Document>(() => ({
  linked: false,
  recorded: false,
  revision: null,
  opened: 0,
  scopes: { "": emptyScope },
  file: null,
  saved: true,
  canUndo: false,
  canRedo: false,
  categories: {},
  declarations: {},
  gallery: [],
  words: new Set(),
  problems: [],
  warnings: [],
  shapes: {},
  foreign: [],
  recoverable: [],
}));

export const useRun = create<RunState>(() => ({
  state: "empty",
  branch: null,
  tick: 0,
  time: 0,
  head: 0,
  speed: 1,
  achieved: null,
  seeds: 1,
  watch: [],
  branches: [],
  stale: false,
  fixed: null,
  overrides: {},
  fresh: [],
  waited: null,
  faults: [],
}));

/** What keeps the diagram from running, what is wrong with the run, and what to beware of. */
export function useProblems(): Problem[] {
  const problems = useDocument((document) => document.problems);
  const warnings = useDocument((document) => document.warnings);
  const faults = useRun((run) => run.faults);
  return useMemo(
    () => [
      ...problems,
      ...faults.map((fault): Problem => ({ ...fault, grade: "fault" })),
      ...warnings.map((warning): Problem => ({ ...warning, grade: "warning" })),
    ],
    [problems, faults, warnings],
  );
}
