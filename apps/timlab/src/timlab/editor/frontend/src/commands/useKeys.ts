import { useReactFlow } from "@xyflow/react";
import { type RefObject, useEffect } from "react";
import type { AnyNode } from "../canvas/flow";
import type { WireType } from "../canvas/Wire";
import { useAsk } from "../session/context";
import { useUi } from "../ui/ui";
import { byKeys } from "./all";
import { type Context, keysOf } from "./command";

const WRITES = "input, textarea, select, [contenteditable]";
/** On a button these press it, on a list they move in it. */
const PRESSES = new Set(["Enter", "Space", "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"]);

export function useContextOfCommands(): Context {
  const ask = useAsk();
  const flow = useReactFlow<AnyNode, WireType>();
  return { ask, flow };
}

/** Have commands answer to their keys: on the whole page, or in a notebook's cell within the editor. */
export function useKeys(root: RefObject<HTMLElement | null>, whole: boolean): void {
  const { ask, flow } = useContextOfCommands();
  useEffect(() => {
    const target: Document | HTMLElement | null = whole ? document : root.current;
    const press = (given: Event) => {
      const event = given as KeyboardEvent;
      const on = event.target as HTMLElement;
      const keys = keysOf(event);
      const command = byKeys.get(keys);
      if (!command || event.defaultPrevented || useUi.getState().dialog !== null) return;
      const writes = on.matches?.(WRITES) && !on.matches("input[type=range], input[type=checkbox]");
      if (writes && !["Mod+S", "Mod+K", "Mod+O"].includes(keys)) return;
      if (PRESSES.has(keys) && on.closest?.("button, [role=tab], [role=separator], input, summary")) return;
      // A selected text is copied as text.
      if (keys === "Mod+C" && window.getSelection()?.toString()) return;
      event.preventDefault();
      event.stopPropagation();
      void command.run({ ask, flow });
    };
    target?.addEventListener("keydown", press);
    return () => target?.removeEventListener("keydown", press);
  }, [ask, flow, root, whole]);
}
