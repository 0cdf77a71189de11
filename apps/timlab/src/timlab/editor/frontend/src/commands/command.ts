import type { ReactFlowInstance } from "@xyflow/react";
import type { AnyNode } from "../canvas/flow";
import type { WireType } from "../canvas/Wire";
import type { Ask } from "../session/context";

/** What a command may use. */
export interface Context {
  ask: Ask;
  flow: ReactFlowInstance<AnyNode, WireType>;
}

export interface Command {
  label: string;
  group: "File" | "Edit" | "Arrange" | "Run" | "View";
  /** "Mod" is Control, or Command on a Mac. */
  keys?: string[];
  run: (context: Context) => unknown;
}

const isMac = typeof navigator !== "undefined" && /Mac|iP(hone|ad)/.test(navigator.platform);

/** The keys of an event as they are written in commands, such as "Mod+Shift+Z". */
export function keysOf(event: KeyboardEvent): string {
  const key = event.key.length === 1 ? event.key.toUpperCase() : event.key;
  const mod = isMac ? event.metaKey : event.ctrlKey;
  const letter = /^[A-Z]$/.test(key);
  const shift = event.shiftKey && (letter || key.length > 1);
  return [mod && "Mod", event.altKey && "Alt", shift && "Shift", key === " " ? "Space" : key].filter(Boolean).join("+");
}

/** Keys for people. */
export const written = (keys: string): string => keys.replace("Mod", isMac ? "⌘" : "Ctrl").replace("Arrow", "");
