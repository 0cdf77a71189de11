import { useDocument } from "../session/store";
import { enter, openDialog } from "../ui/ui";
import type { Command, Context } from "./command";

/** Save under the name that it has, or ask for one. */
export function save({ ask }: Context): unknown {
  const { file } = useDocument.getState();
  return file ? ask({ op: "save" }) : openDialog("save");
}

async function fresh({ ask }: Context): Promise<void> {
  if (await ask({ op: "new" })) enter([]);
}

/** Have the browser keep a text as a file. */
export function download(name: string, text: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

async function downloadDiagram({ ask }: Context): Promise<void> {
  const answer = await ask({ op: "text" });
  if (answer) download(useDocument.getState().file ?? "diagram.json", String(answer.text));
}

export const fileCommands: Command[] = [
  { label: "New diagram", group: "File", keys: ["Alt+N"], run: fresh },
  { label: "Open…", group: "File", keys: ["Mod+O"], run: () => openDialog("open") },
  { label: "Gallery…", group: "File", keys: ["G"], run: () => openDialog("gallery") },
  { label: "Save", group: "File", keys: ["Mod+S"], run: save },
  { label: "Save as…", group: "File", keys: ["Mod+Shift+S"], run: () => openDialog("save") },
  { label: "Download", group: "File", run: downloadDiagram },
  { label: "Show as Python…", group: "File", run: () => openDialog("python") },
];
