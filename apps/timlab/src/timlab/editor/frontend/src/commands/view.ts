import { forgetPlaces } from "../canvas/layout";
import { openDialog, setPanel, setTheme, useUi } from "../ui/ui";
import { find } from "../ui/root";
import type { Command } from "./command";

/** The whole of the largest diagram is seen at this zoom. */
export const LEAST_ZOOM = 0.02;

/** Whether dark colours are shown now. */
export function isDark(): boolean {
  const { theme } = useUi.getState();
  return theme === "dark" || (theme === "system" && matchMedia("(prefers-color-scheme: dark)").matches);
}

export const toggleTheme = (): void => setTheme(isDark() ? "light" : "dark");

export function searchPalette(): void {
  setPanel("palette", true);
  useUi.setState({ sought: "" });
  requestAnimationFrame(() => find<HTMLInputElement>(".palette input")?.focus());
}

const toggle = (panel: "palette" | "inspector") => () => setPanel(panel, !useUi.getState()[panel]);

export const viewCommands: Command[] = [
  { label: "Add a block…", group: "View", keys: ["/", "A"], run: searchPalette },
  { label: "All commands…", group: "View", keys: ["Mod+K"], run: () => openDialog("commands") },
  { label: "Go to a block…", group: "View", keys: ["Mod+F"], run: () => openDialog("find") },
  {
    label: "Show everything",
    group: "View",
    keys: ["F"],
    run: ({ flow }) => flow.fitView({ minZoom: LEAST_ZOOM, maxZoom: 1, padding: 0.1, duration: 200 }),
  },
  { label: "Zoom in", group: "View", keys: ["Mod+="], run: ({ flow }) => flow.zoomIn() },
  { label: "Zoom out", group: "View", keys: ["Mod+-"], run: ({ flow }) => flow.zoomOut() },
  { label: "Palette", group: "View", keys: ["1"], run: toggle("palette") },
  { label: "Inspector", group: "View", keys: ["2"], run: toggle("inspector") },
  { label: "Scopes", group: "View", keys: ["3"], run: () => useUi.setState(({ dock }) => ({ dock: !dock })) },
  {
    label: "Pictures of scopes on the canvas",
    group: "View",
    keys: ["P"],
    run: () => {
      forgetPlaces(); // blocks of another size have other places, unless they were put there
      useUi.setState((ui) => ({ pictures: !ui.pictures }));
    },
  },
  { label: "Light or dark", group: "View", keys: ["T"], run: toggleTheme },
  { label: "Keyboard shortcuts", group: "View", keys: ["?"], run: () => openDialog("shortcuts") },
  { label: "First steps", group: "View", run: () => openDialog("tour") },
];
