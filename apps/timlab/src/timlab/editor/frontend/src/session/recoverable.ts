/** Work of a session that ended unsaved. */
export interface Recoverable {
  id: string;
  file: string | null;
  title: string;
  changes: number;
  /** Seconds since 1970, of the last change. */
  changed: number;
}

/** How much of it there is, and when it was changed last. */
export function age({ changes, changed }: Recoverable): string {
  const when = new Date(1000 * changed).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  return `${changes} ${changes === 1 ? "change" : "changes"}, the last on ${when}`;
}
