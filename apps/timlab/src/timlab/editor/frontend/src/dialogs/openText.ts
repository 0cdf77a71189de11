import type { Ask } from "../session/context";
import { closeDialog, enter, toast } from "../ui/ui";

/** Open a file of the user's machine. What is wrong with it is said, and what was open stays. */
export async function openText(ask: Ask, file: File): Promise<void> {
  let text: string;
  try {
    text = new TextDecoder("utf-8", { fatal: true }).decode(await file.arrayBuffer());
  } catch {
    return toast(`${file.name}: is not a text file`, true);
  }
  if (!(await ask({ op: "open", text }))) return;
  closeDialog("open");
  enter([]);
}
