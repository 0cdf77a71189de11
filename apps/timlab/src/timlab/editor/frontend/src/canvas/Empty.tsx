import { searchPalette } from "../commands/view";
import { age } from "../session/recoverable";
import { useDocument } from "../session/store";
import { useScope } from "../session/useScope";
import { openDialog, useUi } from "../ui/ui";
import { useAsk } from "../session/context";

/** What an empty canvas says. */
export function Empty() {
  const ask = useAsk();
  const scope = useScope();
  const inner = useUi((ui) => ui.at.length > 0);
  const recoverable = useDocument((document) => document.recoverable);
  const known = useDocument((document) => document.revision !== null);
  if (!known || Object.keys(scope.nodes).length || Object.keys(scope.comments).length) return null;
  return (
    <div className="empty">
      <h2>{inner ? "An empty subsystem" : "An empty diagram"}</h2>
      <p>{inner ? "Inlets and outlets in it are its ports." : "Drag blocks here, or press / and type."}</p>
      {!inner && recoverable.length > 0 && (
        <div className="recover" role="region" aria-label="unsaved work">
          <p>A session ended with unsaved work.</p>
          {recoverable.map((work) => (
            <div key={work.id} className="row">
              <button type="button" className="primary" onClick={() => void ask({ op: "recover", id: work.id })}>
                Take up {work.title || work.file || "the untitled diagram"}
              </button>
              <button
                type="button"
                className="plain"
                onClick={() => void ask({ op: "recover", id: work.id, drop: true })}
              >
                Forget it
              </button>
              <span className="quiet">{age(work)}</span>
            </div>
          ))}
        </div>
      )}
      <div className="row">
        <button type="button" className="plain" onClick={searchPalette}>
          Add a block
        </button>
        {!inner && (
          <>
            <button type="button" className="plain" onClick={() => openDialog("gallery")}>
              From the gallery
            </button>
            <button type="button" className="plain" onClick={() => openDialog("tour")}>
              First steps
            </button>
          </>
        )}
      </div>
    </div>
  );
}
