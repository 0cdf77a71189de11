import type { DragEvent, FocusEvent } from "react";
import { type Context } from "../commands/command";
import { select, selectWire } from "../commands/selection";
import { scopeNow } from "../session/useScope";
import { openText } from "../dialogs/openText";
import { useUi } from "../ui/ui";
import { GRID } from "./geometry";

/** The kind of data that the palette drags. */
export const DRAGGED = "application/x-timlab-block";

/** Add a block, and select it. */
export async function add(
  context: Context,
  type: string,
  position: [number, number],
  fields: object = {},
): Promise<void> {
  const before = new Set(Object.keys(scopeNow().nodes));
  if (!(await context.ask({ op: "add", at: useUi.getState().at, type, fields, position }))) return;
  const names = Object.keys(scopeNow().nodes).filter((name) => !before.has(name));
  select(names);
}

/** What the canvas does with blocks of the palette and files that are dropped on it, and with the keyboard's focus. */
export function useDropped(context: Context) {
  return {
    onDragOver: (event: DragEvent) => {
      event.preventDefault();
      event.dataTransfer.dropEffect = "copy";
    },
    onDrop: (event: DragEvent) => {
      event.preventDefault();
      const [file] = event.dataTransfer.files;
      if (file) return void openText(context.ask, file);
      const type = event.dataTransfer.getData(DRAGGED);
      const { x, y } = context.flow.screenToFlowPosition({ x: event.clientX, y: event.clientY });
      const snapped = (value: number) => Math.round(value / GRID) * GRID;
      if (type) void add(context, type, [snapped(x - 60), snapped(y - 20)]);
    },
    onFocus: (event: FocusEvent) => {
      const id = (event.target as HTMLElement).closest?.<HTMLElement>(".react-flow__node")?.dataset.id;
      const wire = (event.target as HTMLElement).closest?.<HTMLElement>(".react-flow__edge")?.dataset.id;
      if (wire && (event.target as HTMLElement).matches(":focus-visible")) selectWire(context, wire);
      if (id && (event.target as HTMLElement).matches(":focus-visible")) select([id]);
    },
  };
}
