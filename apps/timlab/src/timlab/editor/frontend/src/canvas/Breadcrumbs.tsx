import { enter, useUi } from "../ui/ui";

/** Where in the diagram one is; to go out again. */
export function Breadcrumbs() {
  const at = useUi((ui) => ui.at);
  if (!at.length) return null;
  return (
    <nav className="crumbs" aria-label="subsystems">
      <button type="button" onClick={() => enter([])}>
        diagram
      </button>
      {at.map((name, depth) => (
        <button
          key={depth}
          type="button"
          aria-current={depth === at.length - 1 ? "location" : undefined}
          onClick={() => enter(at.slice(0, depth + 1))}
        >
          {name}
        </button>
      ))}
    </nav>
  );
}
