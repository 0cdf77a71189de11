import { useUi } from "./ui";

/** What is told for a few seconds. */
export function Toasts() {
  const toasts = useUi((ui) => ui.toasts);
  return (
    <div className="toasts" role="log" aria-live="polite" aria-label="messages">
      {toasts.map(({ id, text, bad }) => (
        <p key={id} role={bad ? "alert" : undefined} className={bad ? "bad" : ""}>
          {text}
          {bad && (
            <button
              type="button"
              aria-label="Dismiss"
              onClick={() => useUi.setState({ toasts: toasts.filter((each) => each.id !== id) })}
            >
              ×
            </button>
          )}
        </p>
      ))}
    </div>
  );
}
