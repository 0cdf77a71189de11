import { diagramSvg } from "../canvas/diagramSvg";
import { useDocument } from "../session/store";
import { scopeNow } from "../session/useScope";
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

/** The diagram that is open, as a picture. */
function downloadSvg(): void {
  const path = useUi.getState().at.join("/");
  const name = path.replaceAll("/", "-") || (useDocument.getState().file ?? "diagram").replace(/\.json$/, "");
  download(`${name}.svg`, diagramSvg(scopeNow(), path), "image/svg+xml");
}

/** The diagram and its run as one page that anyone can open. */
async function downloadPage({ ask }: Context): Promise<void> {
  const answer = await ask({ op: "page" });
  const name = (useDocument.getState().file ?? "diagram").replace(/\.json$/, "");
  if (answer) download(`${name}.html`, String(answer.text), "text/html");
}

export const fileCommands: Command[] = [
  { label: "New diagram", group: "File", keys: ["Alt+N"], run: fresh },
  { label: "Open…", group: "File", keys: ["Mod+O"], run: () => openDialog("open") },
  { label: "Gallery…", group: "File", keys: ["G"], run: () => openDialog("gallery") },
  { label: "Save", group: "File", keys: ["Mod+S"], run: save },
  { label: "Save as…", group: "File", keys: ["Mod+Shift+S"], run: () => openDialog("save") },
  { label: "Download", group: "File", run: downloadDiagram },
  { label: "Download as SVG", group: "File", run: downloadSvg },
  { label: "Download as a page with its run", group: "File", run: downloadPage },
  { label: "Show as Python…", group: "File", run: () => openDialog("python") },
];
