import { useUi } from "../ui/ui";
import { emptyScope, useDocument } from "./store";
import type { Scope } from "./types";

/** The diagram that is open. */
export function useScope(): Scope {
  const path = useUi((ui) => ui.at.join("/"));
  return useDocument((document) => document.scopes[path] ?? emptyScope);
}

/** As `useScope`, at the moment of asking. */
export const scopeNow = (): Scope => useDocument.getState().scopes[useUi.getState().at.join("/")] ?? emptyScope;
