import { automaticLayout, type Positions } from "../canvas/layout";
import { scopeNow } from "../session/useScope";
import { toast, useUi } from "../ui/ui";
import type { Command, Context } from "./command";
import { selection } from "./selection";

interface Box {
  name: string;
  x: number;
  y: number;
  width: number;
  height: number;
}

function boxes(context: Context): Box[] {
  const chosen = new Set(selection(context).names);
  return context.flow
    .getNodes()
    .filter((node) => chosen.has(node.id))
    .map(({ id, position, width, height }) => ({ name: id, ...position, width: width ?? 0, height: height ?? 0 }));
}

const put = (context: Context, positions: Positions) =>
  Object.keys(positions).length > 0 && context.ask({ op: "move", at: useUi.getState().at, positions });

const align =
  (place: (box: Box, all: Box[]) => [number, number]) =>
  (context: Context): unknown => {
    const all = boxes(context);
    if (all.length < 2) return toast("Select at least two blocks", true);
    return put(context, Object.fromEntries(all.map((box) => [box.name, place(box, all)])));
  };

const least = (all: Box[], of: (box: Box) => number) => Math.min(...all.map(of));
const most = (all: Box[], of: (box: Box) => number) => Math.max(...all.map(of));

/** Equal gaps between the first and the last. */
const distribute =
  (from: "x" | "y", size: "width" | "height") =>
  (context: Context): unknown => {
    const all = boxes(context).sort((a, b) => a[from] - b[from]);
    if (all.length < 3) return toast("Select at least three blocks", true);
    const first = all[0]!;
    const final = all[all.length - 1]!;
    const inside = all.slice(1, -1).reduce((sum, box) => sum + box[size], 0);
    const gap = (final[from] - first[from] - first[size] - inside) / (all.length - 1);
    let next = first[from];
    const positions: Positions = {};
    for (const box of all) {
      positions[box.name] = from === "x" ? [next, box.y] : [box.x, next];
      next += box[size] + gap;
    }
    return put(context, positions);
  };

async function layout(context: Context): Promise<void> {
  const { names } = selection(context);
  const chosen = boxes(context);
  const scope = scopeNow();
  const all = names.length > 1 ? names : Object.keys(scope.nodes);
  const found = automaticLayout(scope, all);
  if (names.length > 1) {
    const [left, top] = [least(chosen, (box) => box.x), least(chosen, (box) => box.y)];
    for (const name of names) found[name] = [found[name]![0] + left, found[name]![1] + top];
  }
  await put(context, found);
  requestAnimationFrame(() => void context.flow.fitView({ maxZoom: 1, padding: 0.1, duration: 200 }));
}

const command = (label: string, run: Command["run"], keys?: string[]): Command => ({
  label,
  group: "Arrange",
  run,
  keys,
});

export const arrangeCommands: Command[] = [
  command("Automatic layout", layout, ["L"]),
  command(
    "Align left",
    align((box, all) => [least(all, (b) => b.x), box.y]),
    ["Alt+ArrowLeft"],
  ),
  command(
    "Align right",
    align((box, all) => [most(all, (b) => b.x + b.width) - box.width, box.y]),
    ["Alt+ArrowRight"],
  ),
  command(
    "Align tops",
    align((box, all) => [box.x, least(all, (b) => b.y)]),
    ["Alt+Shift+ArrowUp"],
  ),
  command(
    "Align bottoms",
    align((box, all) => [box.x, most(all, (b) => b.y + b.height) - box.height]),
    ["Alt+Shift+ArrowDown"],
  ),
  command(
    "Align middles",
    align((box, all) => [box.x, all[0]!.y + all[0]!.height / 2 - box.height / 2]),
  ),
  command(
    "Align centres",
    align((box, all) => [all[0]!.x + all[0]!.width / 2 - box.width / 2, box.y]),
  ),
  command("Distribute across", distribute("x", "width"), ["Alt+H"]),
  command("Distribute down", distribute("y", "height"), ["Alt+V"]),
];
