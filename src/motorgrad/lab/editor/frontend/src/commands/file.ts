import { useDocument } from "../session/store";
import type { Ask } from "../session/context";
import { enter, openDialog, useUi } from "../ui/ui";
import type { Command, Context } from "./command";

/** Save under the name that it has, or ask for one. */
export function save({ ask }: Context): unknown {
  const { file } = useDocument.getState();
  return file ? saveAs(ask, {}) : openDialog("save");
}

/** Save; the toolbar shows it meanwhile. Answers whether it was saved. */
export async function saveAs(ask: Ask, how: { file?: string; over?: boolean }): Promise<boolean> {
  useUi.setState({ saving: true });
  try {
    return (await ask({ op: "save", ...how })) !== null;
  } finally {
    useUi.setState({ saving: false });
  }
}

async function fresh({ ask }: Context): Promise<void> {
  if (await ask({ op: "new" })) enter([]);
}

/** Have the browser keep something as a file. */
export function download(name: string, content: string | Blob, type = "application/json"): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
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
