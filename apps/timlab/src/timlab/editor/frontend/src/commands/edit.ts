import { scopeNow } from "../session/useScope";
import { enter, openDialog, setPanel, toast, useUi } from "../ui/ui";
import { find } from "../ui/root";
import type { Command, Context } from "./command";
import { copy, paste } from "./clipboard";
import { freePlace, select, selection } from "./selection";

const here = () => useUi.getState().at;

/** Take out what is selected. */
export async function remove(context: Context): Promise<void> {
  const { names, comments, wires } = selection(context);
  const gone = new Set(names);
  const loose = wires.filter((target) => !gone.has(target.split(".")[0]!));
  for (const target of loose) await context.ask({ op: "disconnect", at: here(), target });
  if (names.length || comments.length) await context.ask({ op: "remove", at: here(), names, comments });
}

async function group(context: Context): Promise<void> {
  const { names } = selection(context);
  if (!names.length) return toast("Select the blocks for the subsystem", true);
  const before = new Set(Object.keys(scopeNow().nodes));
  if (!(await context.ask({ op: "group", at: here(), names }))) return;
  select(Object.keys(scopeNow().nodes).filter((name) => !before.has(name)));
}

async function ungroup(context: Context): Promise<void> {
  const { names } = selection(context);
  for (const name of names) {
    if (scopeNow().nodes[name]?.type === "diagram") await context.ask({ op: "ungroup", at: here(), name });
  }
}

function comment(context: Context): void {
  const [x, y] = freePlace(context);
  void context.ask({ op: "comment", at: here(), text: "Comment", box: [x, y, 200, 60] });
}

function openForm(): void {
  setPanel("inspector", true);
  useUi.setState({ tab: "Form" });
}

function openInner(context: Context): void {
  const [name] = selection(context).names;
  if (name && scopeNow().nodes[name]?.type === "diagram") enter([...here(), name]);
  else if (name) {
    openForm();
    requestAnimationFrame(() => find(".inspector input")?.focus());
  }
}

function rename(): void {
  openForm();
  requestAnimationFrame(() => find<HTMLInputElement>(".name-field")?.select());
}

const step = (dx: number, dy: number) => (context: Context) => {
  const { names } = selection(context);
  if (!names.length) return;
  const chosen = new Set(names);
  const positions = Object.fromEntries(
    context.flow
      .getNodes()
      .filter((node) => chosen.has(node.id))
      .map((node) => [node.id, [node.position.x + dx, node.position.y + dy]]),
  );
  return context.ask({ op: "move", at: here(), positions });
};

const moves: Command[] = (
  [
    ["left", "ArrowLeft", -10, 0],
    ["right", "ArrowRight", 10, 0],
    ["up", "ArrowUp", 0, -10],
    ["down", "ArrowDown", 0, 10],
  ] as const
).flatMap(([way, key, dx, dy]) => [
  { label: `Move ${way}`, group: "Edit" as const, keys: [key], run: step(dx, dy) },
  { label: `Move far ${way}`, group: "Edit" as const, keys: [`Shift+${key}`], run: step(10 * dx, 10 * dy) },
]);

export const editCommands: Command[] = [
  { label: "Undo", group: "Edit", keys: ["Mod+Z"], run: ({ ask }) => ask({ op: "undo" }) },
  { label: "Redo", group: "Edit", keys: ["Mod+Shift+Z", "Mod+Y"], run: ({ ask }) => ask({ op: "redo" }) },
  { label: "Cut", group: "Edit", keys: ["Mod+X"], run: async (context) => (await copy(context)) && remove(context) },
  { label: "Copy", group: "Edit", keys: ["Mod+C"], run: copy },
  { label: "Paste", group: "Edit", keys: ["Mod+V"], run: paste },
  {
    label: "Duplicate",
    group: "Edit",
    keys: ["Mod+D"],
    run: async (context) => (await copy(context)) && paste(context),
  },
  { label: "Delete", group: "Edit", keys: ["Delete", "Backspace"], run: remove },
  { label: "Select all", group: "Edit", keys: ["Mod+A"], run: () => select(Object.keys(scopeNow().nodes)) },
  { label: "Connect…", group: "Edit", keys: ["C"], run: () => openDialog("connect") },
  { label: "Rename", group: "Edit", keys: ["F2"], run: rename },
  { label: "Add a comment", group: "Edit", keys: ["M"], run: comment },
  { label: "Make a subsystem", group: "Edit", keys: ["Mod+G"], run: group },
  { label: "Ungroup a subsystem", group: "Edit", keys: ["Mod+Shift+G"], run: ungroup },
  { label: "Open a subsystem, or a block's form", group: "Edit", keys: ["Enter"], run: openInner },
  { label: "Close the subsystem", group: "Edit", keys: ["Alt+ArrowUp", "U"], run: () => enter(here().slice(0, -1)) },
  ...moves,
];
