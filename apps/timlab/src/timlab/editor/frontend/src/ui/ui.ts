import { create } from "zustand";

export type Dialog =
  null | "commands" | "connect" | "find" | "shortcuts" | "gallery" | "open" | "save" | "tour" | "python" | "trust";
export type Tab = "Form" | "Problems" | "Log";
export type Theme = "system" | "light" | "dark";

/** What this client looks at. */
export interface Ui {
  /** Names of subsystems, from the outermost inwards. */
  at: string[];
  selected: string[];
  dialog: Dialog;
  theme: Theme;
  /** Whether panels lie above the canvas, one at a time, for want of room. */
  narrow: boolean;
  palette: boolean;
  /** What is sought in the palette. */
  sought: string;
  inspector: boolean;
  /** What the inspector shows. */
  tab: Tab;
  dock: boolean;
  toasts: { id: number; text: string; bad: boolean }[];
  /** Whether sinks show what they see on the canvas. */
  pictures: boolean;
  /** Whether the diagram is being written to its file. */
  saving: boolean;
  /** Blocks to be selected, as soon as they are there. */
  choose: string[] | null;
  /** A block to be shown in the middle, once. */
  show: string | null;
  /** A type of block that cannot be added before some of its fields are given. */
  adding: string | null;
}

const stored = (): Theme => {
  try {
    return (localStorage.getItem("timlab-theme") as Theme | null) ?? "system";
  } catch {
    return "system";
  }
};

export const useUi = create<Ui>(() => ({
  at: [],
  selected: [],
  dialog: null,
  theme: stored(),
  narrow: false,
  palette: true,
  sought: "",
  inspector: true,
  tab: "Form",
  dock: true,
  toasts: [],
  pictures: false,
  saving: false,
  choose: null,
  show: null,
  adding: null,
}));

let last = 0;

/** Tells something for a few seconds, and to screen readers. */
export function toast(text: string, bad = false): void {
  const id = ++last;
  // What is told again stays longer; it does not stand there twice.
  useUi.setState((ui) => ({
    toasts: [...ui.toasts.filter((each) => each.text !== text).slice(-3), { id, text, bad }],
  }));
  window.setTimeout(
    () => useUi.setState((ui) => ({ toasts: ui.toasts.filter((each) => each.id !== id) })),
    bad ? 8000 : 3500,
  );
}

export const openDialog = (dialog: Dialog): void => useUi.setState({ dialog });

/** Closes this one, should it still be open: an answer may come after another has been opened. */
export const closeDialog = (dialog: Dialog): void =>
  useUi.setState((ui) => (ui.dialog === dialog ? { dialog: null } : ui));

export function setTheme(theme: Theme): void {
  try {
    localStorage.setItem("timlab-theme", theme);
  } catch {
    // A notebook may not allow it: the choice holds until the page is left.
  }
  useUi.setState({ theme });
}

/** Opens a panel or folds it away; where it is narrow, the other makes room. */
export const setPanel = (panel: "palette" | "inspector", open: boolean): void =>
  useUi.setState(({ narrow }) => ({ ...(narrow && { palette: false, inspector: false }), [panel]: open }));

export function enter(at: string[]): void {
  useUi.setState({ at, selected: [] });
}
