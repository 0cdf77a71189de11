import { Tour } from "./Tour";
import { useUi } from "../ui/ui";
import { CommandPalette } from "./CommandPalette";
import { Connect } from "./Connect";
import { Find } from "./Find";
import { Gallery } from "./Gallery";
import { Given } from "./Given";
import { Open } from "./Open";
import { Python } from "./Python";
import { Save } from "./Save";
import { Shortcuts } from "./Shortcuts";
import { Trust } from "./Trust";

const ALL = {
  commands: CommandPalette,
  connect: Connect,
  find: Find,
  shortcuts: Shortcuts,
  gallery: Gallery,
  open: Open,
  save: Save,
  python: Python,
  tour: Tour,
  trust: Trust,
};

/** The window that is open, if one is. */
export function Dialogs() {
  const dialog = useUi((ui) => ui.dialog);
  const adding = useUi((ui) => ui.adding);
  if (adding) return <Given type={adding} />;
  if (!dialog) return null;
  const Shown = ALL[dialog];
  return <Shown />;
}
