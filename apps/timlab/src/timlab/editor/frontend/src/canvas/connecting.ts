import { create } from "zustand";
import type { Port } from "../session/types";

/** The end from which a wire is being drawn, while it is. */
export interface From {
  block: string;
  port: Port;
  side: "input" | "output";
}

export const useConnecting = create<{ from: From | null }>(() => ({ from: null }));
